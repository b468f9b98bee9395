"""Makes the scene of a run: everything that pictures, films and replays show.

A scene is a list of things. Each thing has a shape, a color, and poses over time.
Pictures, films and replays each draw the shapes that they know, and leave out all
others. The sizes of shapes are in m.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from numpy.typing import NDArray

from analysis.report.palette import COLORS, ROBOT_COLORS
from analysis.runs.contact import contact_point, touched_shape
from analysis.runs.known_space import has_known_space
from analysis.views.bursts import call_time, sound_bursts
from diagrams import RunResult, Scenario
from diagrams.scenario.participants import HasRangeSensors, Robot
from systems.base.robot import RobotParameters
from systems.world.geometry import rotate
from systems.world.shapes import Shape

#: Heights of the bodies, m. The model has no heights, so these values are only for the
#: display.
ROBOT_HEIGHT_M, BODY_HEIGHT_M = 0.16, 0.35


class Obstacle(NamedTuple):
    """An obstacle."""

    shape: Shape
    height: float


class Touched(NamedTuple):
    """A body that a robot has touched. It is shown from the collision on."""

    shape: Shape
    height: float


class RobotBody(NamedTuple):
    """A robot with its wheels and its microphone bar."""

    parameters: RobotParameters
    hears: bool
    """Whether the robot has microphones."""
    plays: bool
    """Whether the robot has a loudspeaker."""


class SourceBody(NamedTuple):
    """A loudspeaker, with or without a body."""

    length: float
    width: float
    is_body: bool


class Walls(NamedTuple):
    """The walls of a room, whose floor is a rectangle along the axes of W."""

    corner: tuple[float, float]
    """Least x and least y of the floor in W, m."""
    size: tuple[float, float, float]
    """Size of the room along x, y and z, m."""


class Cone(NamedTuple):
    """The cone of a range sensor."""

    half_angle: float
    """Half of the opening angle, rad."""
    reach: NDArray[np.float64]
    """(n,) range reading at each tick, m."""
    echo: NDArray[np.bool_]
    """(n,) whether the sensor has an echo at each tick."""


class Trail(NamedTuple):
    """The path of a body or of a target from the start up to now."""

    line: str
    """Style of the line in matplotlib: ``-``, ``--``, or ``:``."""


class Estimate(NamedTuple):
    """The position of its target that a robot assumes."""

    fresh: NDArray[np.bool_] | None = None
    """(n,) whether the robot has a new estimate at each tick. None for a target on a
    route, which the robot does not estimate."""


class Goal(NamedTuple):
    """The goal of a route."""


class Contact(NamedTuple):
    """The point at which a robot touched another body."""


class Rings(NamedTuple):
    """Rings around a loudspeaker while it sounds."""

    bursts: list[tuple[float, float]]
    """Start and end of each burst, s."""


class Plume(NamedTuple):
    """The odor source, and the plume that the wind carries away from it."""

    scenario: Scenario


class KnownFloor(NamedTuple):
    """The floor that a robot knows to be free, and the places of its echoes."""

    own: RunResult
    """Result of this robot."""
    echoes: str
    """Color of the places from which echoes came."""
    echoes_label: str
    """Text for these places in the legend of a picture."""


@dataclass(frozen=True, eq=False)
class Thing:
    """One object of a scene."""

    path: str
    """Unique name, as a path in the scene tree of the 3D viewer."""
    shape: Any
    """A shape of this module or of ``overlays``."""
    color: str
    """Color in any form of matplotlib."""
    times: NDArray[np.float64]
    """(n,) ascending times, s."""
    poses: NDArray[np.float64]
    """(n, 3) poses (x, y, theta) at the times, m and rad; (1, 3) for an object at rest.
    They are in the frame of the parent, or in the world frame W if there is no
    parent."""
    name: str = ""
    """Name that the replay writes above the object."""
    label: str = ""
    """Text in the legend of a picture."""
    seen: NDArray[np.bool_] | None = None
    """(n,) whether the object is visible at the times. With None, it is always
    visible."""
    parent: Thing | None = None
    """Object that carries this object."""
    height: float = 0.0
    """Height above the parent or the floor, m."""
    alpha: float = 1.0
    """Opacity, 0 to 1."""
    scale: NDArray[np.float64] | None = None
    """(n, 3) factors of the object's size along its own axes at the times."""
    jumps: bool = False
    """Whether the object jumps from pose to pose and rests in between. Otherwise, it
    moves steadily from pose to pose."""

    @property
    def moves(self) -> bool:
        """Whether the object moves in the frame of its parent."""
        return bool(np.ptp(self.poses, axis=0).any())

    def pose(self, tick: int) -> NDArray[np.float64]:
        """Returns the pose (x, y, theta) in W at ``times[tick]``, m and rad."""
        own = self.poses[min(tick, len(self.poses) - 1)]
        return own if self.parent is None else compose(self.parent.pose(tick), own)

    def visible(self, tick: int) -> bool:
        """Returns whether the object is visible at ``times[tick]``."""
        return self.seen is None or bool(self.seen[tick])


