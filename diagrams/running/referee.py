"""The referee of a run: it ends the run, and knows the causes and the collisions."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from diagrams.running.stop_rules import (
    ENDING,
    FOLLOWING_SHARE,
    FOUND,
    INTERRUPTED,
    SUCCESSFUL,
    UNJUDGED,
    BodyTable,
    Collision,
    RefereeNumbers,
    RefereeState,
    RuleNumbers,
    judge_robot,
    run_is_over,
)
from diagrams.scenario.bodies import Body, RecordedPath, robot_rectangle
from diagrams.scenario.scenario import Scenario
from systems.framework.block import Step
from systems.world.plane import control_point

#: The rules check for contacts at the ends of equal parts of a tick. ``BETWEEN_TICKS``:
#: least number of parts. ``_PART_M``: greatest distance that a body may move in one
#: part, m. If a body is faster, ticks have more parts.
BETWEEN_TICKS, _PART_M = 5, 0.02


class Referee:
    """Judges all robots of a run at every tick (control period).

    The referee has one step function per robot. Both engines call these functions at
    every tick, before any block changes its state.

    Args:
        scenario: The scenario to run.
    """

    def __init__(self, scenario: Scenario) -> None:
        robots = [*scenario.robots]
        self.scenario = scenario
        self.poses = np.zeros((len(robots), 3))
        """(robots, 3) poses of all robots in W at the present tick, m and rad. The
        engine fills this array, and passes it to each step."""
        self.found = np.zeros(len(robots), dtype=np.int64)
        """(robots,) index of the cause of each robot in ``FOUND``."""
        self.steps = {
            name: Step(
                judge_robot,
                _numbers_of(scenario, name),
                RefereeState(
                    np.array(UNJUDGED),
                    np.zeros_like(self.poses),
                    np.zeros_like(self.poses),
                    np.zeros(1),
                    np.zeros(1),
                    np.array([-1.0, 0.0, 0.0]),
                    self.found[number : number + 1],
                ),
            )
            for number, name in enumerate(robots)
        }
        """Step of each robot, by name. The inputs are ``poses`` and the values of
        ``READ_PORTS``."""

    @property
    def over(self) -> bool:
        """Whether the run has ended."""
        return run_is_over(self.found)

    @property
    def decisive(self) -> str:
        """Name of the robot whose cause is the cause of the whole run.

        The cause of a robot is the reason why its run ended. The first robot of the
        first group that is not empty decides:

        1. robots that collided or diverged
        2. robots that were neither successful nor interrupted
        3. all other robots
        """

        def rank(name: str) -> int:
            cause = self.cause_of(name)
            if cause in ENDING:
                return 0
            return 2 if cause in (*SUCCESSFUL, INTERRUPTED) else 1

        return min(self.steps, key=rank)

    def cause_of(self, name: str) -> str:
        """Returns the cause for which a robot's run ended (see ``RunResult.cause``)."""
        found = self.steps[name].state.found[0]
        if found:
            return FOUND[found]
        return INTERRUPTED if self.over else self._cause_at_time_limit(name)

    def _cause_at_time_limit(self, name: str) -> str:
        state, rules = self.steps[name].state, self.steps[name].numbers.rules
        if rules.searches:
            return "timeout"
        *_, been_in_goal, ticks, following_ticks = state.rules.tolist()
        followed = following_ticks >= FOLLOWING_SHARE * ticks
        if not rules.source_rests and ticks > 0.0 and followed:
            return "completed"
        if not state.valid[0]:
            return "lost"
        if not rules.source_rests:
            return "astray"
        return "unsettled" if been_in_goal else "timeout"

    def ended(self, name: str) -> float:
        """Returns how the search of a robot ended, as a number.

        ``systems.search.search_ending`` lists the numbers. The result is 0 if the
        search has not ended, or if the robot does not search.
        """
        return float(self.steps[name].state.ended[0])

    def collision(self, name: str) -> Collision | None:
        """Returns the collision of a robot and who is at fault, or None.

        The method considers two motions since the last tick (control period): that of
        the robot while the body that it hit stays in place, and that of this body while
        the robot stays in place. The robot is at fault if its motion brings the two at
        least as near to each other as the body's motion does.
        """
        state, tick_s = self.steps[name].state, self.scenario.tick_s
        body, part, tick = state.contact.tolist()
        if body < 0.0:
            return None
        begin, end = max(tick - 1.0, 0.0) * tick_s, tick * tick_s
        instant = begin + part * (end - begin)
        moved = np.stack([state.before, state.now], axis=1)
        paths = {
            robot: RecordedPath(np.array([begin, end]), poses)
            for robot, poses in zip(self.steps, moved, strict=True)
        }
        bodies = self.scenario.surroundings(name, paths).bodies
        touched, hit = [*bodies.items()][int(body)]
        own = self.scenario.robots[name].robot
        robot_then, robot_now = (
            robot_rectangle(paths[name].pose(time), own) for time in (begin, instant)
        )
        robot_alone = hit.clearance(robot_now, begin)
        body_alone = hit.clearance(robot_then, instant)
        fault = "robot" if robot_alone <= body_alone else "obstacle"
        return Collision(touched, fault, instant)


