"""Writes a run as one HTML file that plays the run in a browser."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import (
    Box as Block,
    Cylinder,
    Meshcat,
    MeshcatCone,
    MeshcatParams,
    Rgba,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw

from analysis.report.palette import COLORS
from analysis.runs.known_space import known_space
from analysis.views.curves import page_charts
from analysis.views.floor_layers import clipped, floor_layers
from analysis.views.framing import floor_rectangle, shown_rectangle
from analysis.views.meshes import (
    Mesh,
    arrow,
    circle,
    joined,
    outline_band,
    prism,
    rectangles,
    ribbon,
    star,
)
from analysis.views.overlays import (
    Arrow,
    Ball,
    Bar,
    Circle,
    Disc,
    Frame,
    Outline,
    overlays,
)
from analysis.views.plume_history import plume_history
from analysis.views.replay_page import replay_page
from analysis.views.replay_stage import add_floor, set_stage
from analysis.views.scene import (
    BODY_HEIGHT_M,
    ROBOT_HEIGHT_M,
    Cone,
    Contact,
    Estimate,
    Goal,
    KnownFloor,
    Obstacle,
    Plume,
    Rings,
    RobotBody,
    Scene,
    SourceBody,
    Thing,
    Touched,
    Trail,
    Walls,
    lightened,
    make_scene,
)
from diagrams import RunResult
from diagrams.scenario.bodies import RecordedPath
from systems.base.robot import RobotParameters, body_radius, microphones_B
from systems.odor.odor_plume import PUFF_SIZE, PUFFS_BEGIN
from systems.odor.parameters import CONTAINER_M
from systems.world.shapes import rectangle_outline

#: Largest number of frames per second that Meshcat records.
FRAMES_PER_S = 32.0
#: Duration of one piece of a trail, s.
TRAIL_PIECE_S = 0.5
#: Radii of the rings around a source, m. While the source sounds, one ring after the
#: other is visible.
RINGS_M = (0.28, 0.38, 0.48, 0.58, 0.68)
#: Time for which one ring of a source is visible, s.
RING_S = 0.0625
#: Interval between two updates of the floor that a robot knows, s.
KNOWN_PERIOD_S = 0.5
#: Number of ticks (control periods) after which a map contains its first readings.
FIRST_TICKS = 3
#: Largest number of cells of all displayed states of one map together.
MOST_CELLS = 30_000_000
#: Heights and sizes of the details of a robot, m.
_MICROPHONE_HEIGHT_M, _SENSOR_HEIGHT_M, _WHEEL_WIDTH_M = 0.30, 0.14, 0.035
#: Width of the drawn body divided by the width of the robot. The microphone bar has the
#: full width of the robot.
_BODY_WIDTH_FRACTION = 0.45
#: Length of the cones, m. A cone of the full range, 3 m, would hide the scene.
_CONE_M = 0.8
#: Display of the plume by discs. ``_PUFFS_S``: interval between two updates, s.
#: ``_DISCS``: number of discs. ``_APART_M``: difference between the distances of two
#: consecutive discs from the source, m.
_PUFFS_S, _DISCS, _APART_M = 0.5, 30, 0.15


def write_replay(
    result: RunResult,
    path: str | Path,
    clearance: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Writes a self-contained page that plays the run in three dimensions.

    docs/runs.md and docs/searches.md explain what the page shows. ``clearance`` has the
    (n,) distances to the nearest body at the ticks, m, by name of the robot. The page
    needs a browser with WebGL, but no network.
    """
    scene = make_scene(result)
    layers = [*scene.layers, *overlays(scene, frame_times(result))]
    with quiet_drake():
        meshcat = Meshcat(MeshcatParams(host="localhost"))
        add_floor(meshcat, floor_rectangle(result), shown_rectangle(result))
        set_stage(meshcat)
        meshcat.StartRecording(FRAMES_PER_S, set_visualizations_while_recording=False)
        record(meshcat, scene, [thing for layer in layers for thing in layer.things])
        meshcat.StopRecording()
        meshcat.PublishRecording()
        page = meshcat.StaticHtml()
        del meshcat
    charts = page_charts(result, clearance or {})
    Path(path).write_text(replay_page(page, scene, layers, charts), "utf-8")


