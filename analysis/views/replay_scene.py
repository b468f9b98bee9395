"""Adds the objects of a replay to the scene of Meshcat (Drake's 3D viewer).

Meshcat records the motion and the visibility of objects, but not their creation.
Therefore the functions here create all objects before the recording starts.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.textpath import TextPath
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatCone, Rgba, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from analysis.reporting.palette import COLOURS
from analysis.views.scene import Look, bounds, logged_sensors, sensor_pose
from diagrams import RunResult, Scenario
from diagrams.scenario.participants import SourceParameters
from systems.base.robot import microphones_B

#: Heights of the objects, m. The model has no heights, so these values are only for the
#: display.
ROBOT_HEIGHT_M = 0.16
MICROPHONE_HEIGHT_M = 0.30
SOURCE_HEIGHT_M = 0.30
OBSTACLE_HEIGHT_M = 0.35
SENSOR_HEIGHT_M = 0.14
WHEEL_WIDTH_M = 0.035
#: Width of the body divided by the width of the microphone bar, which is wider.
BODY_WIDTH_FRACTION = 0.45
#: Size of the numbers on the floor divided by the width of the view. The numbers are
#: readable on a phone, too.
NUMBER_SHARE = 0.028
#: Radii of the rings of a source, m. While the source sounds, they appear in turn.
RINGS = (0.28, 0.38, 0.48, 0.58, 0.68)


def _colour(role: str, alpha: float = 1.0) -> Rgba:
    return Rgba(*to_rgb(COLOURS.get(role, role)), alpha)


def upright(x: float, y: float, z: float, yaw: float = 0.0) -> RigidTransform:
    """Returns the pose of an upright body at a given height.

    Args:
        x: x of the body in its parent frame, m.
        y: y of the body in its parent frame, m.
        z: Height above the floor, m.
        yaw: Angle about the vertical axis, counterclockwise, rad.

    Returns:
        Pose of the body in the parent frame.
    """
    return _placed(0.0, 0.0, yaw, [x, y, z])


def _placed(
    roll: float, pitch: float, yaw: float, place: list[float]
) -> RigidTransform:
    return RigidTransform(RollPitchYaw(roll, pitch, yaw), _plain(place))


def _plain(values: ArrayLike) -> Any:
    """Returns an untyped array in column order, as Drake's type stubs require."""
    return np.asfortranarray(values)


def _put(meshcat: Meshcat, path: str, shape: Any, rgba: Rgba, *place: float) -> None:
    """Adds an object at a pose; ``place`` has the arguments of ``upright``."""
    meshcat.SetObject(path, shape, rgba)
    meshcat.SetTransform(path, upright(*place))