def _numbers_of(scenario: Scenario, name: str) -> RefereeNumbers:
    own, around = scenario.of_robot(name), scenario.surroundings(name)
    robots, bodies = [*scenario.robots], {**around.bodies}
    rests = not around.followed.path.moves
    x, y = control_point(own.only.start.pose, own.only.robot.control_point_m)
    # A goal has no body. It comes after the bodies, and cannot be touched.
    if around.goal is not None:
        bodies[around.target] = around.followed
    table = _table_of(bodies, own, robots, touchable=len(around.bodies))
    target = [*bodies].index(around.target)
    return RefereeNumbers(
        robots.index(name),
        (*own.only.size, 0.0),
        int(np.argmax(table.owners == target)),
        table,
        RuleNumbers(
            own.stop.for_start(math.dist((x, y), around.followed.path.pose(0.0)[:2])),
            own.only.robot.control_point_m,
            own.only.follow_distance_m,
            own.goal_radius(moves=not rests),
            rests,
            {None: 0, "odor": 1, "sound": 2}[own.only.searches],
        ),
        scenario.tick_s,
    )


def _table_of(
    bodies: Mapping[str, Body], own: Scenario, robots: list[str], *, touchable: int
) -> BodyTable:
    """Tabulates the poses and sizes of the bodies around a robot.

    The robot can touch only the first ``touchable`` of the bodies; a goal may follow.
    Each tick (control period) is divided into equal parts. The table has the pose of
    each body on a known path at the end of each part. The number of parts is so large
    that no such body moves more than ``_PART_M`` per part.
    """
    ticks = int(own.duration_s / own.tick_s + 1e-9)
    times: NDArray[np.float64] = own.tick_s * np.arange(ticks + 1.0)
    moving = {n: b for n, b in bodies.items() if b.path.moves and n not in robots}
    instants = _instants(times, BETWEEN_TICKS)
    poses = {n: body.rectangles_over(instants)[..., :3] for n, body in moving.items()}
    farthest = {name: _longest_ways(rows) for name, rows in poses.items()}
    most = max((float(ways.max()) for ways in farthest.values()), default=0.0)
    parts = max(1, math.ceil(most / _PART_M)) * BETWEEN_TICKS
    rows, tables, size = [], [], 0
    for name, body in bodies.items():
        if name in robots:
            table = np.empty((1, 0, 3))
        elif name not in moving:
            at_rest = body.rectangles_over(times[:1])[..., :3]
            table = np.repeat(at_rest, parts + 1, axis=1)
        elif parts == BETWEEN_TICKS:
            table = poses[name]
        else:
            table = body.rectangles_over(_instants(times, parts))[..., :3]
        for each in table:
            rows.append((size, parts if name in moving else 0))
            tables.append(each)
            size += len(each)
    counts = [len(body.shape.rectangles) for body in bodies.values()]
    sizes = np.concatenate([body.shape.rectangles[:, 3:] for body in bodies.values()])
    owners = np.repeat(np.arange(len(bodies)), counts)
    steps = [farthest.get(n, np.zeros(k)) for n, k in zip(bodies, counts, strict=True)]
    reach = sizes[:, 2] + 0.5 * (math.hypot(*own.only.size) + np.hypot(*sizes.T[:2]))
    reach[owners >= touchable] = -math.inf
    return BodyTable(
        owners,
        sizes,
        reach,
        BETWEEN_TICKS * np.concatenate(steps),
        np.array([robots.index(n) if n in robots else -1 for n in bodies])[owners],
        parts,
        np.array(rows, dtype=np.int64),
        np.concatenate(tables),
    )


def _longest_ways(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k,) longest ways, m, between successive poses (k, n, 3) of k rectangles."""
    steps = np.diff(poses[..., :2], axis=1)
    return np.hypot(steps[..., 0], steps[..., 1]).max(axis=1, initial=0.0)


def _instants(times: NDArray[np.float64], parts: int) -> NDArray[np.float64]:
    """Returns the instants at which poses are tabulated, including the ticks.

    Args:
        times: (n + 1,) times of the ticks (control periods), s.
        parts: Number of equal parts per tick.

    Returns:
        (n * parts + 1,) instants, s.
    """
    shares = np.arange(1, parts + 1) / parts
    between = times[:-1, None] + shares * np.diff(times)[:, None]
    return np.concatenate([times[:1], between.ravel()])