def record(meshcat: Meshcat, scene: Scene, things: Iterable[Thing]) -> None:
    """Adds things to a replay, and records their motion.

    Meshcat (Drake's 3D viewer) must already be recording.
    """
    recorder = _Recorder(meshcat, scene.result)
    for thing in things:
        recorder.draw(thing)


def draw_start(meshcat: Meshcat, things: Iterable[Thing]) -> None:
    """Draws things with one time as they are at this time. Does not record them."""
    recorder = _Recorder(meshcat, None)
    for thing in things:
        recorder.draw(thing)


@contextmanager
def quiet_drake() -> Iterator[None]:
    """Suppresses the message in which Drake prints the address of Meshcat's server."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(level)


def frame_times(result: RunResult) -> NDArray[np.float64]:
    """Returns the times of the frames of a replay, s."""
    return np.arange(0.0, result.simulated_s + 0.5 / FRAMES_PER_S, 1.0 / FRAMES_PER_S)


def wheel_angles(
    robot: RobotParameters, path: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Returns the angles of both wheels along a path, rad, by side.

    The wheels roll without slip. ``path`` has the (n, 3) poses (x, y, theta) of the
    robot in W, m and rad. For each side, ``left`` and ``right``, the result has (n,)
    angles, from 0 on.
    """
    theta = np.unwrap(path[:, 2])
    between = 0.5 * (theta[1:] + theta[:-1])
    steps = np.diff(path[:, :2], axis=0)
    forward = steps[:, 0] * np.cos(between) + steps[:, 1] * np.sin(between)
    turn = 0.5 * robot.wheel_separation_m * np.diff(theta)
    return {
        "left": np.r_[0.0, np.cumsum(forward - turn)] / robot.wheel_radius_m,
        "right": np.r_[0.0, np.cumsum(forward + turn)] / robot.wheel_radius_m,
    }


def ring_at(time: float, bursts: list[tuple[float, float]]) -> int | None:
    """Returns the index in ``RINGS_M`` of the ring that is visible at a time, s.

    While the source sounds, one ring after the other is visible. The result is None if
    the source is silent. Each burst has a start and an end, s.
    """
    for start, end in bursts:
        if start <= time < end:
            return math.floor((time - start) / RING_S) % len(RINGS_M)
    return None


