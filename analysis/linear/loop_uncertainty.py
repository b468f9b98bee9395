"""Uncertain parameters of the robot, and the loops that they change."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.laws.radial_law import radial_law
from analysis.linear.contact_mode import contact_model
from analysis.linear.robustness import PoleFunction, UncertainParameter
from analysis.models.equilibria import nearest_equilibrium
from analysis.models.force_field import ForceField
from analysis.models.ideal_loop import ideal_loop
from analysis.models.operating_points import OperatingPoint, resting_equilibrium
from diagrams import Scenario
from diagrams.scenario.scenario import scenario_from_mapping
from systems.framework.input_error import InputError

#: Range of air temperatures, which bounds the speed of sound, deg C.
_TEMPERATURES_C = (5.0, 35.0)


def following_uncertainty(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    """Returns the uncertain parameters of the loop that follows the source."""
    common = (p for p in _common(scenario) if p.name != "extra_ticks")
    return (*common, _sound_speed(scenario))


def contact_uncertainty(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    """Returns the uncertain parameters of the loop that rests against an obstacle.

    Raises InputError if the repulsion does not grow as the obstacle comes nearer.
    """
    stiffness = radial_law(scenario).stiffest_n_m
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
        # Zero means that the robot has no such spring, damper or lag.
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
    """Returns a validated copy with uncertain parameters at given values, in SI units.

    The name of a parameter determines its effect:

    - A name with a dot is a field of the scenario.
    - ``wheel_radius_share`` acts as negative slip of the wheels, which the encoders do
      not measure.
    - ``sound_speed_m_s`` changes the slope of the estimated range, and so the stiffness
      of the attraction's spring.
    - All other names are ignored here.
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
    """Returns the slope d(estimated range)/d(true range) for a source straight ahead.

    The slope is that at the follow distance. Let l be half the length of the microphone
    row, R the range, h^2 = R^2 + l^2, and k the believed over the true speed of sound.
    From the measured delay the estimator computes the range

        l^2/(2 k (h - R)) - k (h - R)/2.

    The slope of this range is ((h + R)/k + k (h - R))/(2 h). It is 1 if the believed
    speed is ``true_speed``, m/s.
    """
    k = scenario.believed_sound_speed_m_s / true_speed
    half = max(abs(y) for _, y in scenario.only.robot.microphones_m)
    distance = scenario.follower.attraction.follow_distance_m
    h = math.hypot(distance, half)
    return ((h + distance) / k + k * (h - distance)) / (2.0 * h)


def contact_poles(scenario: Scenario) -> PoleFunction:
    """Returns a function for the z-plane poles of the motion towards an obstacle.

    The motion is straight towards the obstacle (contact mode), at the distance where
    the repulsion is stiffest.
    """

    def poles(values: Mapping[str, float]) -> NDArray[np.complex128]:
        changed = with_values(scenario, values)
        stiffness = changed.follower.attraction.stiffness_n_m + values.get(
            "law_stiffness_n_m", 0.0
        )
        late = round(values["extra_ticks"])
        return contact_model(changed, stiffness, latency_ticks=late).poles

    return poles


def following_poles(at: OperatingPoint) -> PoleFunction:
    """Returns a function for the z-plane poles of the motion about an equilibrium.

    The equilibrium moves with the parameters. Neutral poles (z = 1) are left out. The
    latency of hearing is not a parameter here. Odometry assigns each measurement to the
    pose at which the sound was heard. A latency therefore delays the source's motion,
    but not the motion of the loop.
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
