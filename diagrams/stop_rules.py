"""When a run ends: exactly one cause, checked at every tick."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import EventStatus

from diagrams.bodies import Body, LivePath, Surroundings, robot_rectangle
from diagrams.builder import SoundFollower
from diagrams.robot import Parts
from diagrams.scenario import Scenario
from systems.world.geometry import (
    control_point,
    control_point_velocity,
    rectangle_clearance,
)

__all__ = [
    "ROUNDING_S",
    "SUCCESSFUL",
    "Collision",
    "RobotRules",
    "StopRules",
    "decisive_robot",
]

#: Causes of runs that did what they should.
SUCCESSFUL = ("reached", "completed")
#: Causes that end the run of all robots.
ENDING = ("collision", "diverged")
#: Cause of a robot whose run another's end has cut short.
INTERRUPTED = "interrupted"

#: A rest of exactly ``stop.rest_time_s`` counts: instants of ticks are rounded, s.
ROUNDING_S = 1e-9
#: Contacts are looked for between ticks when the last clearance was below this:
#: more than robot and obstacle cover in a tick.
NEAR_M = 0.1
#: Instants looked at between two ticks.
BETWEEN_TICKS = 5

_Places = Mapping[str, tuple[float, float, float]]
_GO_ON = EventStatus.DidNothing()


@dataclass(frozen=True)
class Collision:
    """Who touched whom."""

    object: str
    """Name of the obstacle, or ``source``."""
    fault: str
    """``robot`` or ``obstacle``: who alone, the other standing still, would have
    come nearer since the last tick; turning counts, a body at rest never is."""
    time: float
    """First contact, s, to a fifth of a tick."""


def decisive_robot(robots: Mapping[str, RobotRules]) -> str:
    """Name of the robot whose cause is that of the whole run.

    The first that touched something, else the first that did not do what it
    should, else the first.

    Args:
        robots: By name.
    """
    causes = {name: rules.final_cause() for name, rules in robots.items()}

    def rank(name: str) -> int:
        cause = causes[name]
        if cause in ENDING:
            return 0
        return 2 if cause in (*SUCCESSFUL, INTERRUPTED) else 1

    return min(robots, key=rank)


class StopRules:
    """A monitor for Drake's simulator; remembers why it stopped the run.

    A run ends when each robot has a cause of its own, or one has touched something
    or is lost from sight; what has ended otherwise goes on beside the others.
    """

    def __init__(self, follower: SoundFollower) -> None:
        self._diagram = follower.diagram
        scenario = follower.scenario
        starts = {n: robot.start.pose for n, robot in scenario.all_robots.items()}
        self._paths = {name: LivePath(pose) for name, pose in starts.items()}
        several = len(starts) > 1
        self._moving = self._paths if several else {}
        self.robots = {
            name: RobotRules(
                scenario.of_robot(name), scenario.surroundings(name, self._paths), parts
            )
            for name, parts in follower.robots.items()
        }
        self._tick, self._tick_s = -1, scenario.tick_s

    @property
    def cause(self) -> str:
        """Cause of the whole run; empty while it goes on."""
        if not self.over:
            return ""
        return self.robots[decisive_robot(self.robots)].final_cause()

    @property
    def over(self) -> bool:
        """Whether the run has ended."""
        causes = [rules.cause for rules in self.robots.values()]
        return all(causes) or any(cause in ENDING for cause in causes)

    def __call__(self, context: Any) -> EventStatus:
        """Called after every step of the simulator, which may be finer than ticks."""
        time = context.get_time()
        tick = round(time / self._tick_s)
        if tick == self._tick or abs(time - tick * self._tick_s) > ROUNDING_S:
            return _GO_ON
        self._tick = tick
        poses = {n: rules.look(context) for n, rules in self.robots.items()}
        for name, path in self._moving.items():
            path.move(time, poses[name])
        for rules in self.robots.values():
            rules.judge(time)
        if self.over:
            for rules in self.robots.values():
                rules.cause = rules.cause or INTERRUPTED
            return EventStatus.ReachedTermination(self._diagram, self.cause)
        return _GO_ON


@dataclass
class RobotRules:
    """Why one robot's run ends."""

    scenario: Scenario
    """Of this robot alone."""
    surroundings: Surroundings
    """What it can hit, and what it follows."""
    parts: Parts
    cause: str = ""
    collision: Collision | None = None
    _root: Any = None
    _contexts: tuple[Any, Any] = (None, None)
    _now: list[float] = field(default_factory=list)
    _pose: list[float] | None = None
    _anchor: tuple[float, float, float] = (0.0, math.inf, math.inf)
    _valid: bool = False
    _valid_time: float = 0.0
    _rest_since: float = math.inf
    _was_in_goal: bool = False
    _ticks_since_heard: int = 0
    _following_ticks: int = 0
    _time: float = 0.0

    def __post_init__(self) -> None:
        scenario = self.scenario
        self._source_rests = not self.surroundings.followed.path.moves
        self._plant = self.parts.blocks["plant"]
        self._tracker = self.parts.blocks["tracker"]
        self._pose_port = self.parts.port("plant", "pose_WB")
        self._velocity_port = self.parts.port("plant", "velocity_WB")
        self._valid_port = self.parts.port("tracker", "target_valid")
        self._goal_radius = scenario.goal_radius(moves=not self._source_rests)
        self._follow_distance = scenario.attraction.follow_distance_m
        self._offset = scenario.robot.control_point_m
        # Farther than this from the robot's centre, a body does not touch it.
        size = scenario.size
        self._reach = [
            (name, body, 0.5 * (math.hypot(*size) + math.hypot(*body.size)) + NEAR_M)
            for name, body in self.surroundings.bodies.items()
        ]

    def look(self, context: Any) -> list[float]:
        """Reads the robot at a tick; its pose, m and rad."""
        if context is not self._root:
            self._root = context
            self._contexts = (
                self._plant.GetMyContextFromRoot(context),
                self._tracker.GetMyContextFromRoot(context),
            )
        plant, tracker = self._contexts
        self._now = self._pose_port.Eval(plant).tolist()
        self._valid = self._valid_port.Eval(tracker)[0] > 0.5
        return self._now

    def judge(self, time: float) -> None:
        """Decides at a tick, in s, after ``look``; what has ended stays as it ended.

        Of several robots, one that has reached its goal can still be hit.
        """
        places = {name: body.path.pose(time) for name, body, _ in self._reach}
        ended, self.collision = self.cause, self._find_collision(time, places)
        if self.collision is not None:
            self.cause = "collision"
        elif not ended:
            self.cause = self._judge(time, self._now, places)
        self._pose, self._time = self._now, time

    def final_cause(self) -> str:
        """Cause of the run, once the simulator has returned."""
        if self.cause:
            return self.cause
        if not self._source_rests and self._has_followed():
            return "completed"
        if not self._valid:
            return "lost"
        if not self._source_rests:
            return "astray"
        return "unsettled" if self._was_in_goal else "timeout"

    def _has_followed(self) -> bool:
        share = self.scenario.stop.following_share
        ticks = self._ticks_since_heard
        return ticks > 0 and self._following_ticks >= share * ticks

    def _judge(self, time: float, pose: list[float], places: _Places) -> str:
        stop = self.scenario.stop
        x_P, y_P = control_point(pose, self._offset)
        x_S, y_S, _ = places[self.surroundings.target]
        distance = math.hypot(x_S - x_P, y_S - y_P)
        if not distance <= stop.diverged_range_m:
            return "diverged"
        in_goal = distance <= self._goal_radius
        self._count(distance, in_goal=in_goal)
        there = self._source_rests and in_goal and self._valid
        if self._has_rested(time, pose[2], there=there):
            return "reached"
        if self._valid:
            self._valid_time = time
        elif time - self._valid_time > stop.lost_after_s:
            return "lost"
        away = self._valid and not in_goal
        return self._find_stuck(time, x_P, y_P, away=away)

    def _has_rested(self, time: float, heading: float, *, there: bool) -> bool:
        """Whether P has been slow in the goal for long enough."""
        stop = self.scenario.stop
        if there:
            velocity = self._velocity_port.Eval(self._contexts[0]).tolist()
            v_WP = control_point_velocity(heading, velocity, self._offset)
            there = math.hypot(*v_WP) < stop.rest_speed_m_s
        self._rest_since = min(self._rest_since, time) if there else math.inf
        return time - self._rest_since >= stop.rest_time_s - ROUNDING_S

    def _count(self, distance: float, *, in_goal: bool) -> None:
        """What the end of the time is judged by."""
        self._was_in_goal |= in_goal
        if self._valid or self._ticks_since_heard:
            error = abs(distance - self._follow_distance)
            following = error <= self.scenario.stop.following_band_m
            self._ticks_since_heard += 1
            self._following_ticks += following

    def _find_stuck(self, time: float, x_P: float, y_P: float, *, away: bool) -> str:
        """Stuck: P goes nowhere though there is a target, and the goal is elsewhere."""
        stop = self.scenario.stop
        then, x, y = self._anchor
        if not away or math.hypot(x_P - x, y_P - y) > stop.stuck_radius_m:
            self._anchor = (time, x_P, y_P)
            return ""
        return "stuck" if time - then >= stop.stuck_after_s else ""

    def _find_collision(self, time: float, places: _Places) -> Collision | None:
        """First contact since the last tick, looked for between ticks if near."""
        first, pose = None, self._now
        for name, body, reach in self._reach:
            x, y, _ = places[name]
            if math.hypot(x - pose[0], y - pose[1]) > reach:
                continue
            instant = self._first_contact(time, pose, body)
            if instant is not None and (first is None or instant < first.time):
                fault = self._fault(instant, time, pose, body)
                first = Collision(name, fault, instant)
        return first

    def _first_contact(
        self, time: float, pose: list[float], body: Body
    ) -> float | None:
        for part in np.arange(1, BETWEEN_TICKS + 1) / BETWEEN_TICKS:
            instant = self._time + part * (time - self._time)
            footprint = self._footprint(instant, time, pose)
            if rectangle_clearance(footprint, body.rectangle(instant)) < 0.0:
                return float(instant)
        return None

    def _fault(self, instant: float, time: float, pose: list[float], body: Body) -> str:
        """Who alone would have come nearer since the last tick, the other standing."""
        robot_then = self._footprint(self._time, time, pose)
        robot_now = self._footprint(instant, time, pose)
        body_then, body_now = body.rectangle(self._time), body.rectangle(instant)
        robot_alone = rectangle_clearance(robot_now, body_then)
        body_alone = rectangle_clearance(robot_then, body_now)
        return "robot" if robot_alone <= body_alone else "obstacle"

    def _footprint(
        self, instant: float, time: float, pose: list[float]
    ) -> NDArray[np.float64]:
        """The robot's rectangle between the last tick and this one."""
        now = np.array(pose)
        before = now if self._pose is None else np.array(self._pose)
        part = (instant - self._time) / max(time - self._time, self.scenario.tick_s)
        return robot_rectangle(before + part * (now - before), self.scenario.robot)
