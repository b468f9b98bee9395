"""How compiled loops end: the stop rules of all robots, tick by tick."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from diagrams.stop_rules import (
    BETWEEN_TICKS,
    DIVERGED,
    RobotRules,
    RuleNumbers,
    judge_search,
    judge_tick,
)
from systems.world.geometry import rectangle_clearance

__all__ = ["Contacts", "contacts_of", "judge_all"]


#: Place of the pose at the tick before among what is watched.
BEFORE = 8


class Contacts(NamedTuple):
    """What a robot's ticks are judged by."""

    rules: RuleNumbers
    size: tuple[float, float]
    """Length and width of the robot, m."""
    sizes: NDArray[np.float64]
    """(n, 2) of the bodies, m."""
    reach: NDArray[np.float64]
    """(n,) m: farther away, a body does not touch the robot."""
    robots: NDArray[np.int64]
    """(n,) numbers of those bodies that are robots, else -1."""
    poses: NDArray[np.float64]
    """(n, 5 ticks + 1, 3) of the other bodies, at ticks and in between."""


def contacts_of(
    rules: RobotRules, robots: Sequence[str], times: NDArray[np.float64]
) -> Contacts:
    """What a robot can touch in a run.

    Args:
        rules: Of the robot.
        robots: Names of all robots.
        times: (ticks + 1,) s.

    Returns:
        All that a compiled loop needs of it.
    """
    parts = np.arange(1, BETWEEN_TICKS + 1) / BETWEEN_TICKS
    between = times[:-1, None] + parts * (times[1:] - times[:-1])[:, None]
    instants = np.concatenate([times[:1], between.ravel()])
    numbers = [robots.index(n) if n in robots else -1 for n, _, _ in rules.reach]
    poses = np.empty((len(rules.reach), len(instants), 3))
    for row, number, (_, body, _) in zip(poses, numbers, rules.reach, strict=True):
        if number < 0:
            row[:] = body.path.poses(instants if body.path.moves else instants[:1])
    return Contacts(
        rules.numbers,
        rules.scenario.size,
        np.reshape([body.size for _, body, _ in rules.reach], (-1, 2)).astype(float),
        np.array([reach for _, _, reach in rules.reach]),
        np.array(numbers, dtype=np.int64),
        poses,
    )


_judge_tick = njit(judge_tick)
_judge_search = njit(judge_search)


@njit
def judge_all(
    tick: int, tick_s: float, watched: Any, contacts: Any, judged: Any, ended: Any
) -> bool:  # pragma: no cover  (compiled)
    """Judges all robots at a tick, as ``RunRules`` does.

    Args:
        tick: Its number.
        tick_s: s.
        watched: Of each robot its pose, velocity, what it follows, whether it has a
            target, whether its law gives up, how its search ended, what its switches
            feel and which body that is, and its pose at the tick before.
        contacts: ``Contacts`` of each.
        judged: (robots, 8) states of ``judge_tick``, changed.
        ended: (robots, 2) what that has returned, and whether a body is touched;
            changed.

    Returns:
        Whether the run is over.
    """
    all_ended, over = True, False
    for k in range(len(contacts)):
        pose, velocity, pose_WS, valid, gives_up, report, feels, body, _ = watched[k]
        felt = (feels[0] > 0.5 or feels[1] > 0.5) and body[0] >= 0.0
        if not felt and _touches(tick, k, watched, contacts[k]):
            ended[k, 1] = 1
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
def _touches(
    tick: int, number: int, watched: Any, contacts: Contacts
) -> bool:  # pragma: no cover  (compiled)
    """Whether a robot has touched a body since the last tick."""
    pose, before = watched[number][0], watched[number][BEFORE]
    at = BETWEEN_TICKS * tick
    mine, other = np.empty(5), np.empty(5)
    mine[3], mine[4] = contacts.size
    for body in range(len(contacts.reach)):
        robot = contacts.robots[body]
        if robot >= 0:
            x, y = watched[robot][0][0], watched[robot][0][1]
        else:
            x, y = contacts.poses[body, at, 0], contacts.poses[body, at, 1]
        if math.hypot(x - pose[0], y - pose[1]) > contacts.reach[body]:
            continue
        other[3], other[4] = contacts.sizes[body, 0], contacts.sizes[body, 1]
        for fifth in range(1, BETWEEN_TICKS + 1):
            part = fifth / BETWEEN_TICKS if tick > 0 else 1.0
            for k in range(3):
                mine[k] = before[k] + part * (pose[k] - before[k])
                if robot >= 0:
                    then, now = watched[robot][BEFORE][k], watched[robot][0][k]
                    other[k] = then + part * (now - then)
                elif tick > 0:
                    other[k] = contacts.poses[body, at - BETWEEN_TICKS + fifth, k]
                else:
                    other[k] = contacts.poses[body, 0, k]
            if rectangle_clearance(mine, other) < 0.0:
                return True
    return False
