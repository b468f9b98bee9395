"""Decides at every tick whether a run ends, and for which cause.

A tick is a control period. ``judge_robot`` applies the stop rules to one robot at one
tick. Both engines call it through the referee (``diagrams.running.referee``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.world.contacts import first_overlap
from systems.world.geometry import control_point, control_point_velocity

#: Causes of successful runs.
SUCCESSFUL = ("reached", "completed", "found")
#: Causes that end the run of all robots.
ENDING = ("collision", "diverged")
#: Cause of a robot whose run ends early because the run of all robots ends.
INTERRUPTED = "interrupted"

#: Tolerance for rounded tick times, s. With this tolerance, a rest of exactly
#: ``stop.rest_time_s`` counts.
ROUNDING_S = 1e-9

#: Speed below which P is at rest, m/s.
REST_SPEED_M_S = 0.05
#: Least share of the time since the first detection. If P follows the target for at
#: least this share, the run counts as completed.
FOLLOWING_SHARE = 0.5
#: If P stays within this distance of a position, m, P counts as in one place.
_STUCK_RADIUS_M = 0.1
#: Limits at the end of a search for an odor. If both limits hold, the run counts as
#: found. ``ODOR_WITHIN_M``: distance of the source from the origin of B, m.
#: ``_ODOR_AHEAD_DEG``: angle between the heading and the direction to the source, deg.
ODOR_WITHIN_M, _ODOR_AHEAD_DEG = 0.22, 75.0

#: Ports of a robot that the stop rules read, with their sizes. If a robot lacks a port,
#: its values are 0. ``gives_up``: whether the law has found that no route leads to the
#: target. ``search_report``: how a search ended. ``contact``: the contact switches of a
#: searching robot. ``touched``: the body that these switches touch.
READ_PORTS = {
    "velocity_WB": 3,
    "target_valid": 1,
    "gives_up": 1,
    "search_report": 4,
    "contact": 2,
    "touched": 1,
}


@dataclass(frozen=True)
class Collision:
    """A contact between a robot and a body."""

    object: str
    """Name of the body that the robot touched."""
    fault: str
    """Who is at fault, ``robot`` or ``obstacle``. The rule compares two motions since
    the last tick (control period): that of the robot alone, and that of the body alone.
    The motion that brings the two nearer to each other is at fault. Turning counts as
    motion. A body at rest is never at fault.
    """
    time: float
    """Time of the first contact, s, with a resolution of a fifth of a tick (control
    period) or better.
    """


class RuleNumbers(NamedTuple):
    """Numbers that the stop rules use, except those for contacts."""

    stop: Any
    """``StopParameters`` in which ``diverged_range_m`` is a number."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    follow_distance_m: float
    goal_radius_m: float
    source_rests: bool
    searches: int = 0
    """1: the robot searches for an odor; 2: for a sound; 0: it does not search."""


#: Causes that the stop rules find at a tick, by index.
FOUND = (
    "",
    "diverged",
    "reached",
    "lost",
    "stuck",
    "no way found",
    "found",
    "false find",
    "collision",
)
_DIVERGED, _COLLISION = map(FOUND.index, ("diverged", "collision"))


class _StatePlaces(NamedTuple):
    """Indices in the state of ``judge_tick``."""

    stays: int
    """Time at which P began to stay in its present place, s. The next two elements are
    x and y of P at this time in W, m."""
    x: int
    y: int
    seen: int
    """Time of the last valid target, s."""
    rests: int
    """Time at which P came to rest in the goal, s."""
    in_goal: int
    """Whether P has been in the goal, 0 or 1."""
    ticks: int
    """Number of ticks since the first detection."""
    following: int
    """Number of these ticks in which P followed the target."""


_AT = _StatePlaces(*range(8))
#: State of ``judge_tick`` before the first tick, in the order of ``_StatePlaces``.
UNJUDGED = (0.0, math.inf, math.inf, 0.0, math.inf, 0.0, 0.0, 0.0)


