"""The stop rules: they decide at every tick whether a run ends, and for which cause."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import EventStatus

from diagrams.building.builder import SoundFollower
from diagrams.building.robot import Parts
from diagrams.scenario.bodies import Body, LivePath, Surroundings, robot_rectangle
from diagrams.scenario.run_parameters import StopParameters
from diagrams.scenario.scenario import Scenario
from systems.world.geometry import (
    control_point,
    control_point_velocity,
    first_overlap,
    rectangle_clearance,
)

#: Causes of successful runs.
SUCCESSFUL = ("reached", "completed", "found")
#: Causes that end the run of all robots.
ENDING = ("collision", "diverged")
#: Cause of a robot whose run ends early because the run of all robots ends.
INTERRUPTED = "interrupted"

#: Tolerance for rounded tick times, s: a rest of exactly ``stop.rest_time_s`` counts.
ROUNDING_S = 1e-9
#: The rules check for contacts at the ends of equal parts of a tick. These are the
#: least number of parts, and the greatest distance that a body on its own path may move
#: in one part, m. If a body is faster, ticks have more parts.
BETWEEN_TICKS, _PART_M = 5, 0.02

#: Speed below which P is at rest, m/s.
REST_SPEED_M_S = 0.05
#: Least share of the time since the first detection in which P must follow, so that the
#: run counts as completed.
FOLLOWING_SHARE = 0.5
#: Greatest distance that P can move and still count as in one place, m.
_STUCK_RADIUS_M = 0.1
#: At the end of a search for an odor that counts as found: greatest distance of the
#: source from the origin of B, m, and greatest angle between the heading and the
#: direction to the source, deg.
ODOR_WITHIN_M, _ODOR_AHEAD_DEG = 0.22, 75.0

#: Port by which a law reports that no route leads to the target, 0 or 1.
GIVES_UP = "gives_up"
#: Port by which a search reports how it ended.
SEARCH_REPORT = "search_report"
#: Ports of the contact switches of a searching robot, and of the body that they touch.
CONTACT, TOUCHED = "contact", "touched"

_Places = Mapping[str, tuple[float, float, float]]
_GO_ON = EventStatus.DidNothing()


@dataclass(frozen=True)
class Collision:
    """A contact between a robot and a body."""

    object: str
    """Name of the body that the robot touched."""
    fault: str
    """Which one is at fault, ``robot`` or ``obstacle``. The rule compares the motion of
    the robot alone since the last tick with that of the body alone. The motion that
    brings the two nearer to each other decides. Turning counts as motion. A body at
    rest is never at fault."""
    time: float
    """Time of the first contact, s, with a resolution of a fifth of a tick or
    better."""


class NearBody(NamedTuple):
    """A body that a robot can touch."""

    name: str
    body: Body
    reach_m: float
    """Distance of the centers, m, beyond which the robot and the body cannot touch."""
    step_m: float
    """Upper bound of the distance that the body moves in a tick on its own path, m; 0
    for another robot."""


def decisive_robot(robots: Mapping[str, RobotRules]) -> str:
    """Returns the name of the robot whose cause is the cause of the whole run.

    It is the first robot that collided or diverged. If there is none, it is the first
    robot that was neither successful nor interrupted. If there is no such robot either,
    it is the first robot.

    Args:
        robots: Stop rules of the robots, by name.
    """
    causes = {name: rules.final_cause() for name, rules in robots.items()}

    def rank(name: str) -> int:
        cause = causes[name]
        if cause in ENDING:
            return 0
        return 2 if cause in (*SUCCESSFUL, INTERRUPTED) else 1

    return min(robots, key=rank)


class Seen(NamedTuple):
    """What the stop rules need to know about a robot at a tick."""

    pose: list[float]
    """x, y, theta in W, m and rad."""
    velocity: list[float]
    """vx, vy, omega of the robot in W, m/s and rad/s."""
    valid: bool
    """Whether the robot has a target."""
    gives_up: bool = False
    """Whether the law reports that no route leads to the target."""
    ended: float = 0.0
    """Number of the ending of a search; 0 while the search continues."""
    feels: bool = False
    """Whether a contact switch is closed because it touches a body."""


class RunRules:
    """When a run of one or several robots ends.

    The run ends when every robot has a cause, or when a robot collides or diverges. A
    robot with any other cause keeps moving until the run ends.
    """

    def __init__(self, scenario: Scenario) -> None:
        starts = {n: robot.start.pose for n, robot in scenario.robots.items()}
        self._paths = {name: LivePath(pose) for name, pose in starts.items()}
        self.robots = {
            name: RobotRules(
                scenario.of_robot(name), scenario.surroundings(name, self._paths)
            )
            for name in starts
        }

    @property
    def cause(self) -> str:
        """Cause of the whole run; empty while the run continues."""
        if not self.over:
            return ""
        return self.robots[decisive_robot(self.robots)].final_cause()

    @property
    def over(self) -> bool:
        """Whether the run has ended."""
        causes = [rules.cause for rules in self.robots.values()]
        return all(causes) or any(cause in ENDING for cause in causes)

    def judge(self, time: float, seen: Mapping[str, Seen]) -> None:
        """Applies the stop rules at a tick.

        Args:
            time: Time of the tick, s.
            seen: State of each robot, by name.
        """
        self._move(time, {name: each.pose for name, each in seen.items()})
        for name, rules in self.robots.items():
            rules.judge(time, seen[name])
        self._interrupt()

    def take_over(self, ticks: Mapping[str, JudgedTick]) -> None:
        """Takes over the end of a compiled loop, which uses the same stop rules.

        Args:
            ticks: The last tick of each robot, by name.
        """
        last = next(iter(ticks.values()))
        before = {name: tick.pose_before for name, tick in ticks.items()}
        self._move(last.time_before, before)
        self._move(last.time, {name: tick.pose for name, tick in ticks.items()})
        for name, rules in self.robots.items():
            rules.take_over(ticks[name])
        self._interrupt()

    def _move(self, time: float, poses: Mapping[str, Sequence[float]]) -> None:
        for name, path in self._paths.items():
            path.move(time, poses[name])

    def _interrupt(self) -> None:
        if self.over:
            for rules in self.robots.values():
                rules.cause = rules.cause or INTERRUPTED


class StopRules(RunRules):
    """A monitor for Drake's simulator that remembers why it stopped the run."""

    def __init__(self, follower: SoundFollower) -> None:
        super().__init__(follower.scenario)
        self._diagram, self._tick_s = follower.diagram, follower.scenario.tick_s
        self._views = {name: _View(parts) for name, parts in follower.robots.items()}
        self._tick = -1

    def __call__(self, context: Any) -> EventStatus:
        """Judges the run; the simulator calls this method after every step.

        Steps may be shorter than ticks; this method ignores the instants between ticks.
        """
        time = context.get_time()
        tick = round(time / self._tick_s)
        if tick == self._tick or abs(time - tick * self._tick_s) > ROUNDING_S:
            return _GO_ON
        self._tick = tick
        self.judge(time, {name: view.at(context) for name, view in self._views.items()})
        if self.over:
            return EventStatus.ReachedTermination(self._diagram, self.cause)
        return _GO_ON


