"""What is uncertain about the robot, and the loops that it goes into."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.laws.radial_law import DISTANCE_STEP_M, radial_law
from analysis.linear.contact_mode import contact_matrix
from analysis.linear.robustness import PoleFunction, UncertainParameter
from analysis.models.equilibria import nearest_equilibrium
from analysis.models.force_field import ForceField
from analysis.models.ideal_loop import ideal_loop
from analysis.models.operating_points import OperatingPoint, resting_equilibrium
from diagrams import Scenario
from diagrams.scenario.scenario import scenario_from_mapping
from systems.framework.input_error import InputError

#: Temperatures between which the speed of sound is not known, deg C.
_TEMPERATURES_C = (5.0, 35.0)


def following_uncertainty(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    """The box of parameters of the loop that follows the source."""
    common = (p for p in _common(scenario) if p.name != "extra_ticks")
    return (*common, _sound_speed(scenario))


def contact_uncertainty(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    """The box of parameters of the loop that rests against an obstacle.

    Raises:
        InputError: The law has no spring to obstacles.
    """
    stiffness = law_stiffness(scenario)
    if stiffness <= 0.0:
        raise InputError(
            "law",
            f"{scenario.only.law!r} does not push harder as an obstacle comes nearer, "
            "so that it has no contact mode; choose another law",
        )
    law = _share(
        "law_stiffness_n_m", "K_law", "N/m", stiffness, 0.1, "largest slope -df/dc"
    )
    return (*_common(scenario), law)


def _common(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    gains, robot = scenario.follower.attraction, scenario.only.robot
    printed = "printed without unit"
    lag_reason = "not printed; load, battery"
    shares = (
        ("robot.mass_kg", "M", "kg", robot.mass_kg, 0.1, "virtual mass, as set"),
        ("attraction.stiffness_n_m", "K_r", "N/m", gains.stiffness_n_m, 0.1, printed),
        ("attraction.damping_n_s_m", "D_r", "N s/m", gains.damping_n_s_m, 0.1, printed),
        (
            "plant.motor_lag_s", "lag", "s", scenario.only.plant.motor_lag_s, 0.4,
            lag_reason,
        ),
    )  # fmt: skip
    return (
        # What is absent is not uncertain.
        *(_share(*row) for row in shares if row[3] > 0.0),
        UncertainParameter(
            "wheel_radius_share",
            "r",
            "1",
            1.0,
            0.98,
            1.02,
            "true radius over stated radius: wear, pressure",
        ),
        UncertainParameter(
            "extra_ticks",
            "latency",
            f"{scenario.tick_s * 1e3:g} ms",
            0.0,
            0.0,
            1.0,
            "a processor that needs one more tick; whole ticks",
            whole=True,
        ),
    )


def _share(
    name: str, symbol: str, unit: str, nominal: float, share: float, reason: str
) -> UncertainParameter:
    low, high = nominal * (1.0 - share), nominal * (1.0 + share)
    return UncertainParameter(name, symbol, unit, nominal, low, high, reason)


def _sound_speed(scenario: Scenario) -> UncertainParameter:
    c = scenario.sound_speed_m_s
    ends = [331.5 + 0.6 * t for t in _TEMPERATURES_C]
    return UncertainParameter(
        "sound_speed_m_s",
        "c",
        "m/s",
        c,
        min(c, ends[0]),
        max(c, ends[1]),
        "air of 5 to 35 deg C, while the estimator assumes one speed",
    )


def with_values(scenario: Scenario, values: Mapping[str, float]) -> Scenario:
    """The scenario with uncertain parameters at given values.

    Names with a dot are fields. ``wheel_radius_share`` acts as negative slip,
    which the encoders do not see; ``sound_speed_m_s`` on the slope of the range
    and so on the attraction's spring. Others are not the scenario's.

    Args:
        scenario: The nominal one; it stays as it is.
        values: By name of the parameter, in its SI unit.

    Returns:
        A copy, validated.
    """
    data = scenario.model_dump()
    for name, value in values.items():
        *groups, field = name.split(".")
        node: dict[str, Any] = data
        for group in groups:
            node = node[group]
        if groups:
            node[field] = value
    if "wheel_radius_share" in values:
        data["plant"]["slip"] = [1.0 - values["wheel_radius_share"]] * 2
    if "sound_speed_m_s" in values:
        slope = range_slope(scenario, values["sound_speed_m_s"])
        data["attraction"]["stiffness_n_m"] *= slope
    return scenario_from_mapping(data)


def range_slope(scenario: Scenario, true_speed: float) -> float:
    """d(estimated range)/d(true range) at the follow distance, straight ahead.

    With l the half length of the row, R the range and h^2 = R^2 + l^2, a delay
    that is read with k times the true speed of sound gives the range
    l^2/(2 k (h - R)) - k (h - R)/2, whose slope is ((h + R)/k + k (h - R))/(2 h).

    Args:
        scenario: Its speed of sound is the believed one.
        true_speed: Of the air, m/s.

    Returns:
        A ratio; 1 where the believed speed is the true one.
    """
    k = scenario.believed_sound_speed_m_s / true_speed
    half = max(abs(y) for _, y in scenario.only.robot.microphones_m)
    distance = scenario.follower.attraction.follow_distance_m
    h = math.hypot(distance, half)
    return ((h + distance) / k + k * (h - distance)) / (2.0 * h)


def law_stiffness(scenario: Scenario) -> float:
    """Largest slope -df/dc of the law at rest, N/m."""
    return float(np.max(-np.diff(radial_law(scenario).forces_n)) / DISTANCE_STEP_M)


def contact_poles(scenario: Scenario) -> PoleFunction:
    """Poles of the radial motion where the law is stiffest, in the z plane."""

    def poles(values: Mapping[str, float]) -> NDArray[np.complex128]:
        changed = with_values(scenario, values)
        stiffness = changed.follower.attraction.stiffness_n_m + values.get(
            "law_stiffness_n_m", 0.0
        )
        matrix = contact_matrix(
            changed, stiffness, latency_ticks=round(values["extra_ticks"])
        )
        return np.linalg.eigvals(matrix).astype(np.complex128)

    return poles


def following_poles(at: OperatingPoint) -> PoleFunction:
    """Poles of P's motion about an equilibrium, as it moves with the parameters.

    Those that are neutral are left out. A latency of hearing is no parameter
    here: odometry places what is heard, so that it delays the source's motion
    and not the loop's own.

    Args:
        at: The equilibrium at the nominal values.
    """

    def poles(values: Mapping[str, float]) -> NDArray[np.complex128]:
        loop = ideal_loop(with_values(at.loop.scenario, values))
        place = nearest_equilibrium(ForceField(loop), at.p_WP)
        if place is None:
            raise InputError(
                "attraction",
                f"with {dict(values)} the equilibrium at ({at.p_WP[0]:.3f},"
                f" {at.p_WP[1]:.3f}) m is gone; narrow the box",
            )
        moved = resting_equilibrium(loop, place)
        return np.asarray(np.exp(moved.eigenvalues * loop.tick_s))

    return poles