class Layer(NamedTuple):
    """Things that share one entry of the legend."""

    label: str
    """Text of the entry."""
    meaning: str
    """Short explanation beside the text; may be empty."""
    colors: tuple[str, ...]
    """Colors of the sample beside the label."""
    things: list[Thing]
    switched: bool = True
    """Whether a reader can hide the things of this layer in a replay."""


@dataclass(frozen=True, eq=False)
class Scene:
    """All things of a run, in layers. Each layer is an entry of the legend."""

    result: RunResult
    bodies: dict[str, Thing]
    """Robots, sources and obstacles, by name."""
    layers: list[Layer]

    @cached_property
    def things(self) -> list[Thing]:
        """The things of all layers."""
        return [thing for layer in self.layers for thing in layer.things]


def make_scene(result: RunResult) -> Scene:
    """Makes the scene of a run, with poses at its ticks (control periods)."""
    scenario = result.full_scenario
    robots = {name: own.poses("WB") for name, own in result.robots.items()}
    found = scene_bodies(scenario, result.time, robots)
    layers = [
        *_robots(result, found),
        *_sources(result, found),
        *_obstacles(scenario, found),
        *_collisions(result, found),
        *_cones(result, found),
        *_estimates(result, found),
        *_known_floor(result, found),
        *_trails(result, found),
        *still_layers(scenario),
    ]
    return Scene(result, found, layers)


def still_layers(scenario: Scenario) -> list[Layer]:
    """Makes the layers that do not depend on the run: the room and the odor source."""
    return [*_walls(scenario), *_odor(scenario)]


def scene_bodies(
    scenario: Scenario,
    times: NDArray[np.float64],
    robots: Mapping[str, NDArray[np.float64]],
) -> dict[str, Thing]:
    """Makes the robots, sources and obstacles of a scene, by name.

    ``times`` are (n,) ascending times, s. ``robots`` has the (n, 3) poses (x, y, theta)
    of each robot at these times in W, m and rad, by name.
    """
    found = {}
    several, tints = len(robots) > 1, _robot_colors(scenario)
    for name, poses in robots.items():
        robot = scenario.robots[name]
        path = f"robots/{name}" if several else "robot"
        plays = robot.loudspeaker is not None
        hears = not scenario.drives_to_point(name)
        shape = RobotBody(robot.robot, hears, plays)
        label = f"{name if several else 'robot'} with its microphones"
        if not hears:
            label = "" if several else "robot"
        found[name] = Thing(path, shape, tints[name], times, poses, name, label)
    followed = {scenario.target(name) for name in scenario.robots}
    for name, source in scenario.sources.items():
        path = f"sources/{name}" if len(scenario.sources) > 1 else "source"
        color = COLORS["source" if name in followed else "interferer"]
        body = SourceBody(source.length_m, source.width_m, source.body)
        poses = source.path().poses(times)
        label = _source_label(scenario, name, followed)
        tag = _source_name(scenario, name)
        found[name] = Thing(path, body, color, times, poses, tag, label)
    for each in scenario.all_obstacles:
        poses = each.path().poses(times if each.path().moves else times[:1])
        label = "moving obstacle" if each.path().moves else "obstacle at rest"
        solid, path = Obstacle(each.shape(), BODY_HEIGHT_M), f"obstacles/{each.name}"
        color = COLORS["obstacle"]
        found[each.name] = Thing(path, solid, color, times, poses, each.name, label)
    return found


