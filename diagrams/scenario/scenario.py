"""Defines the scenario: all that a run depends on, in one tree of fields.

The tree consists of the parameter classes of the blocks. Each quantity therefore has
one name, one default and one permitted range. ``load_scenario`` reads a scenario from
YAML.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import combinations
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    StringConstraints,
    ValidationError,
    model_serializer,
    model_validator,
)

from diagrams.scenario.bodies import (
    Body,
    Path,
    RecordedPath,
    Surroundings,
    microphones_W,
    robot_rectangle,
)
from diagrams.scenario.checks.goal_checks import check_filled_goals, check_goals
from diagrams.scenario.checks.guard_checks import check_guard
from diagrams.scenario.checks.map_checks import check_map
from diagrams.scenario.checks.search_checks import check_searches
from diagrams.scenario.fields.explain import explain
from diagrams.scenario.fields.shipped import scenario_schema
from diagrams.scenario.map_parameters import MapParameters
from diagrams.scenario.participants import (
    AnyRobot,
    Follower,
    HasMicrophones,
    HasRangeSensors,
    OdorSearcher,
    Robot,
    Router,
    SoundSearcher,
    SourceParameters,
)
from diagrams.scenario.run_parameters import RunParameters
from diagrams.scenario.settings import all_settings, apply_settings
from diagrams.scenario.shorthand import (
    ROBOT_FIELDS,
    SOURCE,
    as_written,
    field_in,
    file_form,
    resolved,
)
from diagrams.scenario.worlds.catalog import filled
from systems.framework.input_error import InputError
from systems.framework.parameters import NonNegative
from systems.framework.signals import SAMPLE_RATE_HZ, whole
from systems.odor.parameters import CONTAINER_M
from systems.sound.parameters import SoundParameters
from systems.world.parameters import ObstacleParameters
from systems.world.paths import WaypointPath
from systems.world.plane import rectangle_clearance
from systems.world.shapes import box

#: Name of the target of a robot with a route.
GOAL = "goal"
#: Name of the diagram that all robots share.
WORLD = "world"
#: Name of the source of odor.
ODOR = "odor"

#: Names of robots and sources, which also appear in names of files.
Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$", max_length=64)]
_R = TypeVar("_R", bound=Robot)


class Scenario(RunParameters):
    """Describes one run. The default values of all fields form a complete scenario.

    A file can state fields of robots and of sources at the top level. Such fields apply
    to all robots, or to all sources, that do not set these fields
    (``diagrams.scenario.shorthand``).
    """

    robots: Annotated[dict[Name, AnyRobot], Field(min_length=1, max_length=16)]
    """Robots by name. In a file, each robot has only the fields that differ from those
    at the top level. Empty: one robot, named ``robot``."""
    sources: Annotated[dict[Name, SourceParameters], Field(max_length=16)]
    """Sources by name. In a file, each source has only the fields that differ from
    ``source`` and ``sound``. Empty: if a robot follows a source, there is one source,
    named ``source``. A source that no robot follows is an interferer."""

    def __init__(self, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise _explained(error, fields) from None

    @model_validator(mode="before")
    @classmethod
    def _resolve(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        return resolved(filled(data, FilePath.cwd()))

    if not TYPE_CHECKING:  # a type checker would accept every name

        def __getattr__(self, name: str) -> Any:
            """Reads a field of the only robot or source, as files write it."""
            if name in ROBOT_FIELDS and len(self.robots) == 1:
                return getattr(self.only, name)
            if name in ("source", "sound") and len(self.sources) == 1:
                (source,) = self.sources.values()
                return source if name == "source" else source.sound
            return super().__getattr__(name)

    @property
    def only(self) -> Robot:
        """The only robot of the scenario.

        Raises:
            InputError: There are several robots.
        """
        if len(self.robots) > 1:
            raise InputError(
                "robots",
                f"there are {len(self.robots)}: {', '.join(self.robots)}; select one",
            )
        return next(iter(self.robots.values()))

    @property
    def follower(self) -> Follower:
        """The only robot of the scenario, which must be a robot that follows a sound.

        Raises:
            InputError: There are several robots, or the robot is of another kind.
        """
        return self._of_kind(Follower, "follows a sound")

    @property
    def router(self) -> Router:
        """The only robot of the scenario, which must be a robot that drives on a route.

        Raises:
            InputError: There are several robots, or the robot is of another kind.
        """
        return self._of_kind(Router, "drives on a route")

    @property
    def sensing(self) -> Follower | Router:
        """The only robot of the scenario, which must be able to sense obstacles.

        Such a robot has range sensors or ideal obstacle sensing.

        Raises:
            InputError: There are several robots, or the robot is of another kind.
        """
        robot = self.only
        return robot if isinstance(robot, Router) else self.follower

    @property
    def searcher(self) -> OdorSearcher | SoundSearcher:
        """The only robot of the scenario, which must be a searching robot.

        Raises:
            InputError: There are several robots, or the robot is of another kind.
        """
        robot = self.only
        if isinstance(robot, OdorSearcher):
            return robot
        return self._of_kind(SoundSearcher, "searches step by step")

    def _of_kind(self, kind: type[_R], what: str) -> _R:
        robot = self.only
        if not isinstance(robot, kind):
            raise InputError(
                "law", f"is {robot.law!r}, but this needs a robot that {what}"
            )
        return robot

    @property
    def source(self) -> SourceParameters:
        """The sound source that the first robot follows.

        Raises:
            InputError: The first robot does not follow a source.
        """
        first = next(iter(self.robots))
        if (target := self.target(first)) not in self.sources:
            raise InputError("source", f"robot {first!r} does not follow a source")
        return self.sources[target]

    def sounds(self) -> dict[str, SoundParameters]:
        """The sound of each source and loudspeaker, by name of the source or robot."""
        played = {name: source.sound for name, source in self.sources.items()}
        for name, robot in self.robots.items():
            if robot.loudspeaker is not None:
                played[name] = robot.loudspeaker
        return played

    @property
    def longest_frame_s(self) -> float:
        """Longest audio frame of all robots with microphones, s; 0 without any."""
        return max(map(frame_of, self.robots.values()))

    @property
    def all_obstacles(self) -> tuple[ObstacleParameters | MapParameters, ...]:
        """The obstacles, and the map as the last one if there is a map."""
        return self.obstacles if self.map is None else (*self.obstacles, self.map)

    @property
    def law_names(self) -> str:
        """The laws of all robots, each once, separated by commas."""
        return ", ".join(dict.fromkeys(robot.law for robot in self.robots.values()))

    def target(self, robot: str) -> str:
        """Name of the target of a robot: a source, a leader, its goal, or the odor."""
        own = self.robots[robot]
        if isinstance(own, Router):
            return GOAL
        if isinstance(own, HasMicrophones):
            return own.follows or next(iter(self.sources))
        return ODOR

    def is_goal_point(self, source: str) -> bool:
        """Returns whether a source is only a point to drive to, as ``goal_m`` is.

        Such a source has no body, does not move, and each robot that follows it knows
        its position at all times. Its sound has no effect.
        """
        own = self.sources.get(source)
        if own is None or own.body or own.path().moves:
            return False
        return all(
            isinstance(robot, Follower) and robot.hearing == "ideal_always"
            for name, robot in self.robots.items()
            if self.target(name) == source
        )

    def drives_to_point(self, robot: str) -> bool:
        """Returns whether the target of a robot is a goal point or that of a route."""
        return self.robots[robot].has_goal or self.is_goal_point(self.target(robot))

    def of_robot(self, name: str) -> Scenario:
        """Returns the scenario of one robot alone, with the source that it follows.

        If the robot follows another robot (leader), the leader becomes a source in the
        new scenario. This source has the name, size and sound of the leader, and is at
        rest at the leader's start pose.
        """
        robot, target = self.robots[name], self.target(name)
        if robot.has_goal:
            sources = {}
        elif target in self.sources:
            sources = {target: self.sources[target]}
        else:
            leader = self.robots[target]
            length, width = leader.size
            assert leader.loudspeaker is not None
            at_rest = SourceParameters(
                waypoints_m=(leader.start.position_m,),
                heading_deg=leader.start.heading_deg,
                length_m=length,
                width_m=width,
                sound=leader.loudspeaker,
            )
            sources = {target: at_rest}
        if self.robots.keys() == {name} and self.sources == sources:
            return self
        return self.model_copy(update={"robots": {name: robot}, "sources": sources})

    def with_robot(self, **fields: Any) -> Scenario:
        """Returns a copy of the scenario in which fields of the only robot differ.

        The function does not validate the new values.

        Args:
            **fields: New values, by name of the robot's field.

        Returns:
            The new scenario.

        Raises:
            InputError: There are several robots.
        """
        robot = self.only.model_copy(update=fields)
        return self.model_copy(update={"robots": {next(iter(self.robots)): robot}})

    def with_(
        self, changes: Iterable[str] | Mapping[str, Any] = (), **fields: Any
    ) -> Scenario:
        """Returns a validated copy of the scenario in which some fields differ.

        Example: ``scenario.with_(law="active", **{"source.speed_m_s": 0.2})``.

        Args:
            changes: Fields to change, as for ``load_scenario``: a mapping of dotted
                paths to plain values, or a list of texts ``path=value``.
            **fields: Further fields to change. They override ``changes``.

        Returns:
            The new scenario.

        Raises:
            InputError: A path or value is invalid, see ``load_scenario``.
        """
        data = self.model_dump(mode="json")
        apply_settings(data, all_settings(changes, fields))
        return scenario_from_mapping(data)

    def require_one_robot(self, purpose: str) -> None:
        """Raises an ``InputError`` if the scenario has several robots or sources.

        ``purpose`` is the task that needs one robot, for the message, for example 'a
        linear model'.
        """
        for field, named in (("robots", self.robots), ("sources", self.sources)):
            if len(named) > 1:
                raise InputError(
                    field,
                    f"has {', '.join(named)}, but {purpose} needs one robot and "
                    f"one source; leave {field} out",
                )

    def require_one_rate(self, purpose: str) -> None:
        """Raises an ``InputError`` if a sensor's period is not the control period.

        ``purpose`` is the task that needs a single sample rate, for the message, for
        example 'a linear model'.
        """
        for field, period in _periods(self.follower):
            if period != self.tick_s:
                raise InputError(
                    field,
                    f"is {period:g} s, but {purpose} needs one rate; set it to "
                    f"tick_s, {self.tick_s:g} s",
                )

    def surroundings(
        self, robot: str = "", paths: Mapping[str, Path] | None = None
    ) -> Surroundings:
        """Returns all bodies that a robot can hit and see, and the target of the robot.

        Args:
            robot: Name of the robot. Empty: the first robot.
            paths: Paths of the other robots, by name. A robot without a path is at rest
                at its start.

        Returns:
            The bodies by name, and the target. If the target has a body, this body is
            the last one.
        """
        robot = robot or next(iter(self.robots))
        target, paths = self.target(robot), paths or {}
        bodies = {o.name: Body(o.path(), o.shape()) for o in self.all_obstacles}
        for name, other in self.robots.items():
            if name != robot:
                start = RecordedPath(np.zeros(1), np.array([other.start.pose]))
                path = paths.get(name) or start
                bodies[name] = Body(path, box(other.size))
        for name, source in self.sources.items():
            if source.body:
                shape = box((source.length_m, source.width_m))
                bodies[name] = Body(source.path(), shape)
        if self.odor is not None:
            still = WaypointPath((self.odor.position_m,), speed=0.0)
            bodies[ODOR] = Body(still, box(CONTAINER_M))
        own = self.robots[robot]
        if isinstance(own, Router):
            goal = WaypointPath((own.route.goal_m,), speed=0.0)
            return Surroundings(bodies, GOAL, goal)
        if target in self.sources and not self.sources[target].body:
            return Surroundings(bodies, target, self.sources[target].path())
        bodies[target] = bodies.pop(target)
        return Surroundings(bodies, target)

    def bodies(self) -> dict[str, Body]:
        """The bodies that the first robot can hit, by name; its target is last."""
        return dict(self.surroundings().bodies)

    def robots_seen(self, robot: str) -> tuple[int, ...]:
        """Indices of the other robots in ``surroundings(robot).obstacles``."""
        names = enumerate(self.surroundings(robot).obstacles)
        return tuple(number for number, name in names if name in self.robots)

    def mapped(self) -> NDArray[np.float64]:
        """(n, 6) rectangles of the known obstacles at rest, m and rad."""
        still = [
            Body(obstacle.path(), obstacle.shape()).rectangles(0.0)
            for obstacle in self.all_obstacles
            if obstacle.known and not obstacle.path().moves
        ]
        return np.concatenate([np.empty((0, 6)), *still])

    @property
    def believed_sound_speed_m_s(self) -> float:
        """Speed of sound that the only robot assumes, m/s."""
        return self.only.assumed_sound_speed_m_s or self.sound_speed_m_s

    @property
    def source_size(self) -> tuple[float, float] | None:
        """Length and width of ``source``, m; None for a source without a body."""
        source = self.source
        return (source.length_m, source.width_m) if source.body else None

    @property
    def goal_radius_m(self) -> NonNegative:
        """``goal_radius`` of ``source``, m."""
        return self.goal_radius(moves=self.source.path().moves)

    def goal_radius(self, *, moves: bool) -> NonNegative:
        """Radius of the goal around the target, m.

        The robot is in its goal if its control point P is within this radius. The
        radius is the follow distance plus a margin. The margin is the following band if
        the target moves, and the goal margin otherwise.

        Args:
            moves: Whether the target moves.

        Returns:
            The radius, m.
        """
        margin = self.stop.following_band_m if moves else self.stop.goal_margin_m
        return self.only.follow_distance_m + margin

    @model_serializer(mode="wrap")
    def _dump(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        found = dump(self)  # a part of the fields, if some are excluded
        return file_form(found) if {"robots", "sources"} <= found.keys() else found

    @model_validator(mode="after")
    def _check(self) -> Scenario:
        # All further checks assume that these three checks pass.
        self._check_names()
        self._check_targets()
        check_searches(self.robots, self)
        faults = []
        for check in (
            lambda: check_goals(self.robots, self.stop),
            lambda: check_filled_goals(self.robots, self.all_obstacles),
            self._check_rates,
            self._check_step,
            self._check_room,
            self._check_start,
            lambda: check_map(self.map, self.robots, self.sources, self.obstacles),
            self._check_guards,
        ):
            try:
                check()
            except InputError as fault:
                faults.append(fault)
        if faults:
            raise InputError.joined(faults)
        return self

    def _check_names(self) -> None:
        taken = [ODOR] if self.odor is not None else []
        for name in self.robots:
            if name in (WORLD, *taken):
                raise InputError(
                    "robots", f"the name {name!r} is taken; give the robot another one"
                )
        taken += self.robots
        for field, names in (
            ("sources", self.sources),
            ("obstacles", [obstacle.name for obstacle in self.all_obstacles]),
        ):
            for name in names:
                if name in taken:
                    raise InputError(
                        field,
                        f"the name {name!r} is taken; give each obstacle, source and "
                        "robot a name of its own",
                    )
                taken.append(name)

    def _check_targets(self) -> None:
        played, sources = self.sounds(), self.sources
        for name, robot in self.robots.items():
            if robot.has_goal:
                continue
            field = f"robots.{name}.follows"
            target = self.target(name)
            if target not in played or target == name:
                can = ", ".join(each for each in played if each != name)
                remedy = f"use {can}" if can else "add a source, or a loudspeaker"
                raise InputError(
                    field,
                    f"{target!r} is neither a source nor another robot with a "
                    f"loudspeaker; {remedy}",
                )
            if robot.listens and target in sources and not sources[target].body:
                raise InputError(
                    f"sources.{target}.body",
                    f"is off, but robot {name!r} follows its sound; set it to true, or "
                    "set hearing: ideal_always",
                )
            if (
                isinstance(robot, Follower)
                and robot.listens
                and robot.tdoa.schedule_known
            ):
                _check_schedule(field, target, played)
        self._check_heard(played)

    def _check_heard(self, played: Mapping[str, SoundParameters]) -> None:
        robots = self.robots
        if any(robot.listens for robot in robots.values()):
            return
        followed = {self.target(name) for name in robots}
        # The default source need not be heard: it may serve as a body only.
        named = [
            each for each in played if each in robots or [*self.sources] != [SOURCE]
        ]
        for name in named:
            if name not in followed:
                group = (
                    f"robots.{name}.loudspeaker"
                    if name in robots
                    else f"sources.{name}"
                )
                raise InputError(
                    group,
                    "no robot hears its sound: no robot follows it, and none has "
                    "hearing 'audio'; let a robot follow it, or make it an "
                    "obstacle",
                )

    def _check_rates(self) -> None:
        tick = self.tick_s
        if not whole(tick * SAMPLE_RATE_HZ):
            raise InputError(
                "tick_s",
                f"{tick:g} s is not a multiple of {1.0 / SAMPLE_RATE_HZ:g} s, "
                "one sample of sound; round it",
            )
        periods = []
        for name, robot in self.robots.items():
            periods += [(f"robots.{name}.{f}", p) for f, p in _periods(robot)]
        for field, period in periods:
            if not whole(period / tick):
                ticks = max(1, round(period / tick))
                raise InputError(
                    field,
                    f"{period:g} s is not a multiple of tick_s, {tick:g} s; use "
                    f"{ticks * tick:g}, or another tick_s",
                )

    def _check_step(self) -> None:
        # Greatest stable ratio of step to lag is 3.3. With longer steps, the
        # integration amplifies a solution that should decay.
        step = self.integration_step_s
        for name, robot in self.robots.items():
            lag = robot.plant.motor_lag_s
            if lag < step / 3.3:
                raise InputError(
                    f"robots.{name}.plant.motor_lag_s",
                    f"{lag} s is too short for steps of {step} s, which "
                    f"would be unstable; set integration_step_s to {lag:g} or less",
                )

    def _check_room(self) -> None:
        if self.room is None:
            return
        self.room.walls(self.sound_speed_m_s)
        places: dict[str, Any] = {}
        for name, source in self.sources.items():
            places[f"sources.{name}.waypoints_m"] = source.waypoints_m
        for name, robot in self.robots.items():
            microphones = microphones_W(robot.start.pose, robot.robot)
            places[f"robots.{name}.start.position_m"] = microphones
        for field, points in places.items():
            what = ", a microphone," if field.endswith("start.position_m") else ""
            for point in points:
                if not self.room.contains(point):
                    raise InputError(
                        field,
                        f"({point[0]:g}, {point[1]:g}){what} is outside the room, "
                        f"which begins at {tuple(self.room.corner.tolist())} and is "
                        f"{self.room.size_m} m; set room.corner_m or room.size_m",
                    )

    def _check_start(self) -> None:
        footprints = {
            name: robot_rectangle(robot.start.pose, robot.robot)
            for name, robot in self.robots.items()
        }
        for (first, a), (second, b) in combinations(footprints.items(), 2):
            if rectangle_clearance(a, b) < 0.0:
                raise InputError(
                    f"robots.{second}.start.position_m",
                    f"robot {second!r} at {self.robots[second].start.position_m} "
                    f"overlaps robot {first!r}; move one of them",
                )
        still = {o.name: Body(o.path(), o.shape()) for o in self.obstacles}
        fields = [f"obstacles.{k}" for k in range(len(self.obstacles))]
        for name, source in self.sources.items():
            if source.body:
                shape = box((source.length_m, source.width_m))
                still[name] = Body(source.path(), shape)
                fields.append(f"sources.{name}")
        for robot, footprint in footprints.items():
            for field, (name, body) in zip(fields, still.items(), strict=True):
                if body.clearance(footprint, 0.0) < 0.0:
                    raise InputError(
                        field,
                        f"{name!r} is on the robot's start at "
                        f"{self.robots[robot].start.position_m}; move its first "
                        f"waypoint, or {field_in('robots', robot, 'start.position_m')}",
                    )

    def _check_guards(self) -> None:
        for name, robot in self.robots.items():
            if isinstance(robot, Follower):
                bodies = self.surroundings(name).bodies
                check_guard(f"robots.{name}.", robot, bodies, self.tick_s)


def scenario_from_mapping(data: Mapping[str, Any]) -> Scenario:
    """Validates a mapping of plain values; see ``load_scenario``."""
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise _explained(error, data) from None


def _explained(error: ValidationError, data: Mapping[str, Any]) -> InputError:
    written = partial(as_written, data=data)
    return explain(error, scenario_schema(), "a scenario", written)


def frame_of(robot: Robot) -> float:
    """Returns the audio frame of a robot, s; 0 without microphones."""
    if isinstance(robot, HasMicrophones):
        return robot.microphones.frame_s
    return 0.0


def _periods(robot: Robot) -> Iterator[tuple[str, float]]:
    """Yields the periods, s, of the sensors of a robot, by field."""
    if isinstance(robot, HasMicrophones):
        yield "microphones.frame_s", robot.microphones.frame_s
    if isinstance(robot, HasRangeSensors):
        yield "ultrasonic.period_s", robot.ultrasonic.period_s


def _check_schedule(
    field: str, target: str, played: Mapping[str, SoundParameters]
) -> None:
    """Raises an error if ``schedule_known`` is set, but the target never pauses."""
    sound = played[target]
    if sound.on_s >= sound.period_s:
        raise InputError(
            field.removesuffix("follows") + "tdoa.schedule_known",
            f"{target!r} sounds without a pause, so that its schedule has no "
            "effect; set it to false",
        )
