"""Family of heading loops of a robot that searches, for uncertain parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.loops.heading_loop import heading_loop
from analysis.loops.motion_families import (
    Box,
    BoxFamilies,
    ClosedLoop,
    MotionFamily,
    interval_family,
    of_box,
)
from analysis.loops.robustness import (
    LAG_REASON,
    WHEEL_RADIUS,
    PoleFunction,
    UncertainParameter,
    within_share,
)
from diagrams.scenario.scenario import Scenario


def heading_uncertainty(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    """Returns the uncertain parameters of the loop of the heading."""
    lag = scenario.only.plant.motor_lag_s
    strength = within_share(
        "motor_strength", "strength", "1", 1.0, 0.1, "load, battery"
    )
    if lag == 0.0:
        return (strength, WHEEL_RADIUS)
    lags = within_share("plant.motor_lag_s", "lag", "s", lag, 0.4, LAG_REASON)
    return (lags, strength, WHEEL_RADIUS)


def heading_families(scenario: Scenario) -> BoxFamilies:
    """Returns a function from a box to the closed loops of the heading."""
    motors, robot = scenario.searcher.motor_driver, scenario.only.robot

    def closed(lag: float, strength: float, radius: float) -> ClosedLoop:
        loop = heading_loop(motors, robot, lag, scenario.tick_s)
        A = loop.A - strength * radius * loop.B @ loop.C
        return ClosedLoop(A, loop.B, strength * radius * loop.C)

    def families(box: Box) -> Sequence[MotionFamily]:
        names = ("plant.motor_lag_s", "motor_strength", "wheel_radius_share")
        nominal = (scenario.only.plant.motor_lag_s, 1.0, 1.0)
        intervals = [of_box(box, *each) for each in zip(names, nominal, strict=True)]
        return [interval_family(closed, intervals, scenario.tick_s)]

    return families


def heading_poles(scenario: Scenario) -> PoleFunction:
    """Returns a function for the z-plane poles of the closed loop of the heading."""
    families = heading_families(scenario)

    def poles(values: Mapping[str, float]) -> NDArray[np.complex128]:
        (family,) = families({name: (value, value) for name, value in values.items()})
        return np.linalg.eigvals(family.matrix_of(np.empty(0))).astype(complex)

    return poles