def known_times(result: RunResult) -> list[float]:
    """Returns the times at which the replay updates the floor that a robot knows, s.

    The interval between the times is 0.5 s. For a map with many cells, the interval is
    longer, so that all displayed states of the map together have at most about
    ``MOST_CELLS`` cells.
    """
    end, scenario = result.simulated_s, result.scenario
    follower = scenario.follower
    cells = follower.own_map.cells_for(body_radius(follower.robot))
    most = max(2, MOST_CELLS // cells**2)
    period = max(KNOWN_PERIOD_S, end / most)
    first = min(FIRST_TICKS * scenario.tick_s, end)
    return [first, *np.arange(period, end, period).tolist(), end]


def _placed(
    x: float,
    y: float,
    z: float,
    yaw: float = 0.0,
    *,
    roll: float = 0.0,
    pitch: float = 0.0,
) -> RigidTransform:
    place: Any = np.array([x, y, z])  # Drake's type stubs reject arrays
    return RigidTransform(RollPitchYaw(roll, pitch, yaw), place)


class _Recorder:
    """Adds things to the scene of Meshcat, and records their motion."""

    def __init__(self, meshcat: Meshcat, result: RunResult | None) -> None:
        self.meshcat, self._result = meshcat, result
        self.end_s = result.simulated_s if result else 0.0
        self.frames = frame_times(result) if result else np.zeros(1)

    @property
    def result(self) -> RunResult:
        """The run. Shapes that show its past need it."""
        assert self._result is not None
        return self._result

    def draw(self, thing: Thing) -> None:
        self._add(thing)
        self._move(thing)
        if thing.seen is not None:
            self.switch(thing.path, thing.times, thing.seen)

    def put(
        self,
        path: str,
        shape: Any,
        color: str,
        place: RigidTransform | None = None,
        alpha: float = 1.0,
    ) -> None:
        """Adds an object to the scene of Meshcat.

        ``path`` is its path in the scene tree. ``place`` is its pose in the frame of
        its parent in this tree. With None, the pose is not set.
        """
        rgba = Rgba(*to_rgb(color), alpha)
        if isinstance(shape, Mesh):
            vertices: Any = np.asfortranarray(shape.vertices)
            faces: Any = np.asfortranarray(shape.faces)
            self.meshcat.SetTriangleMesh(path, vertices, faces, rgba)
        else:
            self.meshcat.SetObject(path, shape, rgba)
        if place is not None:
            self.meshcat.SetTransform(path, place)

    def switch(self, path: str, times: Iterable[float], states: Iterable[bool]) -> None:
        """Records each change of the visibility of an object.

        ``states`` are the visibilities at ``times``, s. The first state also holds from
        0 s until the first time.
        """
        last: bool | None = None
        for time, state in zip(times, states, strict=True):
            if state != last:
                at = 0.0 if last is None else float(time)
                self.meshcat.SetProperty(
                    path, "visible", value=bool(state), time_in_recording=at
                )
                last = state

    def _move(self, thing: Thing) -> None:
        poses, at_rest = thing.poses, len(thing.poses) == 1
        if at_rest and not isinstance(thing.shape, Cone):
            x, y, theta = poses[0]
            if np.any(poses) or thing.height:
                place = _placed(x, y, thing.height, theta)
                self.meshcat.SetTransform(thing.path, place)
        if not at_rest and not isinstance(thing.shape, Trail):
            for time, (x, y, theta) in zip(*self._keys(thing), strict=True):
                place = _placed(x, y, thing.height, theta)
                self.meshcat.SetTransform(thing.path, place, float(time))
        if thing.scale is not None:
            for time, scale in zip(*self._at_frames(thing, thing.scale), strict=True):
                if np.isfinite(scale).all():
                    path, at = thing.path, float(time)
                    self.meshcat.SetProperty(path, "scale", scale.tolist(), at)

    def _keys(self, thing: Thing) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns the times and poses between which the browser interpolates."""
        times, poses = thing.times, thing.poses
        if not thing.jumps:
            times, poses = self._at_frames(thing, poses)
            there = np.isfinite(poses[:, 0])
            if there.any() and not np.ptp(poses[there], axis=0).any():
                there[1:] = False
            return times[there], poses[there]
        seen = np.ones(len(times), dtype=bool) if thing.seen is None else thing.seen
        again = np.r_[False, seen[1:] & seen[:-1]]
        again[1:] &= np.isclose(poses[1:], poses[:-1]).all(axis=1)
        new = seen & ~again
        # The last pose before each jump is recorded again, so that the object rests
        # until the jump.
        before = np.r_[new[1:] & seen[:-1], False]
        return times[new | before], poses[new | before]

    def _at_frames(
        self, thing: Thing, values: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns (n,) times and (n, 3) values, with at most one time per frame.

        If a thing has more times than the replay has frames, the values are
        interpolated at the frames.
        """
        if len(thing.times) <= len(self.frames):
            return thing.times, values
        smooth = values.copy()
        if values is thing.poses:
            smooth[:, 2] = np.unwrap(values[:, 2])
        return self.frames, RecordedPath(thing.times, smooth).poses(self.frames)

    def _add(self, thing: Thing) -> None:
        path, color = thing.path, thing.color
        match thing.shape:
            case RobotBody() as shape:
                self._robot(thing, shape)
            case SourceBody() as shape:
                self._source(thing, shape)
            case Obstacle() | Touched() as shape:
                # The touched body covers the body itself.
                more = 0.01 if isinstance(shape, Touched) else 0.0
                self._solid(path, shape, more, color)
            case Walls() as shape:
                self._walls(thing, shape)
            case Cone() as shape:
                self._cone(thing, shape)
            case Rings() as shape:
                self._rings(thing, shape)
            case Trail() as shape:
                self._trail(thing, shape)
            case KnownFloor() as shape:
                self._known_floor(thing, shape)
            case Plume() as shape:
                self._plume(thing, shape)
            case Bar():
                bar = Block(0.03, 0.03, 1.0)
                self.put(f"{path}/bar", bar, color, _placed(0.0, 0.0, 0.5))
            case shape if type(shape) in _SINGLE:
                single = _SINGLE[type(shape)](shape)
                self.put(path, single, color, alpha=thing.alpha)

    def _solid(
        self, path: str, body: Obstacle | Touched, more: float, color: str
    ) -> None:
        """Adds a body that is larger than its shape by ``more``, m, in all extents."""
        shape, middle = body.shape, _placed(0.0, 0.0, 0.5 * body.height)
        height = body.height + more
        if shape.centered:
            length, width, radius = shape.rectangles[0, 3:].tolist()
            if radius == 0.0:
                box = Block(length + more, width + more, height)
                self.put(f"{path}/box", box, color, middle)
                return
            if length == width == 0.0:
                disc = Cylinder(radius + 0.5 * more, height)
                self.put(f"{path}/disc", disc, color, middle)
                return
        grown = shape.rectangles + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5 * more])
        outlines = [*shape.outlines, *map(rectangle_outline, grown if more else [])]
        parts = joined([prism(outline, height) for outline in outlines])
        self.put(f"{path}/parts", parts, color)

    def _robot(self, thing: Thing, shape: RobotBody) -> None:
        """Adds a robot at the origin of its body frame B."""
        path, own = thing.path, shape.parameters
        width = _BODY_WIDTH_FRACTION * own.width_m
        body = Block(own.length_m, width, ROBOT_HEIGHT_M - 0.04)
        middle = 0.5 * ROBOT_HEIGHT_M + 0.02
        self.put(f"{path}/body", body, thing.color, _placed(0.0, 0.0, middle))
        radius = own.wheel_radius_m
        tire = Cylinder(radius, _WHEEL_WIDTH_M)
        spoke = Block(1.7 * radius, 0.25 * radius, _WHEEL_WIDTH_M + 0.004)
        for side, angles in wheel_angles(own, thing.poses).items():
            y = (0.5 if side == "left" else -0.5) * own.wheel_separation_m
            # The axle of the wheel is the z axis of ``wheel``.
            axle = _placed(0.0, y, radius, roll=-0.5 * math.pi)
            self.meshcat.SetTransform(f"{path}/{side}", axle)
            wheel, still = f"{path}/{side}/wheel", np.zeros(len(angles))
            self.put(f"{wheel}/tire", tire, "#1F1F1F")
            self.put(f"{wheel}/spoke", spoke, "whitesmoke")
            poses = np.column_stack([still, still, angles])
            self._move(Thing(wheel, Frame(), "", thing.times, poses))
        if shape.hears:
            self._microphones(path, own)
        if shape.plays:
            self._loudspeaker(path, ROBOT_HEIGHT_M)

    def _microphones(self, path: str, own: RobotParameters) -> None:
        gray, x, height = "#595961", own.control_point_m - 0.01, _MICROPHONE_HEIGHT_M
        bar = Block(0.02, own.width_m, 0.02)
        self.put(f"{path}/bar", bar, gray, _placed(x, 0.0, height - 0.03))
        mast = Cylinder(0.012, height - ROBOT_HEIGHT_M)
        middle = 0.5 * (height + ROBOT_HEIGHT_M) - 0.02
        self.put(f"{path}/mast", mast, gray, _placed(x, 0.0, middle))
        for number, (u, v) in enumerate(microphones_B(own), start=1):
            ball, at = Sphere(0.028), _placed(u, v, height)
            self.put(f"{path}/microphone_{number}", ball, "#0D0D0D", at)

    def _loudspeaker(self, path: str, height: float) -> None:
        horn, above = Cylinder(0.07, 0.06), _placed(0.0, 0.0, height + 0.03)
        self.put(f"{path}/loudspeaker", horn, "#262626", above)

    def _source(self, thing: Thing, shape: SourceBody) -> None:
        body: Any = Cylinder(0.02, BODY_HEIGHT_M)
        if shape.is_body:
            body = Block(shape.length, shape.width, BODY_HEIGHT_M)
        middle = _placed(0.0, 0.0, 0.5 * BODY_HEIGHT_M)
        self.put(f"{thing.path}/body", body, thing.color, middle)
        self._loudspeaker(thing.path, BODY_HEIGHT_M)

    def _walls(self, thing: Thing, shape: Walls) -> None:
        """Adds the walls. They are low, so that they do not hide the robots."""
        (x, y), (wide, deep, _) = shape.corner, shape.size
        thick, height = 0.06, 0.25
        for number, (size_x, size_y, at_x, at_y) in enumerate(
            (
                (wide + 2.0 * thick, thick, x + wide / 2.0, y - thick / 2.0),
                (wide + 2.0 * thick, thick, x + wide / 2.0, y + deep + thick / 2.0),
                (thick, deep, x - thick / 2.0, y + deep / 2.0),
                (thick, deep, x + wide + thick / 2.0, y + deep / 2.0),
            )
        ):
            wall, place = Block(size_x, size_y, height), _placed(at_x, at_y, 0.125)
            self.put(f"{thing.path}/wall_{number}", wall, thing.color, place)

    def _cone(self, thing: Thing, shape: Cone) -> None:
        """Adds a cone for times with an echo, and another cone for all other times."""
        x, y, axis = thing.poses[0]
        # The axis of Meshcat's cone is z. The rotations tilt the cone forward, and then
        # turn it to the axis of the sensor.
        tilted = _placed(x, y, _SENSOR_HEIGHT_M, axis, pitch=0.5 * math.pi)
        self.meshcat.SetTransform(thing.path, tilted)
        radius = _CONE_M * math.tan(shape.half_angle)
        cone = MeshcatCone(_CONE_M, 0.35 * radius, radius)
        for name, alpha, seen in (
            ("echo", 0.55, shape.echo),
            ("empty", 0.18, ~shape.echo),
        ):
            path = f"{thing.path}/{name}"
            self.put(path, cone, COLORS[name], alpha=alpha)
            self.switch(path, thing.times, seen)

    def _rings(self, thing: Thing, shape: Rings) -> None:
        robot = thing.parent and isinstance(thing.parent.shape, RobotBody)
        height = ROBOT_HEIGHT_M if robot else BODY_HEIGHT_M
        times = np.arange(0.0, self.end_s, RING_S / 2.0)
        for number, radius in enumerate(RINGS_M):
            path = f"{thing.path}/{number + 1}"
            self.put(path, circle(radius, height, 0.03), thing.color)
            seen = [ring_at(time, shape.bursts) == number for time in times]
            self.switch(path, times, seen)

    def _trail(self, thing: Thing, shape: Trail) -> None:
        """Adds the pieces of a trail. A piece appears when the body reaches its end."""
        z, width = (0.005, 0.015) if shape.line == ":" else (0.008, 0.03)
        points = thing.poses[:, :2]
        step = max(1, round(TRAIL_PIECE_S / self.result.scenario.tick_s))
        for number, start in enumerate(range(0, len(points) - 1, step)):
            piece = points[start : start + step + 1]
            if not np.ptp(piece, axis=0).any():
                continue
            path = f"{thing.path}/{number}"
            self.put(path, ribbon(piece, z, width), thing.color)
            drawn = thing.times[min(start + step, len(points) - 1)]
            self.switch(path, (0.0, drawn), (False, True))

    def _known_floor(self, thing: Thing, shape: KnownFloor) -> None:
        """Adds the floor that a robot knows to be free, and dots for echoes."""
        known = known_space(shape.own, known_times(shape.own))
        if known is None:
            return
        floor = floor_rectangle(self.result)
        # The floors of several robots have different heights. Surfaces in one plane
        # would flicker.
        above = 0.0005 * [*self.result.robots].index(shape.own.name)
        dots = 0.25 * known.cell_m * np.array([1.0, -1.0, 1.0, -1.0])
        for name, cells, color, height, inset in (
            ("free", known.free, lightened(thing.color, 0.2), 0.001, 0.0 * dots),
            ("echoes", known.hits > 0.0, shape.echoes, 0.006, dots),
        ):
            layers = floor_layers(known, cells, whole=name == "free")
            for number, layer in enumerate(layers):
                edges = clipped(layer.rectangles + inset, floor)
                if not len(edges):
                    continue
                path = f"{thing.path}/{name}_{number}"
                self.put(path, rectangles(edges, height + above), color)
                states = [layer.begin <= k < layer.end for k in range(len(known.times))]
                self.switch(path, known.times, states)

    def _plume(self, thing: Thing, shape: Plume) -> None:
        """Adds the odor source, and discs that show some puffs of its plume.

        For each disc, there is a fixed distance from the source. The disc shows the
        puff whose distance from the source is nearest to this value.
        """
        purple, height = "#993380", 0.12
        box, middle = Block(*CONTAINER_M, height), _placed(0.0, 0.0, 0.5 * height)
        self.put(f"{thing.path}/container", box, purple, middle)
        if shape.scenario.odor is None or shape.scenario.odor.kind == "steady":
            return
        times: list[float] = []
        discs: list[list[tuple[float, float, float]]] = [[] for _ in range(_DISCS)]
        x, y, _ = thing.poses[0]
        for instant in plume_history(shape.scenario, self.end_s):
            if round(instant.time_s / _PUFFS_S * 1000) % 1000:
                continue
            times.append(instant.time_s)
            end = PUFFS_BEGIN + PUFF_SIZE * int(instant.plume[2])
            puffs = instant.plume[PUFFS_BEGIN:end].reshape(-1, PUFF_SIZE)
            away = np.hypot(puffs[:, 0] - x, puffs[:, 1] - y)
            for k, disc in enumerate(discs):
                disc.append(_nearest(puffs, away, _APART_M * (k + 0.5)))
        for k, disc in enumerate(discs):
            u, v, size = np.array(disc).T
            puff = Thing(
                f"{thing.path}/puff_{k}",
                Disc(1.0),
                purple,
                np.array(times),
                np.column_stack([u - x, v - y, np.zeros(len(u))]),
                seen=np.isfinite(size),
                height=0.004 + 0.0005 * k,
                alpha=0.5 - 0.4 * k / _DISCS,
                scale=np.column_stack([size, size, np.ones(len(size))]),
            )
            self.draw(puff)


