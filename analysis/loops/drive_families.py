"""Loops of a robot that drives along a way by the guarded law, on free floor.

The law commands a speed and a yaw rate (``systems.planning``). Far from its limits, and
without weaving, evasion and looks, it consists of three linear loops:

- the distance to the target: speed v = k_v (l - d_f)
- the motion across a straight way at cruise speed: yaw rate w = -k_w (theta + y/c) for
  the heading theta, the deviation y from the way, and a carrot at the distance c
- the heading at the follow distance: w = k_w/2 times the error of the heading. A robot
  that drives onto a goal point moves P toward the point instead, by k_v.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from analysis.loops.motion_families import (
    Box,
    BoxFamilies,
    ClosedLoop,
    MotionFamily,
    interval_family,
    late_ticks,
    of_box,
)
from analysis.loops.robustness import (
    LAG_REASON,
    WHEEL_RADIUS,
    PoleFunction,
    UncertainParameter,
    extra_tick,
    within_share,
)
from diagrams.scenario.scenario import Scenario
from systems.laws.guarded_controller import cruise_speed
from systems.planning.drive_heading import LOOK_AHEAD_M
from systems.planning.following import APPROACH_GAIN
from systems.planning.turning import TURN_GAIN

#: Least speed and least distance of the carrot, as shares of the largest.
_LEAST = 1.0 / 3.0
#: A motor without a lag counts as one with this lag, s.
_SHORTEST_LAG_S = 1e-4


def drive_uncertainty(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    """Returns the uncertain parameters of the loops, and those that change on a way."""
    lag, cruise = scenario.only.plant.motor_lag_s, cruise_speed(scenario.only.robot)
    found = [WHEEL_RADIUS, extra_tick(scenario)]
    if lag > 0.0:
        found.insert(
            0, within_share("plant.motor_lag_s", "lag", "s", lag, 0.4, LAG_REASON)
        )
    for name, symbol, unit, most in (
        ("cruise_m_s", "V", "m/s", cruise),
        ("carrot_m", "c", "m", LOOK_AHEAD_M),
    ):
        why = "the law drives slower, and looks less far ahead, in turns"
        found.append(
            UncertainParameter(
                name, symbol, unit, most, _LEAST * most, most, why, scaled=False
            )
        )
    return tuple(found)


def drive_families(scenario: Scenario) -> BoxFamilies:
    """Returns a function from a box to the loops, in the order of ``DRIVE_LOOPS``."""
    period, lag = scenario.tick_s, scenario.only.plant.motor_lag_s
    cruise = cruise_speed(scenario.only.robot)

    def families(box: Box) -> Sequence[MotionFamily]:
        lags = of_box(box, "plant.motor_lag_s", lag)
        radius = of_box(box, "wheel_radius_share", 1.0)
        speeds = of_box(box, "cruise_m_s", cruise)
        carrots = of_box(box, "carrot_m", LOOK_AHEAD_M)
        found = []
        for late in late_ticks(box):

            def straight(
                gain: float, lag: float, radius: float, late: int = late
            ) -> ClosedLoop:
                rates = np.array([[0.0, 1.0], [0.0, -1.0 / _long(lag)]])
                return _held(rates, [gain, 0.0], radius, period, late)

            def across(
                lag: float, radius: float, speed: float, carrot: float, late: int = late
            ) -> ClosedLoop:
                rates = np.zeros((3, 3))
                rates[0, 1], rates[1, 2] = speed, 1.0
                rates[2, 2] = -1.0 / _long(lag)
                feedback = [TURN_GAIN / carrot, TURN_GAIN, 0.0]
                return _held(rates, feedback, radius, period, late)

            found += [
                interval_family(straight, [(gain, gain), lags, radius], period)
                for gain in (APPROACH_GAIN, _heading_gain(scenario))
            ]
            found.append(
                interval_family(across, [lags, radius, speeds, carrots], period)
            )
        return found

    return families


#: Names of the loops. With an uncertain latency, they repeat for each latency.
DRIVE_LOOPS = ("distance", "heading at the target", "across the way")


def drive_poles(scenario: Scenario) -> PoleFunction:
    """Returns a function for the z-plane poles of all loops of ``drive_families``."""
    families = drive_families(scenario)

    def poles(values: Mapping[str, float]) -> NDArray[np.complex128]:
        box = {name: (value, value) for name, value in values.items()}
        matrices = [each.matrix_of(np.empty(0)) for each in families(box)]
        return np.concatenate(
            [np.linalg.eigvals(matrix).astype(complex) for matrix in matrices]
        )

    return poles


def _heading_gain(scenario: Scenario) -> float:
    robot = scenario.only.robot
    follow = scenario.follower.attraction.follow_distance_m
    return APPROACH_GAIN if follow < robot.control_point_m else 0.5 * TURN_GAIN


def _long(lag: float) -> float:
    return max(lag, _SHORTEST_LAG_S)


def _held(
    rates: NDArray[np.float64],
    feedback: Sequence[float],
    radius: float,
    period: float,
    late: int,
) -> ClosedLoop:
    """Samples a motion whose last state follows the command with the motor lag.

    The command is -``feedback`` times the state of ``late`` ticks before, and acts on
    the wheels times ``radius``.
    """
    n = len(rates)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[n - 1, n] = rates, -radius * rates[-1, -1]
    held = expm(whole * period)
    size = n + late
    A, B, C = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
    A[:n, :n], B[:n, 0] = held[:n, :n], held[:n, n]
    if late:
        A[n, :n] = feedback
        A[n + 1 :, n:-1] = np.eye(late - 1)
        C[0, -1] = 1.0
    else:
        C[0, :n] = feedback
    return ClosedLoop(A - B @ C, B, C)