@register_jitable
def judge_tick(
    time: float,
    state: Any,
    pose: Any,
    velocity: Any,
    p_WS: Any,
    valid: bool,  # noqa: FBT001  # compiled code has no keywords
    gives_up: bool,  # noqa: FBT001
    numbers: RuleNumbers,
) -> int:
    """Decides whether the run of a robot ends at a tick (control period), and why.

    The function applies all stop rules except the rule for contacts, in this order:
    diverged, reached, lost, and stuck or no way found.

    ``state`` contains the start time of each condition that must last for some time. It
    also contains two counts: the ticks since the first detection of the target, and the
    number of these ticks in which the control point P follows the target.
    ``Referee.cause_of`` uses both counts if the run reaches its time limit.

    Args:
        time: Time of the tick, s.
        state: State of the rules, initially ``UNJUDGED``; changed in place.
        pose: (x, y, theta) of the robot in the world frame W, m and rad.
        velocity: (vx, vy, omega) of the robot in W, m/s and rad/s.
        p_WS: (x, y) of the target in W, m.
        valid: Whether the robot has a valid estimate of a target.
        gives_up: Whether the law reports that no route leads to the target.
        numbers: Constants of the rules.

    Returns:
        Index of the cause in ``FOUND``; 0 if the run continues.
    """
    stop = numbers.stop
    # Diverged: P is too far from the target, or its position is NaN.
    x_P, y_P = control_point(pose, numbers.control_point_m)
    distance = math.hypot(p_WS[0] - x_P, p_WS[1] - y_P)
    if not distance <= stop.diverged_range_m:
        return 1
    in_goal = distance <= numbers.goal_radius_m
    # Data for the cause of a run that reaches its time limit.
    if in_goal:
        state[_AT.in_goal] = 1.0
    if valid or state[_AT.ticks] > 0.0:
        error = abs(distance - numbers.follow_distance_m)
        state[_AT.ticks] += 1.0
        if error <= stop.following_band_m:
            state[_AT.following] += 1.0
    # Reached: P has rested in the goal of a target at rest for long enough. If no rest
    # is wanted, P may pass.
    there = numbers.source_rests and in_goal and valid
    if there and stop.rest_time_s > 0.0:
        vx, vy = control_point_velocity(pose[2], velocity, numbers.control_point_m)
        there = math.hypot(vx, vy) < REST_SPEED_M_S
    state[_AT.rests] = min(state[_AT.rests], time) if there else math.inf
    if time - state[_AT.rests] >= stop.rest_time_s - ROUNDING_S:
        return 2
    # Lost: there has been no target for too long.
    if valid:
        state[_AT.seen] = time
    elif time - state[_AT.seen] > stop.lost_after_s:
        return 3
    # Stuck: P stays in one place outside of the goal although there is a target.
    way = math.hypot(x_P - state[_AT.x], y_P - state[_AT.y])
    if not valid or in_goal or way > _STUCK_RADIUS_M:
        state[_AT.stays], state[_AT.x], state[_AT.y] = time, x_P, y_P
        return 0
    if time - state[_AT.stays] < stop.stuck_after_s:
        return 0
    return 5 if gives_up else 4


@register_jitable
def judge_search(ended: float, pose: Any, p_WS: Any, numbers: RuleNumbers) -> int:
    """Decides whether the run of a searching robot ends at a control period, and why.

    The function applies all stop rules of a search except the rule for contacts. The
    causes are:

    - diverged: the robot is too far from the source.
    - found: the search succeeded near the source. In a search for an odor, the source
      must also be ahead of the robot.
    - false find: the search succeeded elsewhere.
    - lost: the robot gave up the search.

    Args:
        ended: Number of the ending, see ``systems.search.search_ending``.
        pose: (x, y, theta) of the robot in the world frame W, m and rad.
        p_WS: (x, y) of the source in W, m.
        numbers: Constants of the rules.

    Returns:
        Index of the cause in ``FOUND``; 0 if the run continues.
    """
    dx, dy = p_WS[0] - pose[0], p_WS[1] - pose[1]
    distance = math.hypot(dx, dy)
    # Diverged: the robot is too far from the source, or its position is NaN.
    if not distance <= numbers.stop.diverged_range_m:
        return 1
    if ended < 0.5:
        return 0
    if ended > 1.5:
        return 3
    if numbers.searches == 2:
        return 6 if distance <= numbers.stop.sound_within_m else 7
    off = math.atan2(dy, dx) - pose[2]
    off = abs(math.degrees(math.atan2(math.sin(off), math.cos(off))))
    ahead = off <= _ODOR_AHEAD_DEG
    return 6 if ahead and distance <= ODOR_WITHIN_M else 7


