"""Shows the scene of a run in Meshcat at one time after the other, as the run goes on.

The scene has the shapes of a replay. It leaves out what a replay knows only after the
run, and what is too much to send many times per second: collisions, the known floor,
the plume, and the overlays of single laws.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from analysis.views.bursts import sound_bursts
from analysis.views.framing import expected_bounds, whole_meters
from analysis.views.meshes import ribbon
from analysis.views.replay import (
    RINGS_M,
    TRAIL_PIECE_S,
    draw_start,
    ring_at,
    wheel_angles,
)
from analysis.views.replay_stage import add_floor, set_stage
from analysis.views.scene import (
    BODY_HEIGHT_M,
    Estimate,
    Thing,
    cone_of,
    estimate_colors,
    goal_of,
    rings_of,
    scene_bodies,
    still_layers,
)
from diagrams import Scenario
from diagrams.scenario.bodies import Path
from diagrams.scenario.participants import HasRangeSensors, Robot, Router
from systems.world.plane import control_point

Values = Mapping[str, NDArray[np.float64]]

#: First parts of the paths of all objects, of one robot or source or of several.
_ROOTS = (
    *("floor", "room", "odor", "goals", "trail", "obstacles"),
    *("robot", "robots", "source", "sources", "estimate", "estimates"),
)


def sensor_count(robot: Robot) -> int:
    """Returns the number of range sensors of a robot, from whose blocks echoes come."""
    if isinstance(robot, HasRangeSensors) and robot.obstacle_sensing == "ultrasonic":
        return robot.ultrasonic.count
    return 0


class LiveScene:
    """The scene of a scenario in Meshcat, at one time after the other.

    Args:
        scenario: The scenario of the run.
        meshcat: Drake's 3D viewer. The scene replaces an earlier scene in it.
    """

    def __init__(self, scenario: Scenario, meshcat: Meshcat) -> None:
        self._scenario, self._meshcat = scenario, meshcat
        starts = {
            name: np.array([robot.start.pose])
            for name, robot in scenario.robots.items()
        }
        self._bodies = scene_bodies(scenario, np.zeros(1), starts)
        paths = {name: each.path() for name, each in scenario.sources.items()}
        self._paths: dict[str, Path] = {
            **{name: path for name, path in paths.items() if path.moves},
            **{o.name: o.path() for o in scenario.all_obstacles if o.path().moves},
        }
        self._bursts = {
            name: sound_bursts(sound, scenario.duration_s)
            for name, sound in scenario.sounds().items()
            if name not in scenario.robots or not scenario.robots[name].searches
        }
        self._estimates = dict(self._make_estimates())
        self._visible: dict[str, bool] = {}
        self._wheels: dict[str, NDArray[np.float64]] = {}
        self._trails: dict[str, list[tuple[float, float]]] = {}
        self._pieces: dict[str, tuple[float, int]] = {}

    def start(self) -> None:
        """Draws all objects as they are before the run, and places the camera."""
        meshcat, scenario = self._meshcat, self._scenario
        shown = expected_bounds(scenario, margin=0.5)
        edges = expected_bounds(scenario, margin=0.8)
        for path in _ROOTS:
            meshcat.Delete(path)
        add_floor(meshcat, whole_meters(edges, scenario.arena_m), shown)
        set_stage(meshcat)
        draw_start(meshcat, self._things())
        self._visible, self._wheels, self._trails, self._pieces = {}, {}, {}, {}
        x, y = 0.5 * (shown[0] + shown[1]), 0.5 * (shown[2] + shown[3])
        away = 0.8 * max(shown[1] - shown[0], 1.3 * (shown[3] - shown[2]))
        camera: Any = np.array([x, y - 0.7 * away, 0.8 * away])
        target: Any = np.array([x, y, 0.0])  # Drake's type stubs reject arrays
        meshcat.SetCameraPose(camera, target)

    def show(self, time: float, values: Values) -> None:
        """Shows all objects at a time.

        Args:
            time: Time of the run, s.
            values: Values of the ports of the diagram, by name, for example
                ``robot.pose_WB``. The poses of sources and obstacles are those of
                their waypoints, if there is no value.
        """
        self._meshcat.SetSimulationTime(time)
        scenario = self._scenario
        given = {f"{name}.pose_WS": name for name in scenario.sources}
        poses = {name: values[port] for port, name in given.items() if port in values}
        if "obstacles.poses_WO" in values:
            rows = values["obstacles.poses_WO"].reshape(-1, 3)
            begin = 0
            for each in scenario.all_obstacles:
                shape = each.shape()
                if shape.centered:  # its rectangle has the pose of the body
                    poses[each.name] = rows[begin]
                begin += len(shape.rectangles)
        for name, path in self._paths.items():
            poses.setdefault(name, np.array(path.pose(time)))
        for name, robot in scenario.robots.items():
            if f"{name}.pose_WB" in values:
                pose = poses[name] = values[f"{name}.pose_WB"]
                self._turn_wheels(name, pose)
                point = control_point(pose, robot.robot.control_point_m)
                self._extend_trail(name, time, point)
            self._show_sensing(name, values)
        for name, pose in poses.items():
            self._place(self._bodies[name], pose)
            if name in self._paths and name in scenario.sources:
                self._extend_trail(name, time, (pose[0], pose[1]))
        for name, bursts in self._bursts.items():
            ring = ring_at(time, bursts)
            for number in range(len(RINGS_M)):
                place = f"{self._bodies[name].path}/rings/{number + 1}"
                self._switch(place, seen=number == ring)

    def _things(self) -> Iterator[Thing]:
        scenario, bodies = self._scenario, self._bodies
        yield from bodies.values()
        for name in self._bursts:
            yield rings_of(bodies[name], [])
        for name, robot in scenario.robots.items():
            nothing = np.zeros(1)
            for sensor in range(sensor_count(robot)):
                yield cone_of(bodies[name], robot, sensor, nothing, nothing > 0.0)
            if isinstance(robot, Router):
                several = len(scenario.robots) > 1
                yield goal_of(robot.route.goal_m, bodies[name], several=several)
        yield from self._estimates.values()
        for layer in still_layers(scenario):
            yield from layer.things

    def _make_estimates(self) -> Iterator[tuple[str, Thing]]:
        colors = estimate_colors(self._scenario)
        for name, robot in self._scenario.robots.items():
            if robot.searches is None:
                body, routed = self._bodies[name], isinstance(robot, Router)
                path = body.path.replace("robot", "estimate", 1)
                ball = Thing(path, Estimate(), colors[name], body.times, body.poses)
                height = BODY_HEIGHT_M + (-0.05 if routed else 0.07)
                yield name, replace(ball, height=height)

    def _show_sensing(self, name: str, values: Values) -> None:
        """Shows the cones of a robot, and the target that it assumes."""
        for sensor, echo in enumerate(values.get(f"{name}.echo", ()), start=1):
            path = f"{self._bodies[name].path}/cone_{sensor}"
            self._switch(f"{path}/echo", seen=echo > 0.5)
            self._switch(f"{path}/empty", seen=echo <= 0.5)
        ball = self._estimates.get(name)
        if ball is None:
            return
        routed = isinstance(self._scenario.robots[name], Router)
        port = "target_state" if routed else "p_WS_estimated"
        valid = values.get(f"{name}.target_valid", np.zeros(1))[0] > 0.5
        place = values.get(f"{name}.{port}")
        self._switch(ball.path, seen=place is not None and (routed or valid))
        if place is not None:
            self._place(ball, np.array([place[0], place[1], 0.0]))

    def _place(self, thing: Thing, pose: NDArray[np.float64]) -> None:
        place: Any = np.array([pose[0], pose[1], thing.height])
        turn = RotationMatrix.MakeZRotation(float(pose[2]))
        self._meshcat.SetTransform(thing.path, RigidTransform(turn, place))

    def _turn_wheels(self, name: str, pose: NDArray[np.float64]) -> None:
        """Turns the wheels as far as they roll from the last pose to this one."""
        last = self._wheels.get(name)
        angles = np.zeros(2) if last is None else last[3:].copy()
        if last is not None:
            robot = self._scenario.robots[name].robot
            steps = wheel_angles(robot, np.array([last[:3], pose]))
            angles += [steps["left"][1], steps["right"][1]]
        self._wheels[name] = np.concatenate([pose, angles])
        for side, angle in zip(("left", "right"), angles, strict=True):
            turn = RigidTransform(RotationMatrix.MakeZRotation(float(angle)))
            path = f"{self._bodies[name].path}/{side}/wheel"
            self._meshcat.SetTransform(path, turn)

    def _extend_trail(self, name: str, time: float, point: tuple[float, float]) -> None:
        """Adds a point to a trail, and draws a piece of it when the piece is full."""
        points = self._trails.setdefault(name, [])
        points.append((float(point[0]), float(point[1])))
        begin, number = self._pieces.setdefault(name, (time, 0))
        if time - begin < TRAIL_PIECE_S - 1e-9:
            return
        moved = [points[0]] + [b for a, b in pairwise(points) if math.dist(a, b) > 0.0]
        if len(moved) > 1:
            body = self._bodies[name]
            mesh = ribbon(moved, 0.008, 0.03)
            vertices: Any = np.asfortranarray(mesh.vertices)
            faces: Any = np.asfortranarray(mesh.faces)
            color, path = Rgba(*to_rgb(body.color)), f"trail/{body.path}/{number}"
            self._meshcat.SetTriangleMesh(path, vertices, faces, color)
        self._trails[name] = points[-1:]
        self._pieces[name] = time, number + 1

    def _switch(self, path: str, *, seen: bool) -> None:
        if self._visible.get(path) != seen:
            self._visible[path] = bool(seen)
            self._meshcat.SetProperty(path, "visible", value=bool(seen))
