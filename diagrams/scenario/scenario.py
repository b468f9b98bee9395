"""The scenario: all that a run depends on, in one tree of fields.

The tree consists of the parameter models of the blocks. Each quantity therefore has one
name, one default and one legal range. ``load_scenario`` reads a scenario from YAML.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import combinations
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    ValidationError,
    ValidationInfo,
    field_validator,
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
from diagrams.scenario.checks.goal_checks import check_goals
from diagrams.scenario.checks.guard_checks import check_guard
from diagrams.scenario.checks.search_checks import check_searches
from diagrams.scenario.fields.explain import explain, single_faults
from diagrams.scenario.fields.joining import joined
from diagrams.scenario.fields.shipped import scenario_schema
from diagrams.scenario.participants import FollowerParameters, SourceParameters
from diagrams.scenario.run_parameters import RunParameters
from systems.base.carrier_parameters import SourceRobotParameters
from systems.framework.input_error import InputError
from systems.framework.parameters import NonNegative, Parameters
from systems.framework.signals import SAMPLE_RATE_HZ, whole
from systems.laws.catalogue import LAWS
from systems.sound.parameters import SoundParameters
from systems.world.paths import WaypointPath
from systems.world.plane import rectangle_clearance

#: Names of the only robot and of the only source.
ROBOT, SOURCE = "robot", "source"
#: Name of the target of a robot with a route.
GOAL = "goal"
#: Name of the diagram that all robots share.
WORLD = "world"
#: Name of the source of odor.
ODOR = "odor"

_P = TypeVar("_P", bound=Parameters)


class Scenario(FollowerParameters, RunParameters):
    """One run. Every field has a default: the default scenario is complete.

    The fields of a robot apply to all robots, unless ``robots`` sets them for one
    robot. ``source`` and ``sound`` apply to all sources, unless ``sources`` sets them
    for one source.
    """

    @cached_property
    def all_robots(self) -> dict[str, FollowerParameters]:
        """Complete fields of each robot, by name."""
        fields = FollowerParameters.model_fields
        if not self.robots:
            values = {key: getattr(self, key) for key in fields}
            return {ROBOT: FollowerParameters.model_construct(**values)}
        base, robots = self.model_dump(include=set(fields)), {}
        for name, changes in self.robots.items():
            own = joined(base, changes)
            if isinstance(played := changes.get("loudspeaker"), Mapping):
                own["loudspeaker"] = joined(self.sound.model_dump(), played)
            robots[name] = _validated(FollowerParameters, own, f"robots.{name}")
        return robots

    @cached_property
    def all_sources(self) -> dict[str, SourceParameters]:
        """Complete fields of each source, by name."""
        robots = self.all_robots.values()
        if not self.sources and all(
            r.has_goal or r.follows in self.robots for r in robots
        ):
            return {}
        base = self.source.model_dump() | {"sound": self.sound.model_dump()}
        return {
            name: _validated(SourceParameters, joined(base, own), f"sources.{name}")
            for name, own in (self.sources or {SOURCE: {}}).items()
        }

    def sounds(self) -> dict[str, SoundParameters]:
        """The sound of each source and loudspeaker, by name of the source or robot."""
        played = {name: source.sound for name, source in self.all_sources.items()}
        for name, robot in self.all_robots.items():
            if robot.loudspeaker is not None:
                played[name] = robot.loudspeaker
        return played

    def sound_field(self, name: str) -> str:
        """Returns the field of a sound, for messages.

        Args:
            name: A name from ``sounds``.

        Returns:
            Dotted path of the field.
        """
        if name in self.all_robots:
            return f"robots.{name}.loudspeaker" if self.robots else "loudspeaker"
        return (
            f"sources.{name}.sound"
            if "sound" in self.sources.get(name, {})
            else "sound"
        )

    def robot_fields(self) -> Iterator[tuple[str, FollowerParameters]]:
        """Yields each robot, with the prefix of its fields in messages."""
        for name, robot in self.all_robots.items():
            yield (f"robots.{name}." if self.robots else ""), robot

    @property
    def longest_frame_s(self) -> float:
        """Longest audio frame of all robots, s."""
        return max(robot.microphones.frame_s for robot in self.all_robots.values())

    def target(self, robot: str) -> str:
        """Name of the target of a robot: a source, a leader, its goal, or the odor."""
        own = self.all_robots[robot]
        if own.has_goal:
            return GOAL if own.route is not None else ODOR
        return own.follows or next(iter(self.all_sources))

    def of_robot(self, name: str) -> Scenario:
        """Returns the scenario of one robot and of the source that it follows.

        If the robot follows a leader, ``source`` is at rest at the start pose of this
        leader.
        """
        if not self.robots and not self.sources:
            return self
        robot, target = self.all_robots[name], self.target(name)
        own = {key: getattr(robot, key) for key in FollowerParameters.model_fields}
        if robot.has_goal:
            return self.model_copy(update=own | {"robots": {}, "sources": {}})
        if target in self.all_sources:
            fields = SourceRobotParameters.model_fields
            data = self.all_sources[target].model_dump(include=set(fields))
        else:
            leader = self.all_robots[target]
            length, width = leader.size
            data = {
                "waypoints_m": (leader.start.position_m,),
                "heading_deg": leader.start.heading_deg,
                "length_m": length,
                "width_m": width,
            }
        source = SourceRobotParameters.model_validate(data)
        own |= {"source": source, "sound": self.sounds()[target], "follows": ""}
        return self.model_copy(update=own | {"robots": {}, "sources": {}})

    def require_one_robot(self, purpose: str) -> None:
        """Refuses named robots and sources.

        Args:
            purpose: What needs one robot, for example 'a linear model'.

        Raises:
            InputError: The scenario names robots or sources.
        """
        for field, named in (("robots", self.robots), ("sources", self.sources)):
            if named:
                raise InputError(
                    field,
                    f"has {', '.join(named)}, but {purpose} needs one robot and "
                    f"one source; leave {field} out",
                )

    def require_one_rate(self, purpose: str) -> None:
        """Refuses hearing and range sensors that are slower than the tick.

        Args:
            purpose: What needs one rate, for example 'a linear model'.

        Raises:
            InputError: A period differs from the tick.
        """
        for field, period in (
            ("microphones.frame_s", self.microphones.frame_s),
            ("ultrasonic.period_s", self.ultrasonic.period_s),
        ):
            if period != self.tick_s:
                raise InputError(
                    field,
                    f"is {period:g} s, but {purpose} needs one rate; set it to "
                    f"tick_s, {self.tick_s:g} s",
                )

    def surroundings(
        self, robot: str = "", paths: Mapping[str, Path] | None = None
    ) -> Surroundings:
        """Returns all bodies that a robot can hit and see, and its target.

        Args:
            robot: Name of the robot; empty: the first robot.
            paths: Paths of the other robots; a robot without a path is at rest at its
                start.

        Returns:
            The bodies by name, and the target. If the target has a body, this body is
            the last one.
        """
        robot = robot or next(iter(self.all_robots))
        target, paths = self.target(robot), paths or {}
        bodies = {o.name: Body(o.path(), o.size_m) for o in self.obstacles}
        for name, other in self.all_robots.items():
            if name != robot:
                start = RecordedPath(np.zeros(1), np.array([other.start.pose]))
                path = paths.get(name) or start
                bodies[name] = Body(path, other.size)
        for name, source in self.all_sources.items():
            if source.body:
                bodies[name] = Body(source.path(), (source.length_m, source.width_m))
        if self.odor is not None:
            still = WaypointPath((self.odor.position_m,), speed=0.0)
            bodies[ODOR] = Body(still, self.odor.container_m)
        route = self.all_robots[robot].route
        if route is not None:
            return Surroundings(bodies, GOAL, WaypointPath((route.goal_m,), speed=0.0))
        bodies[target] = bodies.pop(target)
        return Surroundings(bodies, target)

    def bodies(self) -> dict[str, Body]:
        """The bodies that the first robot can hit, by name; its target is last."""
        return dict(self.surroundings().bodies)

    def robots_seen(self, robot: str) -> tuple[int, ...]:
        """Indices of the other robots in ``surroundings(robot).obstacles``."""
        names = enumerate(self.surroundings(robot).obstacles)
        return tuple(number for number, name in names if name in self.all_robots)

    def mapped(self) -> NDArray[np.float64]:
        """(n, 5) rectangles of the known obstacles at rest, m and rad."""
        still = [
            Body(obstacle.path(), obstacle.size_m).rectangle(0.0)
            for obstacle in self.obstacles
            if obstacle.known and not obstacle.path().moves
        ]
        return np.reshape(still, (-1, 5))

    @property
    def source_size(self) -> tuple[float, float]:
        """Length and width of ``source``, m."""
        return self.source.length_m, self.source.width_m

    @property
    def goal_radius_m(self) -> NonNegative:
        """``goal_radius`` of ``source``, m."""
        return self.goal_radius(moves=self.source.path().moves)

    def goal_radius(self, *, moves: bool) -> NonNegative:
        """Greatest distance of P from the target with which P is in the goal, m.

        Args:
            moves: Whether the target moves. The follow distance is then increased by
                the following band, and otherwise by the goal margin.
        """
        margin = self.stop.following_band_m if moves else self.stop.goal_margin_m
        return self.follow_distance_m + margin

    @field_validator("robots", "sources")
    @classmethod
    def _check_changes(cls, named: Any, info: ValidationInfo) -> Any:
        robots = info.field_name == "robots"
        model = FollowerParameters if robots else SourceParameters
        faults = [
            fault
            for name, changes in named.items()
            for fault in single_faults(
                model, changes, scenario_schema(), (str(info.field_name), name)
            )
        ]
        if faults:
            raise InputError.joined(faults)
        return named

    @model_validator(mode="after")
    def _check(self) -> Scenario:
        # All further checks assume that these three checks pass.
        self._check_names()
        self._check_targets()
        self._check_searches()
        faults = []
        for check in (
            self._check_routes,
            self._check_goals,
            self._check_rates,
            self._check_step,
            self._check_room,
            self._check_start,
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
        for name in self.all_robots:
            if name in (WORLD, *taken):
                raise InputError(
                    "robots", f"the name {name!r} is taken; give the robot another one"
                )
        taken += self.all_robots
        for field, names in (
            ("sources", self.all_sources),
            ("obstacles", [obstacle.name for obstacle in self.obstacles]),
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
        played, sources = self.sounds(), self.all_sources
        for name, robot in self.all_robots.items():
            if robot.has_goal:
                continue
            field = f"robots.{name}.follows" if self.robots else "follows"
            target = self.target(name)
            if target not in played or target == name:
                can = [each for each in played if each != name]
                raise InputError(
                    field,
                    f"{target!r} is neither a source nor another robot with a "
                    f"loudspeaker; use {', '.join(can)}",
                )
            if target in sources and not sources[target].body:
                raise InputError(
                    f"sources.{target}.body",
                    f"is off, but robot {name!r} follows it; what is followed has a "
                    "body: set it to true",
                )
            if robot.tdoa.schedule_known and robot.listens:
                _check_schedule(field, target, played)
        self._check_heard(played)

    def _check_heard(self, played: Mapping[str, SoundParameters]) -> None:
        robots = self.all_robots
        if any(robot.listens for robot in robots.values()):
            return
        followed = {self.target(name) for name in robots}
        # The default source need not be heard: it may serve as a body only.
        named = [each for each in played if each in robots or each in self.sources]
        for name in named:
            if name not in followed:
                field = f"robots.{name}.loudspeaker" if self.robots else "loudspeaker"
                raise InputError(
                    field if name in robots else f"sources.{name}",
                    "no robot hears its sound: no robot follows it, and none has "
                    "hearing 'audio'; let a robot follow it, or make it an "
                    "obstacle",
                )

    def _check_routes(self) -> None:
        for prefix, robot in self.robot_fields():
            law = LAWS.get(robot.law)
            if robot.route is not None:
                if law is not None and not law.on_route:
                    can = [name for name, each in LAWS.items() if each.on_route]
                    raise InputError(
                        f"{prefix}law",
                        f"is {robot.law!r}, which follows a sound, but the robot has a "
                        f"route; use {', '.join(can)}, or leave route out",
                    )
            elif law is not None and law.on_route:
                raise InputError(
                    f"{prefix}route",
                    f"is missing, and law {robot.law!r} drives on one; set "
                    f"{prefix}route.goal_m",
                )

    def _check_goals(self) -> None:
        check_goals(dict(self.robot_fields()), self.stop.diverged_range_m)

    def _check_searches(self) -> None:
        robots = dict(zip(self.all_robots, self.robot_fields(), strict=True))
        check_searches(robots, self)

    def _check_rates(self) -> None:
        tick = self.tick_s
        if not whole(tick * SAMPLE_RATE_HZ):
            raise InputError(
                "tick_s",
                f"{tick:g} s is not a multiple of {1.0 / SAMPLE_RATE_HZ:g} s, "
                "one sample of sound; round it",
            )
        periods = []
        for prefix, robot in self.robot_fields():
            periods += [
                (f"{prefix}microphones.frame_s", robot.microphones.frame_s),
                (f"{prefix}ultrasonic.period_s", robot.ultrasonic.period_s),
            ]
            if self.room and robot.listens:
                self.room.update_frames(robot.microphones.frame_s)
        for field, period in periods:
            if not whole(period / tick):
                ticks = max(1, round(period / tick))
                raise InputError(
                    field,
                    f"{period:g} s is not a multiple of tick_s, {tick:g} s; use "
                    f"{ticks * tick:g}, or another tick_s",
                )

    def _check_step(self) -> None:
        # Greatest stable ratio of step to lag. With longer steps, the integration
        # scheme amplifies a solution that should decay.
        limits = {"runge_kutta2": 2.0, "runge_kutta3": 2.51, "runge_kutta5": 3.3}
        step = self.integrator.step_s
        for prefix, robot in self.robot_fields():
            lag = robot.plant.motor_lag_s
            if lag < step / limits[self.integrator.scheme]:
                raise InputError(
                    f"{prefix}plant.motor_lag_s",
                    f"{lag} s is too short for steps of {step} s, which "
                    f"would be unstable; set integrator.step_s to {lag:g} or less",
                )

    def _check_room(self) -> None:
        if self.room is None:
            return
        self.room.walls(self.acoustics.c)
        places: dict[str, Any] = {}
        for name, source in self.all_sources.items():
            group = f"sources.{name}" if self.sources else "source"
            places[f"{group}.waypoints_m"] = source.waypoints_m
        for prefix, robot in self.robot_fields():
            microphones = microphones_W(robot.start.pose, robot.robot)
            places[f"{prefix}start.position_m"] = microphones
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
            name: (prefix, robot, robot_rectangle(robot.start.pose, robot.robot))
            for name, (prefix, robot) in zip(
                self.all_robots, self.robot_fields(), strict=True
            )
        }
        for (first, (_, _, a)), (second, (prefix, robot, b)) in combinations(
            footprints.items(), 2
        ):
            if rectangle_clearance(a, b) < 0.0:
                raise InputError(
                    f"{prefix}start.position_m",
                    f"robot {second!r} at {robot.start.position_m} overlaps "
                    f"robot {first!r}; move one of them",
                )
        still = {o.name: Body(o.path(), o.size_m) for o in self.obstacles}
        fields = [f"obstacles.{k}" for k in range(len(self.obstacles))]
        for name, source in self.all_sources.items():
            if source.body:
                still[name] = Body(source.path(), (source.length_m, source.width_m))
                fields.append(f"sources.{name}" if self.sources else "source")
        for prefix, robot, footprint in footprints.values():
            for field, (name, body) in zip(fields, still.items(), strict=True):
                if rectangle_clearance(footprint, body.rectangle(0.0)) < 0.0:
                    raise InputError(
                        field,
                        f"{name!r} is on the robot's start at "
                        f"{robot.start.position_m}; move its first waypoint or "
                        f"{prefix}start.position_m",
                    )

    def _check_guards(self) -> None:
        robots = zip(self.all_robots, self.robot_fields(), strict=True)
        for name, (prefix, robot) in robots:
            check_guard(prefix, robot, self.surroundings(name).bodies, self.tick_s)


def _check_schedule(
    field: str, target: str, played: Mapping[str, SoundParameters]
) -> None:
    """Refuses ``schedule_known`` for a target that sounds without a pause."""
    sound = played[target]
    if sound.on_s >= sound.period_s:
        raise InputError(
            field.removesuffix("follows") + "tdoa.schedule_known",
            f"{target!r} sounds without a pause, so that its schedule has no "
            "effect; set it to false",
        )


def _validated(model: type[_P], data: dict[str, Any], where: str) -> _P:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        what = f"one of {where.split('.', maxsplit=1)[0]}"
        found = explain(error, model.model_json_schema(), what)
        raise InputError.joined([found], below=where) from None