class BodyTable(NamedTuple):
    """The bodies that a robot can touch, and the target of this robot."""

    owners: NDArray[np.int64]
    """(n,) number of the body of each rectangle. A body has one or more rectangles."""
    sizes: NDArray[np.float64]
    """(n, 3) lengths, widths and radii of the rectangles, m."""
    reach: NDArray[np.float64]
    """(n,) distances between the centers of robot and rectangle, m, beyond which they
    cannot touch. The value is -inf for a goal, which has no body.
    """
    steps: NDArray[np.float64]
    """(n,) upper bounds of the distances that the centers of the rectangles move in a
    tick (control period), m; 0 for robots.
    """
    robots: NDArray[np.int64]
    """(n,) number of the robot if the rectangle is a robot; otherwise -1."""
    parts: int
    """Number of equal parts of a tick. Poses are known at the end of each part."""
    rows: NDArray[np.int64]
    """(n, 2) two numbers for each rectangle: the row in ``poses`` of the first tick,
    and the number of rows per tick (0 for a body at rest).
    """
    poses: NDArray[np.float64]
    """(m, 3) poses (x, y, theta) in the world frame W of the rectangles that are not
    robots, m and rad. Each tick is divided into parts, and there is one row for the end
    of each part.
    """


class RefereeNumbers(NamedTuple):
    """Constants of ``judge_robot``."""

    robot: int
    """Number of the robot that is judged."""
    size: tuple[float, float, float]
    """Length and width of the robot, m, and 0."""
    target: int
    """Row of the target in ``bodies``."""
    bodies: BodyTable
    rules: RuleNumbers
    tick_s: float


class RefereeState(NamedTuple):
    """State of ``judge_robot``."""

    rules: NDArray[np.float64]
    """(8,) state of ``judge_tick``."""
    before: NDArray[np.float64]
    """(robots, 3) poses of all robots at the previous tick, m and rad. At the first
    tick, these are the present poses.
    """
    now: NDArray[np.float64]
    """(robots, 3) poses of all robots at the last tick."""
    valid: NDArray[np.float64]
    """(1,) whether the robot had a target at the last tick, 0 or 1."""
    ended: NDArray[np.float64]
    """(1,) number of the ending of a search; 0 while the search continues."""
    contact: NDArray[np.float64]
    """(3,) data of the contact: number of the touched body (-1: none), elapsed part of
    the tick (0 to 1), and number of the tick.
    """
    found: NDArray[np.int64]
    """(1,) index of the cause in ``FOUND``; 0 while the run continues."""