def _source_label(scenario: Scenario, name: str, followed: set[str]) -> str:
    if name not in followed:
        return f"{name} (not followed)"
    if len(scenario.sources) > 1:
        return name
    return "the goal" if scenario.is_goal_point(name) else "the source"


def _source_name(scenario: Scenario, name: str) -> str:
    """Returns the name of a source in pictures; a single goal point is the goal."""
    if len(scenario.sources) == 1 and scenario.is_goal_point(name):
        return "goal"
    return name


def _robot_colors(scenario: Scenario) -> dict[str, str]:
    """Returns the color of each robot, by name. Several robots get different colors."""
    if len(scenario.robots) == 1:
        return dict.fromkeys(scenario.robots, COLORS["robot"])
    return dict(zip(scenario.robots, cycle(ROBOT_COLORS), strict=False))


def estimate_colors(scenario: Scenario) -> dict[str, str]:
    """Returns the color of the target position that each robot assumes, by name."""
    if len(scenario.robots) == 1:
        return dict.fromkeys(scenario.robots, COLORS["estimate"])
    return _robot_colors(scenario)


def _robots(result: RunResult, bodies: Mapping[str, Thing]) -> Iterator[Layer]:
    sounds = result.full_scenario.sounds()
    for name, own in result.robots.items():
        body, law = bodies[name], own.scenario.only.law
        things = [body]
        if name in sounds:
            sound = sounds[name]
            if own.scenario.only.searches == "odor":  # sounds when it calls the others
                call = call_time(own)
                start = own.simulated_s if call is None else call + sound.start_s
                sound = sound.model_copy(update={"start_s": start})
            things.append(rings_of(body, sound_bursts(sound, result.simulated_s)))
        yield Layer(name, f"law {law}", (body.color,), things, switched=False)


def rings_of(body: Thing, bursts: list[tuple[float, float]]) -> Thing:
    """Makes the rings around a body. ``bursts`` are as in ``Rings``."""
    path, at_rest = f"{body.path}/rings", np.zeros((1, 3))
    rings = Rings(bursts)
    return Thing(path, rings, body.color, body.times, at_rest, parent=body)


def _sources(result: RunResult, bodies: Mapping[str, Thing]) -> Iterator[Layer]:
    scenario = result.full_scenario
    for name, source in scenario.sources.items():
        body, meaning = bodies[name], "what is followed"
        if body.color == COLORS["interferer"]:
            meaning = "emits sound, and the robot does not follow it"
        things = [body]
        if scenario.is_goal_point(name):
            meaning = "where the robot drives to"
        else:
            bursts = sound_bursts(source.sound, result.simulated_s)
            things.append(rings_of(body, bursts))
        yield Layer(body.name, meaning, (body.color,), things, switched=False)


def _obstacles(scenario: Scenario, bodies: Mapping[str, Thing]) -> Iterator[Layer]:
    things = [bodies[each.name] for each in scenario.all_obstacles]
    if things:
        yield Layer("obstacles", "", (COLORS["obstacle"],), things, switched=False)


def _collisions(result: RunResult, bodies: Mapping[str, Thing]) -> Iterator[Layer]:
    things, color = [], COLORS["hit"]
    for name, own in result.robots.items():
        if own.collision is None:
            continue
        hit, robot = own.collision, bodies[name]
        after = own.time >= hit.time - 1e-9
        after[-1] = True
        body = own.surroundings.bodies[hit.object]
        carrier, place = bodies.get(hit.object), np.zeros((1, 3))
        if carrier is None:
            place = np.array([body.path.pose(hit.time)])
        things.append(
            Thing(
                f"{carrier.path if carrier else 'collision/' + robot.path}/hit",
                Touched(touched_shape(own), BODY_HEIGHT_M),
                color,
                own.time,
                place,
                label=f"{hit.object}, which was touched",
                seen=after,
                parent=carrier,
            )
        )
        things.append(
            Thing(
                f"collision/{robot.path}",
                Contact(),
                "#000000",
                own.time,
                np.array([[*contact_point(own), 0.0]]),
                label="where they touched",
                seen=after,
            )
        )
    if things:
        yield Layer("what was hit", "from then on", (color,), things, switched=False)


