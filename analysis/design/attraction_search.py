"""From requirements to K_r, D_r and the follow distance.

The printed K_r = 2, D_r = 1 are kept as defaults; these are the gains that
would follow from the requirements as well.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from analysis.design.gain_search import search_gains
from analysis.design.requirements import DesignRequirements, check_law, metres_to_go
from analysis.laws.push_and_pull import DESIGNED_LAWS
from analysis.linear.contact_mode import contact_matrix
from analysis.models.ideal_scenarios import changed, ideal_scenario
from diagrams.running.simulation import simulate
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.parameters import AttractionParameters

#: K_r that are tried, N/m.
_STIFFNESSES_N_M = (0.5, 40.0)
#: The follow distance is rounded up to this, m.
_STEP_M = 0.05
#: A source so far away that P reaches top speed, and a follow distance so large
#: that it stops before the source, m.
_APPROACH_M, _STAND_OFF_M = 8.0, 3.0
#: Laws whose offset the follow distance has to allow for.
_FOLLOWING_LAWS = tuple(
    law for law, tuning in DESIGNED_LAWS.items() if tuning.sets_follow_distance
)


def search_attraction(scenario: Scenario, requirements: DesignRequirements) -> Scenario:
    """The scenario with the attraction that the requirements give, and gains for it.

    D_r/K_r follows from the lag behind a moving source, K_r from the damping
    ratio, the follow distance from the overshoot and from the offsets.

    Args:
        scenario: Robot, plant, source, sensors and laws.
        requirements: What is to be met.

    Returns:
        A copy with K_r, D_r, follow distance and gains changed.

    Raises:
        InputError: Nothing meets the requirements.
    """
    time = scenario.stop.goal_margin_m / scenario.source.speed_m_s

    def excess(K_r: float) -> float:
        return (
            attraction_damping_ratio(with_attraction(scenario, K_r, time * K_r))
            - requirements.damping
        )

    low, high = _STIFFNESSES_N_M
    if excess(low) * excess(high) > 0.0:
        raise InputError(
            "attraction.stiffness_n_m",
            f"no value from {low} to {high} N/m has a damping ratio of "
            f"{requirements.damping}; change plant.motor_lag_s",
        )
    # Rounded up, since damping grows with K_r here: D_r grows along with it.
    K_r = math.ceil(10.0 * brentq(excess, low, high)) / 10.0
    scenario = with_attraction(scenario, K_r, round(time * K_r, 2))
    overshoot = braking_overshoot(scenario)
    follow = follow_distance(scenario, requirements, overshoot)
    while True:
        attraction = scenario.follower.attraction.model_copy(
            update={"follow_distance_m": round(follow, 2)}
        )
        scenario = scenario.with_robot(attraction=attraction)
        metres_to_go(scenario, requirements)
        within = _with_reserve(scenario, requirements)
        laws = search_gains(within, requirements)
        within = within.with_robot(laws=laws)
        if all(check_law(within, x, requirements).acceptable for x in _FOLLOWING_LAWS):
            return scenario.with_robot(laws=laws)
        follow += _STEP_M


def _with_reserve(scenario: Scenario, requirements: DesignRequirements) -> Scenario:
    """The scenario with a goal that is smaller by the reserve."""
    margin = scenario.stop.goal_margin_m - requirements.offset_reserve_m
    if margin <= 0.0:
        raise InputError(
            "stop.goal_margin_m",
            f"{scenario.stop.goal_margin_m} m leave no margin after the reserve of "
            f"{requirements.offset_reserve_m} m for the place where P comes to rest; "
            "raise it",
        )
    stop = scenario.stop.model_copy(update={"goal_margin_m": margin})
    return scenario.model_copy(update={"stop": stop})


def attraction_damping_ratio(scenario: Scenario) -> float:
    """Least damping ratio of the loop to the follow point, along the robot.

    Sampled, with the motors' lag; no obstacle.
    """
    z = np.linalg.eigvals(
        contact_matrix(scenario, scenario.follower.attraction.stiffness_n_m)
    )
    s = np.log(z[np.abs(z) > 1e-6].astype(complex)) / scenario.tick_s
    return float(np.min(-s.real / np.abs(s)))


def following_lag(scenario: Scenario) -> float:
    """How far P follows behind the follow point of a moving source, D_r v/K_r, m."""
    attraction = scenario.follower.attraction
    time = attraction.damping_n_s_m / attraction.stiffness_n_m
    return time * scenario.source.speed_m_s


def braking_overshoot(scenario: Scenario) -> float:
    """How far P runs past the follow point of a resting source, m.

    P comes at top speed; no obstacle, exact hearing, no avoidance.
    """
    changes = {
        "law": "none",
        "duration_s": 15.0,
        "obstacles": (),
        "start": {"position_m": [0.0, 0.0], "heading_deg": 0.0},
        "attraction": {"follow_distance_m": _STAND_OFF_M},
        "source": {"waypoints_m": [[_APPROACH_M, 0.0]]},
    }
    run = simulate(changed(ideal_scenario(scenario), changes))
    return max(0.0, _STAND_OFF_M - float(run.columns["source_range_true"].min()))


def follow_distance(
    scenario: Scenario, requirements: DesignRequirements, overshoot_m: float
) -> float:
    """Least follow distance with room for an overshoot, m, rounded up to 5 cm.

    Args:
        scenario: Length of the master robot.
        requirements: The clearance that is to be left.
        overshoot_m: Of P beyond the follow point, m.

    Returns:
        Distance from P to the source, m.
    """
    room = scenario.source.length_m / 2.0 + requirements.clearance_m
    least = overshoot_m + room
    return round(math.ceil(least / _STEP_M - 1e-9) * _STEP_M, 2)


def with_attraction(scenario: Scenario, K_r: float, D_r: float) -> Scenario:
    """The same scenario with another spring and damper to the source.

    Args:
        scenario: It stays as it is.
        K_r: N/m.
        D_r: N s/m.

    Returns:
        A copy.
    """
    attraction = AttractionParameters.model_validate(
        scenario.follower.attraction.model_dump()
        | {"stiffness_n_m": K_r, "damping_n_s_m": D_r}
    )
    return scenario.with_robot(attraction=attraction)