class _View:
    """Reads the state of a robot from the context of the diagram."""

    def __init__(self, parts: Parts) -> None:
        plant = parts.blocks["plant"]
        self._ports = [
            (plant, plant.GetOutputPort(name)) for name in ("pose_WB", "velocity_WB")
        ]
        for name in ("target_valid", GIVES_UP, SEARCH_REPORT, CONTACT, TOUCHED):
            having = [b for b in parts.blocks.values() if b.HasOutputPort(name)]
            self._ports += [(block, block.GetOutputPort(name)) for block in having[:1]]
        self._root: Any = None
        self._contexts: list[Any] = []

    def at(self, context: Any) -> Seen:
        if context is not self._root:
            self._root = context
            self._contexts = [b.GetMyContextFromRoot(context) for b, _ in self._ports]
        seen = {
            port.get_name(): port.Eval(own).tolist()
            for (_, port), own in zip(self._ports, self._contexts, strict=True)
        }
        return Seen(
            seen["pose_WB"],
            seen["velocity_WB"],
            seen.get("target_valid", [0.0])[0] > 0.5,
            seen.get(GIVES_UP, [0.0])[0] > 0.5,
            seen.get(SEARCH_REPORT, [0.0])[0],
            max(seen.get(CONTACT, [0.0])) > 0.5 and seen[TOUCHED][0] >= 0.0,
        )


def instants_of(times: NDArray[np.float64], parts: int) -> NDArray[np.float64]:
    """Returns the instants at which contacts are checked.

    Args:
        times: (n + 1,) times of the ticks, s.
        parts: Number of parts per tick.

    Returns:
        (n * parts + 1,) instants, s, including the ticks.
    """
    shares = np.arange(1, parts + 1) / parts
    between = times[:-1, None] + shares * np.diff(times)[:, None]
    return np.concatenate([times[:1], between.ravel()])


class RuleNumbers(NamedTuple):
    """Numbers that the stop rules use, except those for contacts."""

    stop: StopParameters
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    follow_distance_m: float
    goal_radius_m: float
    source_rests: bool
    searches: int = 0
    """1: the robot searches for an odor; 2: for a sound; 0: it does not search."""


#: Causes that ``judge_tick`` and ``judge_search`` return, by index.
FOUND = (
    "",
    "diverged",
    "reached",
    "lost",
    "stuck",
    "no way found",
    "found",
    "false find",
)
DIVERGED = FOUND.index("diverged")