def judge_robot(
    tick: int, state: RefereeState, inputs: Any, outputs: Any, numbers: RefereeNumbers
) -> None:
    """Applies the stop rules to one robot at a tick (control period).

    The result is the cause, the reason why the run of the robot ends. The function
    first looks for a contact between the robot and a body. A contact that closes a
    contact switch of the robot is intended and does not count. Without a contact,
    ``judge_search`` or ``judge_tick`` judges a robot that has no cause yet.

    A robot with a cause keeps it while the run of the other robots continues. If it
    collides later, its cause becomes collision.

    Args:
        tick: Number of the tick.
        state: State of the rules for this robot, changed in place. ``state.found`` is
            the result.
        inputs: (robots, 3) poses of all robots in the world frame W, m and rad; then
            the values of ``READ_PORTS``.
        outputs: Empty.
        numbers: Constants of the rules for this robot.
    """
    poses, velocity, valid, gives_up, report, switches, body = inputs
    for k in range(len(poses)):
        for j in range(3):
            state.before[k, j] = poses[k, j] if tick == 0 else state.now[k, j]
            state.now[k, j] = poses[k, j]
    state.valid[0] = 1.0 if valid[0] > 0.5 else 0.0
    touched, part = -1, 0.0
    if not ((switches[0] > 0.5 or switches[1] > 0.5) and body[0] >= 0.0):
        touched, part = _first_touched(tick, state, numbers)
    pose = state.now[numbers.robot]
    target = _pose_of(numbers.target, tick, state, numbers.bodies)
    if touched >= 0:
        state.contact[0], state.contact[1], state.contact[2] = touched, part, tick
        state.found[0] = _COLLISION
    elif state.found[0] == 0 and numbers.rules.searches > 0:
        state.ended[0] = report[0]
        state.found[0] = judge_search(report[0], pose, target, numbers.rules)
    elif state.found[0] == 0:
        state.found[0] = judge_tick(
            tick * numbers.tick_s,
            state.rules,
            pose,
            velocity,
            target,
            valid[0] > 0.5,
            gives_up[0] > 0.5,
            numbers.rules,
        )


@register_jitable
def _pose_of(
    row: int, tick: int, state: RefereeState, bodies: BodyTable
) -> NDArray[np.float64]:
    if bodies.robots[row] >= 0:
        return state.now[bodies.robots[row]]
    return bodies.poses[bodies.rows[row, 0] + bodies.rows[row, 1] * tick]


@register_jitable
def _first_touched(
    tick: int, state: RefereeState, numbers: RefereeNumbers
) -> tuple[int, float]:
    """Returns the first body that a robot has touched in the last control period.

    The function skips rectangles that are too far away. For the other rectangles,
    ``first_overlap`` gets the poses at several instants within the period, and also
    finds contacts between these instants. The poses of other robots are interpolated.
    The poses of all other bodies are known in advance.

    Returns:
        Number of the body (-1 for none), and elapsed part of the period (0 to 1).
    """
    bodies, parts = numbers.bodies, numbers.bodies.parts
    pose, before = state.now[numbers.robot], state.before[numbers.robot]
    gone = math.hypot(pose[0] - before[0], pose[1] - before[1])
    touched, first = -1, np.inf
    for row in range(len(bodies.reach)):
        robot, step = bodies.robots[row], bodies.steps[row]
        now = _pose_of(row, tick, state, bodies)
        then = state.before[max(robot, 0)]
        if robot >= 0:
            step = math.hypot(now[0] - then[0], now[1] - then[1])
        near = bodies.reach[row] + gone + step
        if math.hypot(now[0] - pose[0], now[1] - pose[1]) > near:
            continue
        if robot >= 0:
            poses = np.empty((parts + 1, 3))
            for k in range(parts + 1):
                for j in range(3):
                    poses[k, j] = then[j] + k / parts * (now[j] - then[j])
        else:
            begin = bodies.rows[row, 0] + bodies.rows[row, 1] * max(tick - 1, 0)
            poses = bodies.poses[begin : begin + (parts + 1 if tick > 0 else 1)]
        size = bodies.sizes[row]
        part = first_overlap(before, pose, numbers.size, poses, size)
        if part < first:
            touched, first = bodies.owners[row], part
    return touched, first


@register_jitable
def run_is_over(found: Any) -> bool:
    """Returns whether the run of all robots is over.

    The cause of a robot is the reason why its run ends. The run of all robots ends when
    every robot has a cause, or when one robot collides or diverges. A robot with any
    other cause keeps moving until then. ``found`` has, for each robot, the index of its
    cause in ``FOUND``, or 0 if the robot has no cause.
    """
    everyone = True
    for k in range(len(found)):
        if found[k] == _COLLISION or found[k] == _DIVERGED:
            return True
        everyone = everyone and found[k] > 0
    return everyone
