"""Checks whether the gains of a robot on a route are stable and avoid obstacles."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario.participants import Router
from diagrams.scenario.warnings.scenario_warning import ScenarioWarning
from systems.laws.catalog import ROUTE_LAWS
from systems.laws.trajectory.sampled_bounds import (
    SampledMass,
    damping_bound,
    pull_through_m,
    rate_bound,
    stiffness_bound,
)
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)
from systems.ranging.parameters import OBJECT_SLOTS
from systems.world.plane import beyond_rectangle, rotate

#: ``_STEPS``: greatest number of steps toward the equilibrium. ``_STEP_M``: length of
#: a step that ends the iteration, m.
_STEPS, _STEP_M = 2_000, 1e-6


def route_warnings(prefix: str, robot: Router, tick_s: float) -> list[ScenarioWarning]:
    """Warns if a robot on a route cannot come to rest, or can hit obstacles.

    Args:
        prefix: Prefix of the robot's fields in messages.
        robot: A robot on a route.
        tick_s: Control period, s.

    Returns:
        One warning for each violated bound. The message states the bound.
    """
    if robot.law not in ROUTE_LAWS:
        return []
    own = robot.gains
    of = SampledMass(robot.robot.mass_kg, robot.plant.motor_lag_s, tick_s)
    field = f"{prefix}impedance"
    found = _of_damping(field, own, of) or _of_stiffness(field, own, of)
    body, block = robot.robot, own.block_distance_m
    reach = math.hypot(body.control_point_m + 0.5 * body.length_m, 0.5 * body.width_m)
    if block is not None and block < reach:
        message = (
            f"is {block:g}, but the body reaches {reach:.3g} m from P: it can "
            "touch an obstacle that P stays away from; raise it"
        )
        found.append(ScenarioWarning(f"{field}.block_distance_m", message))
    if isinstance(own, AdaptiveTrajectoryParameters):
        field = f"{prefix}laws.{robot.law}"
        found += _of_rate(field, own, of)
        if not own.safety_filter and block is None:
            found += _of_safety(field, own)
    return found


def _of_safety(field: str, own: AdaptiveTrajectoryParameters) -> list[ScenarioWarning]:
    """Warns if an adaptive law lacks the safety term of eq. 27."""
    if own.rule == "lyapunov" and own.penalty > 0.0:
        message = (
            f"is {own.penalty:g}, but rule lyapunov has no safety term and ignores it; "
            "set rule: sensitivity"
        )
        return [ScenarioWarning(f"{field}.penalty", message)]
    if own.penalty > 0.0 or own.rate == own.contact_rate == 0.0:
        return []
    message = (
        "is 0, so that the adaptation has no safety term, and such a robot "
        "collides more often than with trajectory_conventional; set rule: "
        "sensitivity, penalty: 3, contact_rate: 10 and projected: true, or use "
        "trajectory_filtered"
    )
    return [ScenarioWarning(f"{field}.penalty", message)]


def _of_damping(
    field: str, own: TrajectoryImpedanceParameters, of: SampledMass
) -> list[ScenarioWarning]:
    bound, damping = damping_bound(of), own.damping_n_s_m
    if damping >= bound:
        message = (
            f"is {damping:g}, but from 2 M/T, {bound:g}, on the robot does not come to "
            "rest; lower it"
        )
        return [ScenarioWarning(f"{field}.damping_n_s_m", message)]
    each = own.contact_damping_n_s_m
    if each == 0.0:
        return []
    contacts = math.ceil((bound - damping) / each) - 1
    if contacts >= OBJECT_SLOTS:
        return []
    message = (
        f"is {each:g}: with more than {contacts} contacts at once all dampers "
        f"reach 2 M/T, {bound:g} N s/m, and from this value on the robot does "
        "not come to rest; lower it"
    )
    return [ScenarioWarning(f"{field}.contact_damping_n_s_m", message)]


def _of_stiffness(
    field: str, own: TrajectoryImpedanceParameters, of: SampledMass
) -> list[ScenarioWarning]:
    bound = stiffness_bound(own.damping_n_s_m, of)
    total = own.stiffness_n_m + own.contact_stiffness_n_m
    if total < bound:
        return []
    name, what, value = "stiffness_n_m", "is", own.stiffness_n_m
    if value < bound:
        name, value = "contact_stiffness_n_m", total
        what = "and stiffness_n_m together are"
    message = (
        f"{what} {value:g} N/m, but from {bound:.3g} on a robot with damping_n_s_m "
        f"{own.damping_n_s_m:g} does not come to rest; lower it"
    )
    return [ScenarioWarning(f"{field}.{name}", message)]


def _of_rate(
    field: str, own: AdaptiveTrajectoryParameters, of: SampledMass
) -> list[ScenarioWarning]:
    """Warns if the adapted gains K and D have no limits and can grow without bound."""
    amplitude_m = pull_through_m(own)
    bound = rate_bound(own.rule, amplitude_m, of)
    if own.projected or own.rate < bound:
        return []
    message = (
        f"is {own.rate:g}, but from about {bound:.3g} on K and D run away where the "
        f"target is {amplitude_m:.3g} m ahead; lower it, or set projected"
    )
    return [ScenarioWarning(f"{field}.rate", message)]


def goal_warnings(
    prefix: str,
    robot: Router,
    resting: Mapping[str, NDArray[np.float64]],
    known: NDArray[np.float64],
    margin_m: float,
) -> list[ScenarioWarning]:
    """Warns if obstacles at rest keep a robot away from its goal.

    The control point P of the robot comes to rest where the pull of the goal and the
    pushes of the obstacles balance::

        K (p_d - p) + sum of K_e (S - d_j) n_j = 0

    p is the position of P, and p_d is the goal. d_j is the distance of P from obstacle
    j, and n_j is the unit vector away from this obstacle. K and K_e are stiffnesses,
    and S is the range of the push. For example, if the goal is at the distance b from a
    single wall, P comes to rest at the distance (S - b) K_e/(K + K_e) from the goal.

    The function finds this equilibrium by an iteration, which starts at the goal and
    follows the force until the steps are tiny. If the law adapts its gains, their
    initial values count.

    If the zone of the law narrows, S is at most the distance of the goal from known
    obstacles. Obstacles that the planner learns during the run then do not hold P
    either, because the planner makes a new route.

    Args:
        prefix: Prefix of the robot's fields in messages.
        robot: A robot on a route.
        resting: (n, 6) rectangles (x, y, theta, length, width, radius) of each obstacle
            at rest, by name, in the world frame W, m and rad.
        known: (k, 6) rectangles of the known obstacles at rest in W, m and rad.
        margin_m: ``stop.goal_margin_m``, the permitted distance from the goal, m.

    Returns:
        One warning if P comes to rest farther from the goal than ``margin_m``,
        otherwise none.
    """
    if robot.route is None or robot.law not in ROUTE_LAWS:
        return []
    own = robot.gains
    zone_m, goal = own.security_zone_m, robot.route.goal_m
    p = np.array(goal)
    if own.zone_narrows and robot.route.replan:
        return []
    if own.zone_narrows:
        distances = [math.hypot(*beyond_rectangle(p, row)) for row in known]
        zone_m = min([zone_m, *distances])
    pull, push = own.stiffness_n_m, own.contact_stiffness_n_m
    pushing: list[str] = []
    for _ in range(_STEPS):
        # Force on P, and the obstacles that push it.
        force, pushing = pull * (goal - p), []
        for name, rows in resting.items():
            ways = [np.array(rotate(row[2], *beyond_rectangle(p, row))) for row in rows]
            away = min(ways, key=lambda way: math.hypot(*way))
            distance = math.hypot(*away)
            if 0.0 < distance < zone_m:
                force += push * (zone_m - distance) / distance * away
                pushing.append(name)
        # Step to the equilibrium for the present directions of the pushes.
        step = force / (pull + push * len(pushing))
        p += step
        if math.hypot(*step) < _STEP_M:
            break
    off = math.dist(p, goal)
    if off <= margin_m:
        return []
    # Distance of the goal from one wall at which the offset equals the margin.
    room = zone_m - margin_m * (pull + push) / push
    names = ", ".join(map(repr, pushing))
    message = (
        f"{names} will hold P {off:.2g} m off the goal, farther than "
        f"stop.goal_margin_m, {margin_m:g} m, so that the robot does not arrive; "
        f"move the goal (next to one wall {room:.2g} m away from it is enough), "
        "raise that margin, or lower "
        f"{prefix}impedance.security_zone_m"
    )
    return [ScenarioWarning(f"{prefix}route.goal_m", message)]