def _cones(result: RunResult, bodies: Mapping[str, Thing]) -> Iterator[Layer]:
    things = [
        cone_of(
            bodies[name],
            own.scenario.only,
            sensor,
            own.columns[f"range_{sensor + 1}"],
            own.columns[f"echo_{sensor + 1}"] > 0.5,
        )
        for name, own in result.robots.items()
        for sensor in _logged_sensors(own)
    ]
    colors, meaning = (COLORS["echo"], COLORS["empty"]), "with or without an echo"
    if things:
        yield Layer("cones", f"ultrasonic; {meaning}", colors, things)


def cone_of(
    body: Thing,
    robot: Robot,
    sensor: int,
    reach: NDArray[np.float64],
    echo: NDArray[np.bool_],
) -> Thing:
    """Makes the cone of a range sensor of a robot.

    ``sensor`` is the index of the sensor, from 0. ``reach`` and ``echo`` are as in
    ``Cone``, at the times of the robot's body.
    """
    assert isinstance(robot, HasRangeSensors)
    half_angle = float(robot.ultrasonic.half_angles[sensor])
    path, place = f"{body.path}/cone_{sensor + 1}", sensor_pose(robot, sensor)[None]
    cone, color = Cone(half_angle, reach, echo), COLORS["echo"]
    return Thing(path, cone, color, body.times, place, parent=body)


def _logged_sensors(result: RunResult) -> range:
    """Returns the indices of the range sensors whose readings are in the log."""
    robot = result.scenario.only
    if isinstance(robot, HasRangeSensors) and "range_1" in result.columns:
        return range(robot.ultrasonic.count)
    return range(0)


def sensor_pose(robot: Robot, sensor: int) -> NDArray[np.float64]:
    """Returns the pose (x, y, theta) of a range sensor in the robot frame B, m and rad.

    ``sensor`` is the index of the sensor, from 0. theta is the direction of the axis of
    its cone.
    """
    assert isinstance(robot, HasRangeSensors)
    own = robot.ultrasonic.sensors[sensor]
    x, y = own.position_m
    ahead = robot.robot.control_point_m
    return np.array([ahead + x, y, math.radians(own.axis_deg)])


