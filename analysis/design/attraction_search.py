"""Search for an attraction that meets given requirements.

The attraction is the virtual spring and damper that pull the robot to the follow point.
The follow point has a given distance, the follow distance, from the source. The search
chooses the stiffness K_r, the damping D_r, and the follow distance. The defaults of the
project stay K_r = 2 N/m and D_r = 1 N s/m, as printed in the papers.
"""

from __future__ import annotations

import math

from scipy.optimize import brentq

from analysis.design.gain_search import search_gains
from analysis.design.requirements import DesignRequirements, check_law, metres_to_go
from analysis.laws.push_and_pull import DESIGNED_LAWS
from analysis.linear.contact_mode import contact_model
from analysis.models.ideal_scenarios import changed, ideal_scenario
from diagrams.running.simulation import simulate
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.parameters import AttractionParameters

#: Least and largest K_r of the search, N/m.
_STIFFNESSES_N_M = (0.5, 40.0)
#: The follow distance is rounded up to a multiple of this step, m.
_STEP_M = 0.05
#: The first number is the distance of a source so far away that P reaches top speed,
#: m.
#: The second number is a follow distance so large that P stops in front of the
#: source, m.
_APPROACH_M, _STAND_OFF_M = 8.0, 3.0
#: Laws whose push at rest the follow distance must allow for.
_FOLLOWING_LAWS = tuple(
    law for law, tuning in DESIGNED_LAWS.items() if tuning.sets_follow_distance
)


def search_attraction(scenario: Scenario, requirements: DesignRequirements) -> Scenario:
    """Returns the scenario with an attraction and gains that meet the requirements.

    The attraction is the virtual spring (stiffness K_r) and damper (damping D_r) that
    pull the robot to the follow point near the source. It is found in three steps:

    - The ratio D_r/K_r follows from the largest allowed lag behind a moving source.
      This lag is equal to the goal margin.
    - K_r follows from the required damping ratio.
    - The follow distance follows from the overshoot and from the offsets at rest.

    Args:
        scenario: The scenario with the robot, the plant, the source, the sensors, and
            the laws.
        requirements: Requirements that the result must meet.

    Returns:
        A copy of the scenario with new K_r, D_r, follow distance, and gains of the
        laws.

    Raises:
        InputError: No gains meet the requirements.
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
    # D_r is proportional to K_r here, so that the damping ratio grows with K_r.
    # Therefore, K_r is rounded up.
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
    """Returns the scenario with a goal margin that is smaller by the reserve."""
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
    """Returns the least damping ratio of the loop that follows the source.

    The loop is sampled and has the motor lag. The robot moves straight toward the
    source, and there is no obstacle.
    """
    stiffness = scenario.follower.attraction.stiffness_n_m
    return contact_model(scenario, stiffness).damping_ratio


def following_lag(scenario: Scenario) -> float:
    """Returns the lag of the robot behind the follow point of a moving source, m.

    In steady state, the lag is D_r v/K_r, where v is the speed of the source. K_r is
    the stiffness and D_r is the damping of the attraction.
    """
    attraction = scenario.follower.attraction
    time = attraction.damping_n_s_m / attraction.stiffness_n_m
    return time * scenario.source.speed_m_s


def braking_overshoot(scenario: Scenario) -> float:
    """Simulates a braking robot and returns its overshoot past the follow point, m.

    The source is at rest, and the robot approaches at top speed. The simulation has
    exact hearing, no obstacle, and no law. If the robot does not overshoot, the result
    is 0.
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
    """Returns the least follow distance that leaves room for an overshoot.

    Args:
        scenario: The scenario with the length of the leader. The leader is the robot
            that carries the source.
        requirements: The requirements with the clearance to the body of the leader.
        overshoot_m: Overshoot of the follower past the follow point, m.

    Returns:
        The distance from the follower's control point to the source, m. The distance is
        rounded up to a multiple of 5 cm.
    """
    room = scenario.source.length_m / 2.0 + requirements.clearance_m
    least = overshoot_m + room
    return round(math.ceil(least / _STEP_M - 1e-9) * _STEP_M, 2)


def with_attraction(scenario: Scenario, K_r: float, D_r: float) -> Scenario:
    """Returns a copy of a scenario with other gains of the attraction.

    The attraction is the virtual spring and damper that pull the robot to the follow
    point near the source.

    Args:
        scenario: The scenario, which stays unchanged.
        K_r: Stiffness of the spring, N/m.
        D_r: Damping of the damper, N s/m.

    Returns:
        The copy with the new gains.
    """
    attraction = AttractionParameters.model_validate(
        scenario.follower.attraction.model_dump()
        | {"stiffness_n_m": K_r, "damping_n_s_m": D_r}
    )
    return scenario.with_robot(attraction=attraction)