class _StatePlaces(NamedTuple):
    """Indices in the state of ``judge_tick``."""

    stays: int
    """Time at which P began to stay in its present place, s. The next two elements are
    the position of P at this time in W, m."""
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
    """Decides whether a run ends at a tick, and why, apart from contacts.

    The rules apply in this order: diverged, reached, lost, stuck or no way found.
    ``state`` holds the start time of each condition that must last for some time. It
    also counts the ticks since the first detection, and among them the ticks in which P
    follows the target. If the run reaches its time limit, ``RobotRules.final_cause``
    evaluates these counts.

    Args:
        time: Time of the tick, s.
        state: State of the rules, as ``UNJUDGED``; changed in place.
        pose: (x, y, theta) of the robot in W, m and rad.
        velocity: (vx, vy, omega) of the robot in W, m/s and rad/s.
        p_WS: Position of the target in W, m.
        valid: Whether the robot has a target.
        gives_up: Whether the law reports that no route leads to the target.
        numbers: Numbers that the rules use.

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
    # Reached: P has rested in the goal of a target at rest for long enough.
    there = numbers.source_rests and in_goal and valid
    if there:
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


def judge_search(ended: float, pose: Any, p_WS: Any, numbers: RuleNumbers) -> int:
    """Decides whether the run of a search ends at a tick, and why, apart from contacts.

    A search that ended successfully counts as found if it ended near the source. A
    search for an odor must also end with the source ahead. Otherwise it counts as a
    false find. A search that was given up counts as lost.

    Args:
        ended: Number of the ending, see ``systems.search.search_ending``.
        pose: (x, y, theta) of the robot in W, m and rad.
        p_WS: Position of the source in W, m.
        numbers: Numbers that the rules use.

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


class JudgedTick(NamedTuple):
    """The last tick of a robot in a compiled loop."""

    time: float
    time_before: float
    """Time of the previous tick, s; 0 at the first tick."""
    pose: list[float]
    pose_before: list[float]
    """Pose at the previous tick; at the first tick the same as ``pose``."""
    valid: bool
    """Whether the robot has a target."""
    state: list[float]
    """State of ``judge_tick``."""
    found: int
    """Index of the cause in ``FOUND`` that was found at this tick or before."""
    touched: tuple[int, float] | None
    """Number of the first body that was touched since the previous tick, and the
    elapsed part of the tick at the contact (0 to 1); None: no contact."""
    ended: float = 0.0
    """Number of the ending of a search."""


