"""Draws the parts of the picture that shows a run from above."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.patches import Polygon, Rectangle, Wedge
from numpy.typing import ArrayLike, NDArray

from analysis.reporting.body_labels import BodyLabel
from analysis.reporting.palette import COLOURS, faintest
from analysis.runs.known_space import KnownSpace
from analysis.views.scene import (
    Look,
    compose,
    contact_point,
    followed_sources,
    logged_sensors,
    moving_and_static,
    picture_times,
    sensor_pose,
    tick_at,
)
from diagrams import RunResult
from diagrams.scenario.bodies import microphones_W, robot_rectangle
from diagrams.scenario.participants import SourceParameters
from systems.world.geometry import rectangle_corners

#: Least distance that a robot or a source moves between two drawn times, m. For
#: obstacles, half of this distance applies.
APART_M = 0.25
#: Largest number of times at which the cones are drawn.
CONE_INSTANTS = 4


def times_apart(result: RunResult) -> list[float]:
    """Returns the times at which a picture shows the outline of the robot.

    Between two of these times, the robot moves by at least 0.25 m. The last time is the
    end of the run, even if the robot has moved less.

    Args:
        result: Result of a run, for one robot.

    Returns:
        Ascending times, s.
    """
    path, end = result.poses("WB"), result.simulated_s
    kept: list[float] = []
    for time in picture_times(result):
        if not kept or _apart(result, path, kept[-1], time):
            kept.append(float(time))
    if len(kept) > 1 and not _apart(result, path, kept[-1], end):
        kept.pop()
    return [*kept, end] if end > kept[-1] else kept


def _apart(
    result: RunResult, path: NDArray[np.float64], first: float, second: float
) -> bool:
    step = path[tick_at(result, second)] - path[tick_at(result, first)]
    return bool(np.linalg.norm(step[:2]) >= APART_M)


def draw_robot(axes: Axes, look: Look, times: list[float]) -> None:
    """Draws the path of the control point P, and the robot's outline at several times.

    Args:
        axes: Axes in the world frame W, m.
        look: Run, colors and labels of the robot.
        times: Times of the outlines, s.
    """
    result, colour, scenario = look.result, look.colour, look.result.scenario
    axes.plot(
        *result.vector("p_WP"),
        color=colour,
        linewidth=1.8,
        label=look.path_label,
        zorder=4,
    )
    if scenario.only.kind == "router":
        _draw_target(axes, look)
    for index, time in enumerate(times):
        pose = result.poses("WB")[tick_at(result, time)]
        _draw_body(
            axes,
            robot_rectangle(pose, scenario.only.robot),
            gid=f"robot at {time:g}",
            facecolor=(*to_rgb(colour), 0.10),
            edgecolor=colour,
            linewidth=1.0,
            label=(look.body_label or None) if index == 0 else None,
            zorder=3,
        )
        if scenario.only.kind != "router" and scenario.only.searches != "odor":
            bar = microphones_W(pose, scenario.only.robot).T
            axes.plot(*bar, "-o", color=colour, markersize=3.2, linewidth=2.0, zorder=5)
        _write_time(axes, robot_rectangle(pose, scenario.only.robot), time, colour)


def _draw_target(axes: Axes, look: Look) -> None:
    """Draws the path of the target on the route, and the goal."""
    several = look.result.whole is not None
    axes.plot(
        *look.result.vector("target"),
        ":",
        color=look.colour,
        linewidth=1.2,
        label="paths of the targets" if several else "path of the target",
        zorder=3.5,
    )
    axes.plot(
        *look.result.scenario.router.route.goal_m,
        "*",
        color=look.colour,
        markersize=11,
        linestyle="none",
        label="goals" if several else "goal",
        zorder=5,
    )


def _draw_body(axes: Axes, rectangle: ArrayLike, **style: Any) -> None:
    axes.add_patch(Polygon(rectangle_corners(rectangle), **style))


def _write_time(axes: Axes, rectangle: ArrayLike, time: float, colour: str) -> None:
    """Writes the time beside a body, on its right until all labels are moved apart."""
    axes.add_artist(BodyLabel(f"{round(time, 1):g} s", rectangle, colour))


def draw_sources(axes: Axes, result: RunResult, times: list[float]) -> None:
    """Draws each source: its path, its body at both ends of the path, and several dots.

    The dots show the position of the source at the given times. For a moving source,
    labels show the times.

    Args:
        axes: Axes in the world frame W, m.
        result: Result of the run.
        times: Times of the dots, s.
    """
    sources = result.full_scenario.sources
    followed = followed_sources(result.full_scenario)
    for name, source in sources.items():
        what = "the source" if len(sources) == 1 else name
        if name not in followed:
            what = f"{name} (not followed)"
        role = "source" if name in followed else "interferer"
        _draw_source(axes, result, (what, COLOURS[role]), source, times)


def _draw_source(
    axes: Axes,
    result: RunResult,
    named: tuple[str, str],
    source: SourceParameters,
    times: list[float],
) -> None:
    (what, colour), path = named, source.path().poses(result.time)
    moves = bool(np.ptp(path[:, :2], axis=0).any())
    if moves:
        label = f"path of {what}"
        axes.plot(*path[:, :2].T, "--", color=colour, label=label, zorder=3)
    if not source.body:
        # This source is a loudspeaker without a body, so no robot can touch it.
        place = path[-1, :2]
        axes.plot(*place, "D", color=colour, label=what, ls="none", ms=6, zorder=4)
        return
    seen = "first and last" if moves else "at rest"
    for index in (0, len(path) - 1) if moves else (0,):
        _draw_body(
            axes,
            [*path[index], source.length_m, source.width_m],
            gid="source",
            facecolor=(*to_rgb(colour), 0.25 if index == 0 else 0.6),
            edgecolor=colour,
            label=f"{what.removeprefix('the ')}, {seen}" if not index else None,
            zorder=2.5,
        )
    last = -math.inf
    for time in times:
        if math.isfinite(last) and not _apart(result, path, last, time):
            continue
        last = time
        pose = path[tick_at(result, time)]
        axes.plot(*pose[:2], "o", color=colour, markersize=4, zorder=4)
        if moves:
            body = [*pose, source.length_m, source.width_m]
            _write_time(axes, body, time, colour)


def draw_estimates(axes: Axes, look: Look) -> None:
    """Draws the estimated source position for each audio frame that the robot heard.

    Each estimate is a cross. Early estimates are faint.

    Args:
        axes: Axes in the world frame W, m.
        look: Run, colors and labels of the robot.
    """
    result, columns = look.result, look.result.columns
    if "target_valid" not in columns or "detected" not in columns:
        return
    # The target uses an estimate from the next tick on.
    heard = (columns["detected"][:-1] > 0.5) & (columns["target_valid"][1:] > 0.5)
    if not heard.any():
        return
    colour = look.estimates
    part = result.time[1:][heard] / max(result.simulated_s, 1e-9)
    least = faintest(colour)
    colours = [(*to_rgb(colour), least + (1.0 - least) * p) for p in part]
    x, y = result.vector("p_WS_estimated")[:, 1:][:, heard]
    axes.scatter(
        x,
        y,
        c=colours,
        marker="x",
        s=16,
        linewidths=0.9,
        zorder=6,
    )
    # Without this empty plot, the sample in the legend would be as faint as the first
    # estimate.
    axes.scatter([], [], color=colour, marker="x", s=16, label=look.estimates_label)


def draw_known_space(axes: Axes, look: Look, known: KnownSpace) -> None:
    """Draws the floor that a robot knew to be free at the end of the run.

    Dots show positions from which echoes came.

    Args:
        axes: Axes in the frame of the odometry, m.
        look: Colors and labels of the robot.
        known: Map of the floor that this robot knew.
    """
    free, echoed = known.free[-1], known.middles(known.hits[-1] > 0.0)
    # The color is transparent, because other objects and other robots' floors overlap.
    colour = to_rgba(look.seen, 0.13)
    layer = np.zeros((*free.T.shape, 4))
    layer[free.T] = colour
    limits = axes.axis()
    axes.imshow(
        layer,
        origin="lower",
        extent=known.extent,
        interpolation="nearest",
        zorder=0.3,
    ).set_gid("seen free")
    # ``imshow`` changes the limits of the axes. This call restores them.
    axes.axis(limits)
    axes.scatter(
        [],
        [],
        facecolor=colour,
        edgecolor="none",
        marker="s",
        s=60,
        label=look.seen_label,
    )
    if len(echoed):
        axes.plot(
            *echoed.T,
            ".",
            color=look.echoes,
            markersize=2.5,
            label=look.echoes_label,
            zorder=1.8,
        )


def draw_obstacles(axes: Axes, result: RunResult) -> None:
    """Draws obstacles at rest as filled boxes, and moving obstacles as outlines.

    Labels beside the outlines show the time.

    Args:
        axes: Axes in the world frame W, m.
        result: Result of the run.
    """
    colour = COLOURS["obstacle"]
    moving, static = moving_and_static(result.full_scenario)
    for index, obstacle in enumerate(static):
        body = [*obstacle.path().pose(0.0), *obstacle.size_m]
        label = "obstacle at rest" if index == 0 else None
        gid = f"obstacle {obstacle.name}"
        _draw_body(axes, body, gid=gid, color=colour, label=label, zorder=3.5)
    for index, obstacle in enumerate(moving):
        path, last = obstacle.path(), None
        for time in picture_times(result):
            pose = np.array(path.pose(time))
            if last is not None and np.linalg.norm(pose - last) < 0.5 * APART_M:
                continue
            last = pose
            _draw_body(
                axes,
                [*pose, *obstacle.size_m],
                gid=f"obstacle {obstacle.name} at {time:g}",
                fill=False,
                edgecolor=colour,
                linewidth=1.1,
                label="moving obstacle" if index == 0 and time == 0.0 else None,
                zorder=3.5,
            )
            _write_time(axes, [*pose, *obstacle.size_m], time, colour)


def draw_cones(axes: Axes, result: RunResult, times: list[float]) -> None:
    """Draws the cones of the range sensors at several times, up to the range readings.

    Args:
        axes: Axes in the world frame W, m.
        result: Result of a run, for one robot.
        times: Times, s. If there are many times, the function uses only some of them.
    """
    sensors = logged_sensors(result)
    if not sensors:
        return
    step = max(1, math.ceil(len(times) / CONE_INSTANTS))
    half_angles = result.scenario.sensing.ultrasonic.half_angles
    labelled: set[bool] = set()
    for time in times[::step]:
        tick = tick_at(result, time)
        for sensor in sensors:
            echo = bool(result.columns[f"echo_{sensor + 1}"][tick] > 0.5)
            colour = to_rgb(COLOURS["echo" if echo else "empty"])
            pose = result.poses("WB")[tick]
            x, y, theta = compose(pose, sensor_pose(result.scenario, sensor))
            axis = math.degrees(theta)
            half = math.degrees(half_angles[sensor])
            wedge = Wedge(
                (x, y),
                result.columns[f"range_{sensor + 1}"][tick],
                axis - half,
                axis + half,
                facecolor=(*colour, 0.2 if echo else 0.07),
                edgecolor=colour,
                linewidth=0.5,
                label=None if echo in labelled else _CONE_LABELS[echo],
                zorder=1.5,
            )
            labelled.add(echo)
            axes.add_patch(wedge)


_CONE_LABELS = {True: "ultrasonic cone with an echo", False: "cone without an echo"}


def draw_room(axes: Axes, result: RunResult) -> None:
    """Draws the walls of the room, if the scenario has a room.

    Args:
        axes: Axes in the world frame W, m.
        result: Result of the run.
    """
    room = result.full_scenario.room
    if room is None:
        return
    axes.add_patch(
        Rectangle(
            (float(room.corner[0]), float(room.corner[1])),
            *room.size_m[:2],
            gid="room",
            fill=False,
            edgecolor=COLOURS["wall"],
            linewidth=4.0,
            label="walls of the room",
            zorder=1.2,
        )
    )


def draw_collision(axes: Axes, result: RunResult, star: float = 19.0) -> None:
    """Draws the touched body at the time of the collision, and the contact point.

    A star marks the contact point. The star is only an outline, so that it does not
    hide the bodies.

    Args:
        axes: Axes in the world frame W, m.
        result: Result of the run.
        star: Size of the star, in points.
    """
    if result.collision is None:
        return
    own, hit = result.robots[result.name], result.collision
    _draw_body(
        axes,
        own.surroundings.bodies[hit.object].rectangle(hit.time),
        gid="hit",
        facecolor=COLOURS["hit"],
        edgecolor="white",
        linewidth=0.8,
        label=f"{hit.object}, which was touched",
        zorder=8,
    )
    axes.plot(
        *contact_point(result),
        "*",
        markerfacecolor="none",
        markeredgecolor="black",
        markeredgewidth=1.4 if star > 12.0 else 0.9,
        markersize=star,
        label="where they touched",
        linestyle="none",
        zorder=9,
    )
