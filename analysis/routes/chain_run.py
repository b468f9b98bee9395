"""Simulates a line of robots (chain) in which each robot follows the robot ahead.

The simulation is in discrete time and calls the functions of the law.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.routes.robot_chain import (
    ROBOTS,
    ChainPeak,
    chain_response,
    disc_offsets,
    links_of,
    resting_gaps,
)
from analysis.routes.route_loop import route_law
from diagrams.scenario.scenario import Scenario
from systems.base.wheel_speed_command import clamped_velocity, integrate_velocity
from systems.framework.compiling import njit
from systems.laws.trajectory.trajectory_impedance import (
    ContactNumbers,
    contact_force,
    contact_numbers,
    contacts_of_objects,
    target_force,
)
from systems.laws.trajectory.trajectory_impedance_controller import (
    ACCELERATION_LIMIT_M_S2,
)
from systems.ranging.objects import KNOWN, RADIUS, ROBOT, THERE, VX, X
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS

#: Number of robots in a simulated chain, including the first.
_ROBOTS = ROBOTS[-1]
#: Amplitude of the first robot's oscillation, m. With this amplitude, speeds and
#: accelerations stay far below their limits.
_SHAKEN_M = 0.002
# Number of simulated periods of the oscillation, and number of the last periods from
# which the amplitudes are computed.
_PERIODS, _READ = 40, 5
# Simulated times after and before the instant at which the first robot begins to brake,
# s.
_WATCHED_S, _DRIVEN_S = 25.0, 40.0


class ChainNumbers(NamedTuple):
    """Parameters of a simulated line of robots (chain), for the compiled code."""

    gains: tuple[float, float, float, float]
    """Stiffness K (N/m) and damping D (N s/m) to the target, and stiffness K_e and
    damping D_e of contacts."""
    feed_forward: float
    """Velocity of the target divided by the velocity of the robot ahead."""
    spacing_m: float
    """Desired distance between the control points P of neighbors, m."""
    offset_ahead_m: float
    """First offset of ``disc_offsets``, for the robot ahead, m."""
    offset_behind_m: float
    """Second offset of ``disc_offsets``, for the robot behind, m."""
    contacts: ContactNumbers
    mass: float
    top_speed: float
    """Largest speed of P, m/s."""
    motors: tuple[float, float]
    """Share of the old speed that remains after a control period. Distance that the
    robot coasts in this period, divided by the old speed, s."""
    late_ticks: int
    """Latency of the observed neighbors, in control periods."""
    tick_s: float


@njit(cache=True)
def _object(
    objects: Any, slot: int, x: float, speed: float
) -> None:  # pragma: no cover  (compiled)
    at = slot * OBJECT_SIZE
    objects[at + THERE], objects[at + X] = 1.0, x
    objects[at + VX], objects[at + KNOWN], objects[at + ROBOT] = speed, 1.0, 1.0
    objects[at + RADIUS] = 0.0


@njit(cache=True)
def _run(first: Any, gaps: Any, numbers: ChainNumbers) -> Any:  # pragma: no cover
    """Returns the (ticks, robots) positions of P, m. The robots start in formation."""
    ticks, robots, tick_s = len(first), len(gaps) + 1, numbers.tick_s
    places = np.empty((ticks, robots))
    begin = (first[1] - first[0]) / tick_s
    p, v, w = np.empty(robots), np.full(robots, begin), np.full(robots, begin)
    p[0] = first[0]
    for i in range(1, robots):
        p[i] = p[i - 1] - gaps[i - 1]
    k, d, k_e, d_e = numbers.gains
    late = numbers.late_ticks
    objects = np.zeros(OBJECT_SLOTS * OBJECT_SIZE)
    for tick in range(ticks):
        p[0] = first[tick]
        places[tick] = p
        # Observed positions are ``late`` ticks old. Before the start of the simulation,
        # all robots drive at the same speed.
        seen, speed = np.empty(robots), np.full(robots, begin)
        for i in range(robots):
            then = tick - late
            seen[i] = (
                places[then, i] if then >= 0 else places[0, i] + begin * tick_s * then
            )
            if then > 0:
                speed[i] = (places[then, i] - places[then - 1, i]) / tick_s
        for i in range(1, robots):
            target = (
                seen[i - 1] - numbers.spacing_m,
                0.0,
                numbers.feed_forward * speed[i - 1],
                0.0,
            )
            objects[:] = 0.0
            ahead = seen[i - 1] - p[i] - numbers.offset_ahead_m
            _object(objects, 0, ahead, speed[i - 1])
            if i + 1 < robots:
                behind = p[i] - seen[i + 1] - numbers.offset_behind_m
                _object(objects, 1, -behind, speed[i + 1])
            velocity = v[i], 0.0
            ux, _ = target_force((p[i], 0.0), velocity, target, k, d)
            found = contacts_of_objects(objects, velocity, numbers.contacts)
            fx, _ = contact_force(found, k_e, d_e)
            a, b = clamped_velocity(
                (ux + fx) / numbers.mass, 0.0, ACCELERATION_LIMIT_M_S2
            )
            v[i], _ = integrate_velocity(velocity, (a, b), tick_s, numbers.top_speed)
        kept, coasting = numbers.motors
        for i in range(1, robots):
            p[i] += coasting * w[i] + (tick_s - coasting) * v[i]
            w[i] = kept * w[i] + (1.0 - kept) * v[i]
    return places


def run_chain(
    scenario: Scenario,
    first_m: NDArray[np.float64],
    *,
    feed_forward: float,
    spacing_m: float,
    robots: int = _ROBOTS,
) -> NDArray[np.float64]:
    """Simulates robots that follow one another on a line, behind a given first robot.

    The simulation calls the functions of the law. It includes contacts with both
    neighbors, the limits of acceleration and speed, and the motor lag. It has no safety
    filter.

    The result has the (ticks, robots) positions of the control points P along the line,
    m. ``first_m`` are the (ticks,) positions of the first robot, m. All robots start at
    the speed that the first robot has in its first step. ``feed_forward`` is the
    velocity of a robot's target divided by the velocity of the robot ahead.
    ``spacing_m`` is the desired distance between the points P of neighbors, m.
    """
    own, robot, tick_s = route_law(scenario), scenario.only.robot, scenario.tick_s
    lag = scenario.only.plant.motor_lag_s
    kept = math.exp(-tick_s / lag)
    numbers = ChainNumbers(
        (
            own.stiffness_n_m,
            own.damping_n_s_m,
            own.contact_stiffness_n_m,
            own.contact_damping_n_s_m,
        ),
        float(feed_forward),
        float(spacing_m),
        *disc_offsets(scenario),
        contact_numbers(own),
        robot.mass_kg,
        robot.top_speed_m_s,
        (kept, lag * (1.0 - kept)),
        round(scenario.router.objects.latency_s / tick_s),
        tick_s,
    )
    gaps = resting_gaps(scenario, spacing_m, robots)
    return np.asarray(_run(np.asarray(first_m, dtype=float), gaps, numbers))


@dataclass(frozen=True)
class ChainRun:
    """Amplitudes in a chain whose first robot oscillates: simulated and predicted."""

    name: str
    frequency_rad_s: float
    simulated: NDArray[np.float64]
    """(robots,) simulated amplitude of each robot, divided by that of the first."""
    predicted: NDArray[np.float64]
    """(robots,) the same ratios by the frequency response ``chain_response``."""

    @property
    def difference(self) -> float:
        """Largest relative difference between simulation and prediction."""
        return float(np.abs(self.simulated / self.predicted - 1.0).max())


def shake_chain(scenario: Scenario, name: str, peak: ChainPeak) -> ChainRun:
    """Simulates eight robots on a line, of which the first oscillates.

    ``peak`` gives the feed-forward and the spacing of the chain. It also gives the
    frequency of the oscillation, at which the chain amplifies most. If the chain
    amplifies at no frequency, the oscillation has the natural frequency of a robot. The
    simulation lasts forty periods. The amplitudes in the result are those of the last
    five periods. ``name`` is the name of the result.
    """
    natural = math.sqrt(route_law(scenario).stiffness_n_m / scenario.only.robot.mass_kg)
    omega = peak.frequency_rad_s if peak.grows else natural
    period = math.tau / omega
    time = np.arange(0.0, _PERIODS * period, scenario.tick_s)
    # The first robot starts at rest, at an end of its oscillation.
    first = _SHAKEN_M * (np.cos(omega * time) - 1.0)
    share, spacing = peak.feed_forward, peak.spacing_m
    places = run_chain(scenario, first, feed_forward=share, spacing_m=spacing)
    last = time > (_PERIODS - _READ) * period
    basis = np.column_stack(
        [np.cos(omega * time[last]), np.sin(omega * time[last]), np.ones(last.sum())]
    )
    found = np.linalg.lstsq(basis, places[last], rcond=None)[0]
    sizes = np.hypot(found[0], found[1])
    links = links_of(scenario, share, spacing, _ROBOTS)
    response = np.abs(chain_response(scenario, links, [omega])[0])
    return ChainRun(name, omega, sizes / sizes[0], np.concatenate([[1.0], response]))


@dataclass(frozen=True)
class BrakedChain:
    """Gaps between robots of a chain whose first robot brakes to rest."""

    name: str
    time_s: NDArray[np.float64]
    """(n,) time since the first robot began to brake, s."""
    gap_m: NDArray[np.float64]
    """(n, robots - 1) distance between the control points P of neighbors, m."""
    least_gap_m: NDArray[np.float64]
    """(robots - 1,) least of these distances after the braking began, m."""
    overshoot_m: NDArray[np.float64]
    """(robots - 1,) last of these distances minus the least one, m."""


def brake_chain(
    scenario: Scenario, name: str, *, feed_forward: float, spacing_m: float
) -> BrakedChain:
    """Simulates eight robots in formation, of which the first brakes to rest.

    The speed before braking is the speed of the scenario's route, and the deceleration
    is the acceleration of this route. ``feed_forward`` and ``spacing_m`` are those of
    ``run_chain``. ``name`` is the name of the result.
    """
    speed, slope = (
        scenario.router.route.speed_m_s,
        scenario.router.route.acceleration_m_s2,
    )
    time = np.arange(-_DRIVEN_S, _WATCHED_S, scenario.tick_s)
    braking = np.clip(time, 0.0, speed / slope)
    first = speed * np.minimum(time, 0.0) + speed * braking - 0.5 * slope * braking**2
    places = run_chain(scenario, first, feed_forward=feed_forward, spacing_m=spacing_m)
    after = time >= 0.0
    gaps = -np.diff(places, axis=1)[after]
    least = gaps.min(axis=0)
    return BrakedChain(name, time[after], gaps, least, gaps[-1] - least)
