"""The stop rules of all robots in compiled loops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diagrams.running.stop_rules import (
    DIVERGED,
    RobotRules,
    RuleNumbers,
    instants_of,
    judge_search,
    judge_tick,
)
from systems.framework.compiling import njit
from systems.world.geometry import first_overlap

#: Index of the pose at the previous tick in ``watched``.
BEFORE = 8


class Contacts(NamedTuple):
    """Data by which a compiled loop judges one robot."""

    rules: RuleNumbers
    size: tuple[float, float]
    """Length and width of the robot, m."""
    sizes: NDArray[np.float64]
    """(n, 2) length and width of the bodies, m."""
    reach: NDArray[np.float64]
    """(n,) distances of the centers, m, beyond which robot and body cannot touch."""
    steps: NDArray[np.float64]
    """(n,) upper bounds of the distances that the bodies move in a tick on their own
    paths, m."""
    robots: NDArray[np.int64]
    """(n,) number of the robot, if the body is a robot; otherwise -1."""
    parts: int
    """Number of parts per tick."""
    poses: NDArray[np.float64]
    """(n, parts * ticks + 1, 3) poses of the bodies at the ends of all parts of the
    ticks; rows of robots are not filled."""


def contacts_of(
    rules: RobotRules, robots: Sequence[str], times: NDArray[np.float64]
) -> Contacts:
    """Returns the data by which a compiled loop judges one robot.

    Args:
        rules: Stop rules of the robot.
        robots: Names of all robots.
        times: (ticks + 1,) times of the ticks, s.

    Returns:
        The bodies that the robot can touch, and the numbers of the stop rules.
    """
    instants = instants_of(times, rules.parts)
    numbers = [robots.index(b.name) if b.name in robots else -1 for b in rules.near]
    poses = np.empty((len(rules.near), len(instants), 3))
    for row, number, near in zip(poses, numbers, rules.near, strict=True):
        if number < 0:
            path = near.body.path
            row[:] = path.poses(instants if path.moves else instants[:1])
    return Contacts(
        rules.numbers,
        rules.scenario.only.size,
        np.reshape([b.body.size for b in rules.near], (-1, 2)).astype(float),
        np.array([b.reach_m for b in rules.near]),
        np.array([b.step_m for b in rules.near]),
        np.array(numbers, dtype=np.int64),
        rules.parts,
        poses,
    )


_judge_tick = njit(judge_tick)
_judge_search = njit(judge_search)


@njit
def judge_all(
    tick: int,
    tick_s: float,
    watched: Any,
    contacts: Any,
    judged: Any,
    ended: Any,
    parts: Any,
) -> bool:  # pragma: no cover  (compiled)
    """Judges all robots at a tick, in the same way as ``RunRules``.

    For each robot, the function first looks for a contact, unless a body closes a
    contact switch of the robot. If there is no contact and the robot has no cause yet,
    ``judge_search`` or ``judge_tick`` judges the robot. If the run continues, the
    function saves the present poses as the poses at the previous tick.

    Args:
        tick: Number of the tick.
        tick_s: Control period, s.
        watched: For each robot: pose, velocity, pose of the target, whether the target
            is valid, whether the law gives up, report of the search, contact switches,
            touched body, and pose at the previous tick.
        contacts: ``Contacts`` of each robot.
        judged: (robots, 8) states of ``judge_tick``; changed in place.
        ended: (robots, 2) index of the cause, and 1 plus the number of the first body
            that is touched (0 for none); changed in place.
        parts: (robots,) elapsed part of the tick at the contact (0 to 1); changed in
            place.

    Returns:
        Whether the run is over.
    """
    all_ended, over = True, False
    for k in range(len(contacts)):
        pose, velocity, pose_WS, valid, gives_up, report, feels, body, _ = watched[k]
        felt = (feels[0] > 0.5 or feels[1] > 0.5) and body[0] >= 0.0
        touched, part = -1, 0.0
        if not felt:
            touched, part = _first_touched(tick, k, watched, contacts[k])
        if touched >= 0:
            ended[k, 1], parts[k] = 1 + touched, part
        elif ended[k, 0] == 0 and contacts[k].rules.searches > 0:
            rules = contacts[k].rules
            ended[k, 0] = _judge_search(report[0], pose, pose_WS, rules)
        elif ended[k, 0] == 0:
            ended[k, 0] = _judge_tick(
                tick * tick_s,
                judged[k],
                pose,
                velocity,
                pose_WS,
                valid[0] > 0.5,
                gives_up[0] > 0.5,
                contacts[k].rules,
            )
        over = over or ended[k, 1] > 0 or ended[k, 0] == DIVERGED
        all_ended = all_ended and ended[k, 0] > 0
    over = over or all_ended
    if not over:
        for k in range(len(contacts)):
            for j in range(3):
                watched[k][BEFORE][j] = watched[k][0][j]
    return over


@njit
def _first_touched(
    tick: int, number: int, watched: Any, contacts: Contacts
) -> tuple[int, float]:  # pragma: no cover  (compiled)
    """Returns the first body that a robot has touched since the last tick.

    Bodies that cannot have come near enough are skipped. The poses of other robots
    between the ticks are interpolated; those of other bodies are known in advance.

    Returns:
        Number of the body (-1 for none), and the elapsed part of the tick (0 to 1).
    """
    pose, before = watched[number][0], watched[number][BEFORE]
    gone = math.hypot(pose[0] - before[0], pose[1] - before[1])
    parts, at = contacts.parts, contacts.parts * tick
    touched, first = -1, np.inf
    for body in range(len(contacts.reach)):
        # Present position of the body, and the distance that it has moved.
        robot, step = contacts.robots[body], contacts.steps[body]
        if robot >= 0:
            now, then = watched[robot][0], watched[robot][BEFORE]
            x, y = now[0], now[1]
            step = math.hypot(x - then[0], y - then[1])
        else:
            x, y = contacts.poses[body, at, 0], contacts.poses[body, at, 1]
        # Skip a body that is too far away for a contact during the tick.
        near = contacts.reach[body] + gone + step
        if math.hypot(x - pose[0], y - pose[1]) > near:
            continue
        # Poses of the body at the parts of the tick.
        if robot >= 0:
            poses = np.empty((parts + 1, 3))
            for k in range(parts + 1):
                for j in range(3):
                    poses[k, j] = then[j] + k / parts * (now[j] - then[j])
        else:
            poses = contacts.poses[body, max(at - parts, 0) : at + 1]
        size = contacts.sizes[body]
        part = first_overlap(before, pose, contacts.size, poses, size)
        if part < first:
            touched, first = body, part
    return touched, first