def _ribbon(
    meshcat: Meshcat, path: str, points: ArrayLike, rgba: Rgba, z: float, width: float
) -> None:
    """Adds a flat band along a line.

    Most browsers draw lines only one pixel wide.

    Args:
        meshcat: Scene of the replay.
        path: Path of the band in the scene tree of the 3D viewer.
        points: (n, 2) points of the line, m.
        rgba: Color of the band.
        z: Height above the floor, m.
        width: Width of the band, m.
    """
    middle = np.asarray(points, dtype=float)
    along = np.gradient(middle, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    aside = 0.5 * width * np.column_stack([-along[:, 1], along[:, 0]])
    edges = np.concatenate([middle + aside, middle - aside]).T
    vertices = np.vstack([edges, np.full(edges.shape[1], z)])
    n = len(middle)
    left, right = np.arange(n - 1), n + np.arange(n - 1)
    faces = np.hstack([[left, right, right + 1], [left, right + 1, left + 1]])
    triangles = _plain(faces.astype(np.int32))
    meshcat.SetTriangleMesh(path, _plain(vertices), triangles, rgba)


def add_floor(meshcat: Meshcat, result: RunResult) -> None:
    """Adds a floor for the whole run, with one grid line per meter and labels of x.

    The labels are at the near edge of the initial view. The floor extends beyond this
    edge.

    Args:
        meshcat: Scene of the replay.
        result: Result of the run.
    """
    x_low, x_high, y_low, y_high = floor_rectangle(result)
    x, y = (x_low + x_high) / 2.0, (y_low + y_high) / 2.0
    slab = Box(x_high - x_low, y_high - y_low, 0.02)
    _put(meshcat, "floor/slab", slab, Rgba(1.0, 1.0, 0.99), x, y, -0.011)
    along = np.arange(x_low, x_high + 0.5)
    across = np.arange(y_low, y_high + 0.5)
    starts = [(x, y_low) for x in along] + [(x_low, y) for y in across]
    ends = [(x, y_high) for x in along] + [(x_high, y) for y in across]
    _segments(meshcat, "floor/grid", starts, ends, Rgba(0.55, 0.55, 0.55))
    left, right, near, _ = shown_rectangle(result)
    size = NUMBER_SHARE * (right - left)
    for x in along:
        text = f"{x:.0f} m".replace("-", "\u2212")
        outline = TextPath((x + 0.4 * size, near + 0.4 * size), text, size=size)
        if x >= left and outline.get_extents().x1 <= right:
            _write(meshcat, f"floor/x {x:.0f}", outline)


def shown_rectangle(result: RunResult) -> tuple[float, float, float, float]:
    """Returns the part of the floor that the initial view shows.

    Args:
        result: Result of the run.

    Returns:
        Least x, greatest x, least y, greatest y in the world frame W, m.
    """
    return bounds(result, margin=0.5)


def floor_rectangle(result: RunResult) -> tuple[float, float, float, float]:
    """Returns the edges of the floor in the world frame W.

    The floor contains the whole run. It is at least as large as the arena of the
    scenario.

    Args:
        result: Result of the run.

    Returns:
        Least x, greatest x, least y, greatest y, as whole meters.
    """
    x_low, x_high, y_low, y_high = bounds(result, margin=0.8)
    width, depth = result.full_scenario.arena_m
    x_more = max(width - (x_high - x_low), 0.0) / 2.0
    y_more = max(depth - (y_high - y_low), 0.0) / 2.0
    return (
        float(math.floor(x_low - x_more)),
        float(math.ceil(x_high + x_more)),
        float(math.floor(y_low - y_more)),
        float(math.ceil(y_high + y_more)),
    )


def _segments(
    meshcat: Meshcat, path: str, starts: ArrayLike, ends: ArrayLike, rgba: Rgba
) -> None:
    def lifted(points: ArrayLike) -> Any:
        flat = np.asarray(points, dtype=float).T
        return _plain(np.vstack([flat, np.full(flat.shape[1], 0.004)]))

    meshcat.SetLineSegments(path, lifted(starts), lifted(ends), 1.0, rgba)


def _write(meshcat: Meshcat, path: str, text: TextPath) -> None:
    """Draws the outlines of letters on the floor, because Meshcat cannot draw text."""
    starts: list[NDArray[np.float64]] = []
    ends: list[NDArray[np.float64]] = []
    for polygon in text.to_polygons():
        outline = np.asarray(polygon)
        starts.extend(outline[:-1])
        ends.extend(outline[1:])
    _segments(meshcat, path, starts, ends, Rgba(0.25, 0.25, 0.25))


def add_robot(meshcat: Meshcat, look: Look, path: str, estimate: str) -> None:
    """Adds a robot with body, wheels, microphone bar and sensor cones.

    The robot is at the origin of its body frame B.

    Args:
        meshcat: Scene of the replay.
        look: Run, colors and labels of the robot.
        path: Path of the robot in the scene tree of the 3D viewer.
        estimate: Path of the ball that shows the estimated source position.
    """
    scenario = look.result.scenario
    robot = scenario.only.robot
    width = BODY_WIDTH_FRACTION * robot.width_m
    body = Box(robot.length_m, width, ROBOT_HEIGHT_M - 0.04)
    middle = 0.5 * ROBOT_HEIGHT_M + 0.02
    _put(meshcat, f"{path}/body", body, _colour(look.colour), 0.0, 0.0, middle)
    for side, y in (("left", 0.5), ("right", -0.5)):
        place = y * robot.wheel_separation_m
        _add_wheel(meshcat, scenario, f"{path}/{side}", place)
    if not scenario.only.has_goal:
        _add_microphones(meshcat, scenario, path)
    elif scenario.only.kind == "router":
        _add_goal(meshcat, scenario.router.route.goal_m, look.colour, path)
    for sensor in logged_sensors(look.result):
        _add_cone(meshcat, scenario, f"{path}/cone_{sensor + 1}", sensor)
    if scenario.only.loudspeaker is not None:
        _add_loudspeaker(meshcat, path, ROBOT_HEIGHT_M, look.colour)
    if scenario.only.searches is None:
        meshcat.SetObject(estimate, Sphere(0.06), _colour(look.estimates))


def _add_wheel(meshcat: Meshcat, scenario: Scenario, path: str, y: float) -> None:
    """Adds a wheel with a visible spoke; its axle is the z axis of ``wheel``."""
    radius = scenario.only.robot.wheel_radius_m
    meshcat.SetTransform(path, _placed(-0.5 * math.pi, 0.0, 0.0, [0.0, y, radius]))
    tyre = Cylinder(radius, WHEEL_WIDTH_M)
    meshcat.SetObject(f"{path}/wheel/tyre", tyre, Rgba(0.12, 0.12, 0.12))
    spoke = Box(1.7 * radius, 0.25 * radius, WHEEL_WIDTH_M + 0.004)
    meshcat.SetObject(f"{path}/wheel/spoke", spoke, Rgba(0.95, 0.95, 0.95))


def _add_goal(
    meshcat: Meshcat, goal: tuple[float, float], colour: str, robot: str
) -> None:
    """Adds a flat disc on the floor at the goal of the control point P."""
    disc = Cylinder(0.08, 0.01)
    _put(meshcat, f"goals/{robot}", disc, _colour(colour, 0.6), *goal, 0.006)


def _add_microphones(meshcat: Meshcat, scenario: Scenario, path: str) -> None:
    robot = scenario.only.robot
    bar, grey = Box(0.02, robot.width_m, 0.02), Rgba(0.35, 0.35, 0.38)
    x, height = robot.control_point_m - 0.01, MICROPHONE_HEIGHT_M
    _put(meshcat, f"{path}/bar", bar, grey, x, 0.0, height - 0.03)
    mast = Cylinder(0.012, height - ROBOT_HEIGHT_M)
    middle = 0.5 * (height + ROBOT_HEIGHT_M) - 0.02
    _put(meshcat, f"{path}/mast", mast, grey, x, 0.0, middle)
    ball, black = Sphere(0.028), Rgba(0.05, 0.05, 0.05)
    for number, place in enumerate(microphones_B(robot), start=1):
        _put(meshcat, f"{path}/microphone_{number}", ball, black, *place, height)


def _add_cone(meshcat: Meshcat, scenario: Scenario, path: str, sensor: int) -> None:
    """Adds two cones for a range sensor: one for an echo, and one for no echo.

    The two cones have different colors. The recording shows one of them at a time. Both
    cones are only 0.8 m long. A cone of 3 m, the full range, would hide the scene.
    """
    x, y, axis = sensor_pose(scenario, sensor)
    # The axis of Meshcat's cone is z. The rotations tilt the cone forward, and then
    # turn it to the axis of the sensor.
    tilted = _placed(0.0, 0.5 * math.pi, axis, [x, y, SENSOR_HEIGHT_M])
    meshcat.SetTransform(path, tilted)
    length = 0.8
    radius = length * math.tan(scenario.sensing.ultrasonic.half_angles[sensor])
    for look, role, alpha in (("echo", "echo", 0.55), ("empty", "empty", 0.18)):
        cone = MeshcatCone(length, 0.35 * radius, radius)
        meshcat.SetObject(f"{path}/{look}", cone, _colour(role, alpha))


def add_gain_bar(meshcat: Meshcat, path: str, aside: float, colour: str) -> None:
    """Adds a bar of 1 m height on the back of a robot. The replay scales its height.

    Args:
        meshcat: Scene of the replay.
        path: Path of the bar in the scene tree of the 3D viewer, below the robot.
        aside: Distance of the bar to the left of the robot's center line, m.
        colour: Color of the bar, as a key of ``COLOURS``.
    """
    _put(meshcat, f"{path}/bar", Box(0.03, 0.03, 1.0), _colour(colour), 0.0, 0.0, 0.5)
    meshcat.SetTransform(path, upright(0.0, aside, ROBOT_HEIGHT_M))


def add_source(
    meshcat: Meshcat, source: SourceParameters, path: str, role: str = "source"
) -> None:
    """Adds a source with its body, its loudspeaker and its rings.

    The source is at the origin of its frame S.

    Args:
        meshcat: Scene of the replay.
        source: Parameters of the source, such as its size.
        path: Path of the source in the scene tree of the 3D viewer.
        role: Key of the color in ``COLOURS``: ``source``, or ``interferer`` if no robot
            follows the source.
    """
    if source.body:
        body = Box(source.length_m, source.width_m, SOURCE_HEIGHT_M)
        middle = 0.5 * SOURCE_HEIGHT_M
        _put(meshcat, f"{path}/body", body, _colour(role), 0.0, 0.0, middle)
    else:
        pole = Cylinder(0.02, SOURCE_HEIGHT_M)
        _put(
            meshcat,
            f"{path}/pole",
            pole,
            _colour(role),
            0.0,
            0.0,
            0.5 * SOURCE_HEIGHT_M,
        )
    _add_loudspeaker(meshcat, path, SOURCE_HEIGHT_M, COLOURS[role])


def _add_loudspeaker(meshcat: Meshcat, path: str, height: float, colour: str) -> None:
    """Adds a loudspeaker at a height, m, and rings in the color of its body."""
    horn = Cylinder(0.07, 0.06)
    dark, above = Rgba(0.15, 0.15, 0.15), height + 0.03
    _put(meshcat, f"{path}/loudspeaker", horn, dark, 0.0, 0.0, above)
    turns = np.linspace(0.0, 2.0 * math.pi, 73)
    for number, radius in enumerate(RINGS, start=1):
        circle = radius * np.column_stack([np.cos(turns), np.sin(turns)])
        ring = f"{path}/ring_{number}"
        _ribbon(meshcat, ring, circle, _colour(colour), height, 0.03)


def add_obstacles(meshcat: Meshcat, scenario: Scenario) -> None:
    """Adds all obstacles at their initial poses.

    Args:
        meshcat: Scene of the replay.
        scenario: Scenario that contains the obstacles.
    """
    for obstacle in scenario.obstacles:
        path, height = f"obstacles/{obstacle.name}", OBSTACLE_HEIGHT_M
        x, y, theta = obstacle.path().pose(0.0)
        box = Box(*obstacle.size_m, height)
        _put(meshcat, path, box, _colour("obstacle"), x, y, 0.5 * height, theta)


def add_hit(meshcat: Meshcat, scenario: Scenario, name: str) -> str | None:
    """Adds a red box around an obstacle that the robot touched.

    Args:
        meshcat: Scene of the replay.
        scenario: Scenario that contains the obstacles.
        name: Name of the touched object.

    Returns:
        Path of the red box in the scene tree of the 3D viewer. The value is None if the
        touched object is not an obstacle.
    """
    for obstacle in scenario.obstacles:
        if obstacle.name == name:
            path = f"obstacles/{name}/hit"
            length, width = obstacle.size_m
            box = Box(length + 0.01, width + 0.01, OBSTACLE_HEIGHT_M + 0.01)
            meshcat.SetObject(path, box, _colour("hit"))
            return path
    return None


def add_star(
    meshcat: Meshcat, path: str, place: ArrayLike, *, radius: float = 0.16
) -> None:
    """Adds the outline of a star above a point. Objects below the star stay visible.

    Args:
        meshcat: Scene of the replay.
        path: Path of the star in the scene tree of the 3D viewer.
        place: (2,) position of the point in the world frame W, m.
        radius: Distance from the center of the star to its tips, m.
    """
    turns = np.pi * (0.5 + np.arange(11) / 5.0)
    reach = radius * np.where(np.arange(11) % 2, 0.45, 1.0)[:, None]
    points = np.asarray(place) + reach * np.column_stack([np.cos(turns), np.sin(turns)])
    height = OBSTACLE_HEIGHT_M + 0.05
    _ribbon(meshcat, path, points, Rgba(0.0, 0.0, 0.0), height, 0.035)


def add_room(meshcat: Meshcat, scenario: Scenario) -> None:
    """Adds the walls of the room. They are low, so that they do not hide the robots.

    Args:
        meshcat: Scene of the replay.
        scenario: Scenario with or without a room.
    """
    if scenario.room is None:
        return
    (x, y), (wide, deep, _) = scenario.room.corner, scenario.room.size_m
    thick, height = 0.06, 0.25
    for number, (size_x, size_y, at_x, at_y) in enumerate(
        (
            (wide + 2.0 * thick, thick, x + wide / 2.0, y - thick / 2.0),
            (wide + 2.0 * thick, thick, x + wide / 2.0, y + deep + thick / 2.0),
            (thick, deep, x - thick / 2.0, y + deep / 2.0),
            (thick, deep, x + wide + thick / 2.0, y + deep / 2.0),
        )
    ):
        wall = Box(size_x, size_y, height)
        path = f"room/wall_{number}"
        _put(meshcat, path, wall, _colour("wall"), at_x, at_y, 0.5 * height)


def add_trail(
    meshcat: Meshcat,
    path: str,
    points: NDArray[np.float64],
    colour: str,
    *,
    thin: bool = False,
) -> None:
    """Adds one piece of a trail on the floor.

    Args:
        meshcat: Scene of the replay.
        path: Path of the piece in the scene tree of the 3D viewer.
        points: (n, 2) points of the trail in the world frame W, m.
        colour: Color of the trail: a color of matplotlib, or a key of ``COLOURS``.
        thin: Whether the trail is narrow and lies below other trails.
    """
    height, width = (0.005, 0.015) if thin else (0.008, 0.03)
    _ribbon(meshcat, path, points, _colour(colour), height, width)


def add_floor_part(
    meshcat: Meshcat,
    path: str,
    rectangles: NDArray[np.float64],
    colour: str,
    height: float,
) -> None:
    """Adds rectangles of one color to the floor, as one mesh of triangles.

    Args:
        meshcat: Scene of the replay.
        path: Path of the mesh in the scene tree of the 3D viewer.
        rectangles: (m, 4) rectangles in the world frame W: least x, greatest x, least
            y, greatest y, m.
        colour: Color of the rectangles: a color of matplotlib, or a key of ``COLOURS``.
        height: Height above the floor, m.
    """
    x_low, x_high, y_low, y_high = np.asarray(rectangles, dtype=float).T
    x = np.column_stack([x_low, x_high, x_high, x_low]).ravel()
    y = np.column_stack([y_low, y_low, y_high, y_high]).ravel()
    vertices = np.vstack([x, y, np.full(len(x), height)])
    first = 4 * np.arange(len(x_low))
    faces = np.hstack([[first, first + 1, first + 2], [first, first + 2, first + 3]])
    triangles = _plain(faces.astype(np.int32))
    meshcat.SetTriangleMesh(path, _plain(vertices), triangles, _colour(colour))


def add_disc_edge(meshcat: Meshcat, path: str, radius: float, colour: str) -> None:
    """Adds a circle around the origin, on the floor.

    Args:
        meshcat: Scene of the replay.
        path: Path of the circle in the scene tree of the 3D viewer.
        radius: Radius of the circle, m.
        colour: Color of the circle: a color of matplotlib, or a key of ``COLOURS``.
    """
    turns = np.linspace(0.0, 2.0 * math.pi, 73)
    circle = radius * np.column_stack([np.cos(turns), np.sin(turns)])
    _ribbon(meshcat, path, circle, _colour(colour), 0.012, 0.03)


def set_stage(meshcat: Meshcat) -> None:
    """Sets even light and a plain background. The page of the replay chooses the view.

    Args:
        meshcat: Scene of the replay.
    """
    lamps = ("SpotLight", "PointLightNegativeX", "PointLightPositiveX")
    for path in ("/Grid", "/Axes", *(f"/Lights/{lamp}" for lamp in lamps)):
        meshcat.SetProperty(path, "visible", value=False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 2.6)
    meshcat.SetProperty("/Lights/FillLight/<object>", "intensity", 1.2)
    for end in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background/<object>", end, [0.86, 0.89, 0.92])