def _nearest(
    puffs: NDArray[np.float64], away: NDArray[np.float64], distance: float
) -> tuple[float, float, float]:
    """Returns x, y and size of the puff that a disc shows, m.

    ``away`` are the distances of the puffs from the source, m. The result is the puff
    whose distance is nearest to ``distance``. If it differs by ``_APART_M`` or more,
    all three values are NaN.
    """
    if len(away):
        k = int(np.abs(away - distance).argmin())
        if abs(away[k] - distance) < _APART_M:
            return float(puffs[k, 0]), float(puffs[k, 1]), float(puffs[k, 4])
    return math.nan, math.nan, math.nan


#: Functions from a shape that is a single object in Meshcat to the geometry of it.
_SINGLE: dict[type, Callable[[Any], Any]] = {
    Estimate: lambda _: Sphere(0.06),
    Ball: lambda shape: Sphere(shape.radius),
    Circle: lambda shape: circle(shape.radius, 0.012, 0.03),
    Outline: lambda shape: outline_band(
        shape.half_length, shape.half_width, 0.012, 0.03
    ),
    Arrow: lambda _: arrow(),
    Disc: lambda shape: Cylinder(shape.radius, 0.002),
    Contact: lambda _: star(0.16, BODY_HEIGHT_M + 0.05, 0.035),
    Goal: lambda _: Cylinder(0.08, 0.01),
}
