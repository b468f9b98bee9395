"""Frequency and damping of a step response: linear prediction against simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from analysis.loops.equilibria import follow_equilibrium
from analysis.loops.ideal_scenarios import changed, frozen_scenario
from analysis.loops.operating_points import OperatingPoint
from diagrams import build_sound_follower, make_simulator
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point


@dataclass(frozen=True)
class Oscillation:
    """Damped oscillation."""

    frequency_rad_s: float
    """Natural frequency, rad/s."""
    damping_ratio: float


@dataclass(frozen=True)
class StepCheck:
    """Response to a start beside the equilibrium: predicted and simulated.

    The start is on the line from the equilibrium to the source.
    """

    predicted: Oscillation
    """Oscillation that the sampled linear model predicts."""
    ideal: Oscillation
    """Oscillation fitted to the simulation with exact sensors."""
    full: Oscillation | None
    """Oscillation fitted to the simulation with the scenario's own sensors. None if
    this simulation was not requested."""
    step_m: float
    """Distance of the start from the equilibrium toward the source, m."""
    time_s: NDArray[np.float64] = field(repr=False)
    """(n,) times, s."""
    predicted_m: NDArray[np.float64] = field(repr=False)
    """(n,) distance of P from the source, by the linear model, m."""
    ideal_m: NDArray[np.float64] = field(repr=False)
    """(n,) distance of P from the source, with exact sensors, m."""
    full_m: NDArray[np.float64] | None = field(repr=False)
    """(n,) distance of P from the source, with the scenario's own sensors, m."""

    @property
    def frequency_error(self) -> float:
        """Relative error of the predicted frequency.

        The reference is the simulation with exact sensors.
        """
        return self.predicted.frequency_rad_s / self.ideal.frequency_rad_s - 1.0

    @property
    def damping_error(self) -> float:
        """Relative error of the predicted damping ratio.

        The reference is the simulation with exact sensors.
        """
        return self.predicted.damping_ratio / self.ideal.damping_ratio - 1.0


def check_step(
    scenario: Scenario,
    *,
    step_m: float = 0.05,
    duration_s: float = 25.0,
    full: bool = False,
) -> StepCheck:
    """Simulates a start near the equilibrium and compares it with the linear model.

    The start is ``step_m`` from the equilibrium toward the source. Bodies rest where
    they are at 0 s. If ``full`` is true, the scenario is also simulated with its own
    sensors. Raises InputError if there is no stable equilibrium, or if the linear model
    does not oscillate.
    """
    point = follow_equilibrium(scenario)
    modes = [mode for mode in point.modes if mode.eigenvalue.imag > 1e-6]
    if not modes:
        raise InputError(
            "attraction",
            "nothing oscillates about the equilibrium, so that there is no frequency "
            "to compare; use a larger stiffness_n_m for this damping_n_s_m",
        )
    # The mode with the highest frequency is that along the line to the source.
    along = max(modes, key=lambda mode: mode.frequency_rad_s)
    ideal = _run(point.loop.scenario, point, step_m, duration_s)
    own = None
    if full:
        own = _run(frozen_scenario(scenario), point, step_m, duration_s)
    return StepCheck(
        predicted=Oscillation(along.frequency_rad_s, along.damping_ratio),
        ideal=fitted_step(*ideal, along.frequency_rad_s),
        full=fitted_step(*own, along.frequency_rad_s) if own else None,
        step_m=step_m,
        time_s=ideal[0],
        predicted_m=_predicted(point, step_m, ideal[0]),
        ideal_m=ideal[1],
        full_m=own[1] if own else None,
    )


def _predicted(
    point: OperatingPoint, step_m: float, time_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) distances of P from the source that the linear model predicts, m."""
    loop = point.loop
    A = loop.period_derivatives(point.state, point.time_s).A
    ahead = point.axes[0]
    x, y = (loop.state_names.index(f"plant.{name}") for name in "xy")
    deviation = np.zeros(len(A))
    deviation[[x, y]] = step_m * ahead
    ticks = np.arange(math.ceil(time_s[-1] / loop.tick_s - 1e-9) + 1)
    distance = np.empty(len(ticks))
    for k in ticks:
        # Turning moves P across the line, not along it.
        distance[k] = point.source_distance_m - ahead @ deviation[[x, y]]
        deviation = A @ deviation
    return np.interp(time_s, loop.tick_s * ticks, distance)


def _run(
    scenario: Scenario, point: OperatingPoint, step_m: float, duration_s: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Simulated times, s, and distances of P from the source, m.

    The start is ``step_m`` from the equilibrium ``point`` toward the source.
    """
    ahead = np.array([math.cos(point.theta_WB), math.sin(point.theta_WB)])
    epsilon = scenario.only.robot.control_point_m
    x, y = control_point((*(point.p_WP + step_m * ahead), point.theta_WB), -epsilon)
    start = {"position_m": [x, y], "heading_deg": math.degrees(point.theta_WB)}
    # The stop rules are left out. After a small step, the robot is so slow that they
    # would take it to be at rest and end the run.
    follower = build_sound_follower(changed(scenario, {"start": start}), log=True)
    simulator = make_simulator(follower)
    simulator.Initialize()
    simulator.AdvanceTo(duration_s)
    assert follower.log is not None
    assert next(iter(follower.logged)) == ("plant", "pose_WB")
    log = follower.log.FindLog(simulator.get_context())
    x, y, theta = np.array(log.data())[:3]
    p_WS = scenario.source.path().pose(0.0)
    distance = np.hypot(
        p_WS[0] - x - epsilon * np.cos(theta), p_WS[1] - y - epsilon * np.sin(theta)
    )
    return np.array(log.sample_times()), distance


def fitted_step(
    time_s: NDArray[np.float64], distance_m: NDArray[np.float64], guess_rad_s: float
) -> Oscillation:
    """Fits a damped oscillation about a constant by least squares.

    ``time_s`` and ``distance_m`` are (n,). The first two seconds are left out.
    ``guess_rad_s`` is an initial guess of the frequency. Besides the oscillation, the
    fit has a bias and a second harmonic, which decay at the same rate. They occur
    because the push depends on the norm of a velocity. This norm adds no damping.
    """
    later = time_s >= 2.0
    t, x = time_s[later] - 2.0, distance_m[later]

    def waves(rate: float, omega: float) -> NDArray[np.float64]:
        """(n, 6) columns: constant, bias, fundamental (2), and second harmonic (2)."""
        fade = np.exp(-rate * t)
        harmonics = [f(k * omega * t) * fade for k in (1, 2) for f in (np.cos, np.sin)]
        return np.column_stack([np.ones_like(t), fade, *harmonics])

    def left(guess: NDArray[np.float64]) -> NDArray[np.float64]:
        basis = waves(*guess)
        weights = np.linalg.lstsq(basis, x)[0]
        return np.asarray(basis @ weights - x) / np.ptp(x)

    found = least_squares(
        left, (0.15 * guess_rad_s, guess_rad_s), xtol=1e-14, ftol=1e-14
    )
    rate, omega = (float(value) for value in found.x)
    natural = math.hypot(rate, omega)
    return Oscillation(natural, rate / natural)