@dataclass
class RobotRules:
    """Stop rules of one robot."""

    scenario: Scenario
    """The scenario of this robot alone."""
    surroundings: Surroundings
    """The bodies that the robot can hit, and its target."""
    cause: str = ""
    collision: Collision | None = None
    ended: float = 0.0
    """Number of the ending of a search."""
    _pose: Sequence[float] | None = None
    """Pose at the last tick."""
    _valid: bool = False
    _state: list[float] = field(default_factory=lambda: [*UNJUDGED])
    _time: float = 0.0

    def __post_init__(self) -> None:
        scenario = self.scenario
        self._source_rests = not self.surroundings.followed.path.moves
        self.numbers = RuleNumbers(
            scenario.stop,
            scenario.only.robot.control_point_m,
            scenario.only.follow_distance_m,
            scenario.goal_radius(moves=not self._source_rests),
            self._source_rests,
            {None: 0, "odor": 1, "sound": 2}[scenario.only.searches],
        )
        self.parts, self.near = self._near_bodies()

    def _near_bodies(self) -> tuple[int, list[NearBody]]:
        """Returns the number of parts per tick, and the bodies that can be touched.

        If a body is fast, ticks have more parts, so that the body moves at most
        ``_PART_M`` per part.
        """
        size, tick_s = self.scenario.only.size, self.scenario.tick_s
        times = tick_s * np.arange(int(self.scenario.duration_s / tick_s + 1e-9) + 1.0)
        instants, farthest, near = instants_of(times, BETWEEN_TICKS), 0.0, []
        for name, body in self.surroundings.bodies.items():
            step = 0.0
            if body.path.moves and not isinstance(body.path, LivePath):
                ways = np.diff(body.path.poses(instants)[:, :2], axis=0)
                farthest_part = float(np.hypot(*ways.T).max(initial=0.0))
                step = BETWEEN_TICKS * farthest_part
                farthest = max(farthest, farthest_part)
            reach = 0.5 * (math.hypot(*size) + math.hypot(*body.size))
            near.append(NearBody(name, body, reach, step))
        return BETWEEN_TICKS * max(1, math.ceil(farthest / _PART_M)), near

    def judge(self, time: float, seen: Seen) -> None:
        """Applies the stop rules at a tick.

        A robot keeps the cause that it has already. However, it can still collide
        while other robots continue; its cause is then collision.

        Args:
            time: Time of the tick, s.
            seen: State of the robot.
        """
        places = {name: body.path.pose(time) for name, body, *_ in self.near}
        ended, self._valid = self.cause, seen.valid
        self.collision = None
        if not seen.feels:  # a contact that the bumper feels is intended
            self.collision = self._find_collision(time, seen.pose, places)
        if self.collision is not None:
            self.cause = "collision"
        elif self.numbers.searches and not ended:
            self.ended = seen.ended
            target = self.surroundings.followed.path.pose(time)
            found = judge_search(seen.ended, seen.pose, target, self.numbers)
            self.cause = FOUND[found]
        elif not ended:
            found = judge_tick(
                time,
                self._state,
                seen.pose,
                seen.velocity,
                self.surroundings.followed.path.pose(time),
                self._valid,
                seen.gives_up,
                self.numbers,
            )
            self.cause = FOUND[found]
        self._pose, self._time = seen.pose, time

    def take_over(self, tick: JudgedTick) -> None:
        """Takes over the end of a compiled loop, which uses the same stop rules.

        Args:
            tick: The last tick.
        """
        self._state, self._valid = tick.state, tick.valid
        self._pose, self._time = tick.pose_before, tick.time_before
        self.cause, self.ended = FOUND[tick.found], tick.ended
        if tick.touched is not None:
            number, part = tick.touched
            self.collision = self._collide(
                self.near[number], part, tick.time, tick.pose
            )
            self.cause = "collision"

    def final_cause(self) -> str:
        """Cause of the run after the simulator has returned."""
        if self.cause:
            return self.cause
        if self.numbers.searches:
            return "timeout"
        if not self._source_rests and self._has_followed():
            return "completed"
        if not self._valid:
            return "lost"
        if not self._source_rests:
            return "astray"
        return "unsettled" if self._state[_AT.in_goal] > 0.0 else "timeout"

    def _has_followed(self) -> bool:
        ticks, following = self._state[_AT.ticks], self._state[_AT.following]
        return ticks > 0.0 and following >= FOLLOWING_SHARE * ticks

    def _find_collision(
        self, time: float, pose: Sequence[float], places: _Places
    ) -> Collision | None:
        """Returns the first contact since the last tick, if there is one.

        The function skips a body if its center is too far away for a contact. This is
        so if the distance of the centers exceeds ``reach_m`` plus the motions of the
        robot and the body since the last tick. ``first_overlap`` checks all other
        bodies at the ends of the parts of the tick.
        """
        first = math.inf
        touched: NearBody | None = None
        before = pose if self._pose is None else self._pose
        gone = math.dist(pose[:2], before[:2])
        for near in self.near:
            body, step = near.body, near.step_m
            if isinstance(body.path, LivePath):
                step = body.path.step_m
            x, y, _ = places[near.name]
            if math.hypot(x - pose[0], y - pose[1]) > near.reach_m + gone + step:
                continue
            instants = instants_of(np.array([self._time, time]), self.parts)
            poses = body.path.poses(instants if time > self._time else instants[:1])
            size = self.scenario.only.size
            part = first_overlap(tuple(before), tuple(pose), size, poses, body.size)
            if part < first:
                first, touched = part, near
        if touched is None:
            return None
        return self._collide(touched, first, time, pose)

    def _collide(
        self, near: NearBody, part: float, time: float, pose: Sequence[float]
    ) -> Collision:
        """Returns a collision after the elapsed part ``part`` (0 to 1) of the tick."""
        instant = self._time + part * (time - self._time)
        fault = self._fault(instant, time, pose, near.body)
        return Collision(near.name, fault, instant)

    def _fault(
        self, instant: float, time: float, pose: Sequence[float], body: Body
    ) -> str:
        """Returns who is at fault for a contact, ``robot`` or ``obstacle``.

        The function compares two clearances. The first is the clearance if only the
        robot had moved since the last tick. The second is the clearance if only the
        body had moved. The smaller clearance decides.
        """
        robot_then = self._footprint(self._time, time, pose)
        robot_now = self._footprint(instant, time, pose)
        body_then, body_now = body.rectangle(self._time), body.rectangle(instant)
        robot_alone = rectangle_clearance(robot_now, body_then)
        body_alone = rectangle_clearance(robot_then, body_now)
        return "robot" if robot_alone <= body_alone else "obstacle"

    def _footprint(
        self, instant: float, time: float, pose: Sequence[float]
    ) -> NDArray[np.float64]:
        """The robot's rectangle at an instant between the last tick and this one."""
        now = np.array(pose)
        before = now if self._pose is None else np.array(self._pose)
        part = (instant - self._time) / max(time - self._time, self.scenario.tick_s)
        return robot_rectangle(before + part * (now - before), self.scenario.only.robot)
