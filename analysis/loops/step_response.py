"""Comparison of linear prediction and simulation: frequency and damping of a step."""

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
    damping_ratio: float


@dataclass(frozen=True)
class StepCheck:
    """Response to a step along the line to the source: predicted and simulated."""

    predicted: Oscillation
    """By the sampled linear model."""
    ideal: Oscillation
    """Fitted to the simulation with exact sensors."""
    full: Oscillation | None
    """Fitted to the simulation with the scenario's sensors."""
    step_m: float
    time_s: NDArray[np.float64] = field(repr=False)
    """(n,)"""
    predicted_m: NDArray[np.float64] = field(repr=False)
    """(n,) distance of P from the source, by the linear model, m."""
    ideal_m: NDArray[np.float64] = field(repr=False)
    """(n,) distance of P from the source, with exact sensors, m."""
    full_m: NDArray[np.float64] | None = field(repr=False)
    """(n,) distance of P from the source, with the scenario's sensors, m."""

    @property
    def frequency_error(self) -> float:
        """Relative error of the predicted frequency, compared to exact sensors."""
        return self.predicted.frequency_rad_s / self.ideal.frequency_rad_s - 1.0

    @property
    def damping_error(self) -> float:
        """Relative error of the predicted damping ratio, compared to exact sensors."""
        return self.predicted.damping_ratio / self.ideal.damping_ratio - 1.0


def check_step(
    scenario: Scenario,
    *,
    step_m: float = 0.05,
    duration_s: float = 25.0,
    full: bool = False,
) -> StepCheck:
    """Simulates a start near the equilibrium and compares it with the linear model.

    The start is ``step_m`` from the equilibrium towards the source. Bodies rest where
    they are at 0 s. ``full`` also simulates the scenario's own sensors. Raises
    InputError if there is no stable equilibrium, or its linear model does not
    oscillate.
    """
    point = follow_equilibrium(scenario)
    modes = [mode for mode in point.modes if mode.eigenvalue.imag > 1e-6]
    if not modes:
        raise InputError(
            "attraction",
            "nothing oscillates about the equilibrium, so that there is no frequency "
            "to compare; use a larger stiffness_n_m for this damping_n_s_m",
        )
    # Along the line to the source, the oscillation has the highest frequency.
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
    """(n,) distance of P from the source, from the one-period matrix, m."""
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
    """Times, s, and distances of P from the source, m, after a start near the point."""
    ahead = np.array([math.cos(point.theta_WB), math.sin(point.theta_WB)])
    epsilon = scenario.only.robot.control_point_m
    x, y = control_point((*(point.p_WP + step_m * ahead), point.theta_WB), -epsilon)
    start = {"position_m": [x, y], "heading_deg": math.degrees(point.theta_WB)}
    # No stop rules: the robot is so slow after a small step that it counts as at rest.
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

    The fit also has a bias and a second harmonic that decay with the oscillation. The
    repulsion depends on the norm of a velocity. This norm causes a bias and a second
    harmonic, but no damping. The first two seconds are left out. ``guess_rad_s`` is an
    initial guess of the frequency.
    """
    later = time_s >= 2.0
    t, x = time_s[later] - 2.0, distance_m[later]

    def waves(rate: float, omega: float) -> NDArray[np.float64]:
        """(n, 6) constant, bias, fundamental and second harmonic."""
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