def compose(
    pose_WB: NDArray[np.float64], pose_BU: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Converts the pose of an object U from the robot frame B to the world frame W.

    Poses are (x, y, theta), m and rad. ``pose_WB`` is the pose of B in W, and
    ``pose_BU`` is the pose of U in B. The angle of the result is not wrapped.
    """
    dx, dy = rotate(pose_WB[2], pose_BU[0], pose_BU[1])
    return np.array([pose_WB[0] + dx, pose_WB[1] + dy, pose_WB[2] + pose_BU[2]])


def _estimates(result: RunResult, bodies: Mapping[str, Thing]) -> Iterator[Layer]:
    scenario, things = result.full_scenario, []
    colors = estimate_colors(scenario)
    routes = any(robot.kind == "router" for robot in scenario.robots.values())
    for name, own in result.robots.items():
        robot, columns = own.scenario.only, own.columns
        path = bodies[name].path.replace("robot", "estimate", 1)
        if robot.kind == "router":
            places, seen, shape, label = own.vector("target"), None, Estimate(), ""
        elif result.full_scenario.drives_to_point(name):
            continue
        elif "p_WS_estimated_x" in columns and robot.searches is None:
            valid = columns["target_valid"] > 0.5
            # An estimate changes the target only from the next tick on.
            heard = columns.get("detected", np.zeros_like(valid))[:-1] > 0.5
            shape = Estimate(np.r_[False, heard & valid[1:]])
            places, seen = own.vector("p_WS_estimated"), valid
            whose = name if result.several else "the source"
            label = f"estimates of {whose}; faint ones are early"
        else:
            continue
        poses = np.column_stack([*places, np.zeros(len(own.time))])
        color, jumps = colors[name], seen is not None
        ball = Thing(path, shape, color, own.time, poses, "", label, seen)
        height = BODY_HEIGHT_M + (0.07 if jumps else -0.05)
        things.append(replace(ball, height=height, jumps=jumps))
        if robot.kind == "router":
            goal_m = own.scenario.router.route.goal_m
            things.append(goal_of(goal_m, bodies[name], several=bool(result.several)))
    label, meaning = "estimates", "where the robot assumes the source"
    if routes:
        label, meaning = "targets", "the target on the route"
    if things:
        yield Layer(label, meaning, tuple(colors.values()), things)


def goal_of(goal_m: tuple[float, float], body: Thing, *, several: bool) -> Thing:
    """Makes the goal of a robot's route, at ``goal_m`` in W, m."""
    path, label = f"goals/{body.path}", "goals" if several else "goal"
    place = np.array([[*goal_m, 0.0]])
    goal = Thing(path, Goal(), body.color, body.times, place, "", label)
    return replace(goal, height=0.006, alpha=0.6)


def _known_floor(result: RunResult, bodies: Mapping[str, Thing]) -> Iterator[Layer]:
    things = []
    for name, own in result.robots.items():
        if not has_known_space(own):
            continue
        seen, echoes, color = "", "", bodies[name].color
        if result.several:
            seen, echoes = f" by {name}", f" to {name}"
        shape = KnownFloor(
            own,
            color if result.several else COLORS["echoes"],
            f"places that echoes{echoes} came from",
        )
        color = color if result.several else COLORS["seen"]
        label, path = f"seen as free{seen} at the end", f"known/{bodies[name].path}"
        at_rest = np.zeros((1, 3))
        things.append(Thing(path, shape, color, own.time, at_rest, label=label))
    colors = tuple(lightened(thing.color, 0.35) for thing in things)
    if things:
        yield Layer("known floor", "seen as free; dots: echoes", colors, things)


def _trails(result: RunResult, bodies: Mapping[str, Thing]) -> Iterator[Layer]:
    scenario, things = result.full_scenario, []
    several = bool(result.several)
    for name, own in result.robots.items():
        body, label = bodies[name], "path of the control point P"
        if several:
            routed = own.scenario.only.kind == "router"
            label = f"{name}, path of P" if routed else f"path of P of {name}"
        places = own.vector("p_WP")
        things.append(_trail(f"trail/{body.path}", places, body, "-", label))
        if own.scenario.only.kind != "router":
            continue
        tinted = replace(body, color=estimate_colors(scenario)[name])
        label = "paths of the targets" if several else "path of the target"
        path, places = f"trail/target/{body.path}", own.vector("target")
        things.append(_trail(path, places, tinted, ":", label))
    for name in scenario.sources:
        body = bodies[name]
        if body.moves:
            path, label = f"trail/{body.path}", f"path of {body.label}"
            things.append(_trail(path, body.poses[:, :2].T, body, "--", label))
    colors = tuple(_robot_colors(scenario).values())
    yield Layer("trails", "past positions", colors, things)


def _trail(
    path: str, places: NDArray[np.float64], body: Thing, line: str, label: str
) -> Thing:
    poses = np.column_stack([*places, np.zeros(len(body.times))])
    return Thing(path, Trail(line), body.color, body.times, poses, label=label)


def _walls(scenario: Scenario) -> Iterator[Layer]:
    room, color = scenario.room, COLORS["wall"]
    if room is not None:
        x, y = map(float, room.corner)
        at_rest = np.zeros((1, 3))
        shape = Walls((x, y), room.size_m)
        label, start = "walls of the room", np.zeros(1)
        wall = Thing("room", shape, color, start, at_rest, label=label)
        yield Layer("walls", "of the room", (color,), [wall])


def _odor(scenario: Scenario) -> Iterator[Layer]:
    odor, color = scenario.odor, COLORS["odor"]
    if odor is not None:
        place, start = np.array([[*odor.position_m, 0.0]]), np.zeros(1)
        shape, label = Plume(scenario), "source of odor"
        plume = Thing("odor", shape, color, start, place, label=label)
        yield Layer("odor", "the plume", (color,), [plume])


def lightened(color: str, part: float) -> str:
    """Mixes a color with white; ``part`` is the share of the color, 0 to 1."""
    red, green, blue = (1.0 - part * (1.0 - level) for level in to_rgb(color))
    return to_hex((red, green, blue))
