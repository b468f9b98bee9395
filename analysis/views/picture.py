"""Draws the scene of a run from above."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle, Wedge
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from analysis.report.body_labels import BodyLabel, spread_labels
from analysis.report.notebook_figure import NotebookFigure
from analysis.report.palette import COLORS, draw_grid, faintest
from analysis.report.shape_patch import label_rectangle, shape_patch
from analysis.runs.known_space import known_space
from analysis.views.framing import bounds, picture_times, picture_title, tick_at
from analysis.views.plume_history import concentration_map, plume_history
from analysis.views.scene import (
    Cone,
    Contact,
    Estimate,
    Goal,
    KnownFloor,
    Obstacle,
    Plume,
    RobotBody,
    Scene,
    SourceBody,
    Thing,
    Touched,
    Trail,
    Walls,
    make_scene,
)
from diagrams import RunResult
from diagrams.scenario.bodies import microphones_W
from systems.world.shapes import Shape, box

#: Width of the pictures, inch.
WIDTH_IN = 8.0
#: Space around the map for labels, title and legend, inch.
LEFT_IN, RIGHT_IN, BELOW_IN, ABOVE_IN = 0.75, 0.15, 1.3, 0.5
#: Robots and sources are drawn at times between which they move by at least this
#: distance, m. For obstacles, half of this distance is enough.
APART_M = 0.25
#: Largest number of times at which the cones are drawn.
CONE_INSTANTS = 4


def plot_trajectory(result: RunResult) -> Figure:
    """Draws the run from above at a few times, in the world frame W.

    The picture shows the cones of the range sensors, except with ideal obstacle
    sensing. For a robot with a safety guard, the picture shows the floor that the robot
    knew at the end instead of the cones. Crosses show the source positions that the
    robot estimated. Early estimates are faint, and late estimates are strong.
    """
    figure, axes = map_axes(result)
    draw_grid(axes)
    axes.set_title(picture_title(result), fontsize=11)
    draw_scene(axes, make_scene(result))
    spread_labels(axes)
    handles, labels = axes.get_legend_handles_labels()
    shown_once = dict(zip(labels, handles, strict=True))
    figure.legend(
        shown_once.values(),
        shown_once,
        loc="lower center",
        ncols=3,
        fontsize=8.5,
        frameon=False,
    )
    return figure


def map_axes(*results: RunResult, below_in: float = BELOW_IN) -> tuple[Figure, Axes]:
    """Makes a figure with axes in W, m, that show all bodies, and space for a legend.

    The height of the space below the axes is ``below_in``, inch.

    The axes have equal scales. The height of the axes is 0.4 to 1.3 times their width;
    if necessary, they show more of the floor than the bodies need.
    """
    limits = np.array([bounds(result, margin=0.7) for result in results])
    (x_low, y_low), (x_high, y_high) = (
        limits[:, [0, 2]].min(axis=0).tolist(),
        limits[:, [1, 3]].max(axis=0).tolist(),
    )
    width = WIDTH_IN - LEFT_IN - RIGHT_IN
    tallest, flattest = 1.3 * width, 0.4 * width
    more = max((y_high - y_low) * width / tallest - (x_high - x_low), 0.0) / 2.0
    x_low, x_high = x_low - more, x_high + more
    more = max((x_high - x_low) * flattest / width - (y_high - y_low), 0.0) / 2.0
    y_low, y_high = y_low - more, y_high + more
    height = width * (y_high - y_low) / (x_high - x_low)
    total = below_in + height + ABOVE_IN
    figure = NotebookFigure(figsize=(WIDTH_IN, total))
    axes = figure.add_axes(
        (LEFT_IN / WIDTH_IN, below_in / total, width / WIDTH_IN, height / total)
    )
    axes.set(aspect="equal", xlim=(x_low, x_high), ylim=(y_low, y_high))
    axes.xaxis.set_major_locator(MaxNLocator(steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(steps=[1, 2, 5, 10]))
    axes.set(xlabel="x in W (m)", ylabel="y in W (m)")
    return figure, axes


def draw_scene(axes: Axes, scene: Scene, *, ends_only: bool = False) -> None:
    """Draws a run from above into axes in the world frame W, m.

    If ``ends_only`` is true, robots are drawn only at the start and at the end of the
    run, and everything that robots sense is left out: cones, known floor, odor, and
    estimates.
    """
    painter = _Painter(axes, scene, ends_only)
    for kind, draw in _DRAW.items():
        for thing in scene.things:
            if isinstance(thing.shape, kind) and not (ends_only and kind in _SENSED):
                draw(painter, thing, thing.shape)


@dataclass
class _Painter:
    """Draws the things of a scene, each at several times of the run."""

    axes: Axes
    scene: Scene
    ends_only: bool

    def __post_init__(self) -> None:
        self.labeled: set[str] = set()
        self.result = self.scene.result

    @cached_property
    def mapping(self) -> set[str]:
        """Names of the robots whose known floor is drawn."""
        shapes = [thing.shape for thing in self.scene.things]
        return {each.own.name for each in shapes if isinstance(each, KnownFloor)}

    def once(self, label: str) -> str | None:
        """Returns a label at its first use, and None at each later use.

        Several objects with the same label thus have only one entry in the legend.
        """
        if not label or label in self.labeled:
            return None
        self.labeled.add(label)
        return label

    def times_of(self, robot: Thing) -> list[float]:
        """Returns the times at which the picture shows the outline of a robot, s.

        Between consecutive times, the robot moves by at least 0.25 m. The last time is
        always the end of the run, even if the robot has moved less by then.
        """
        end = self.result.simulated_s
        if self.ends_only:
            return [0.0, end]
        kept = self.apart(robot, picture_times(self.result), APART_M)
        if len(kept) > 1 and self._moved(robot, kept[-1], end) < APART_M:
            kept.pop()
        return [*kept, end] if end > kept[-1] else kept

    def apart(self, thing: Thing, times: ArrayLike, least_m: float) -> list[float]:
        """Selects some of the ``times``, s, so that drawings of a thing are apart.

        The first time is always selected. Each later time is selected if the thing is
        at least ``least_m``, m, from its position at the last selected time.
        """
        kept: list[float] = []
        for time in np.asarray(times, dtype=float).tolist():
            if not kept or self._moved(thing, kept[-1], time) >= least_m:
                kept.append(time)
        return kept

    def _moved(self, thing: Thing, first: float, second: float) -> float:
        a, b = (thing.pose(tick_at(self.result, time)) for time in (first, second))
        return math.dist(a[:2], b[:2])

    def body(self, shape: Shape, pose: ArrayLike, **style: Any) -> None:
        self.axes.add_patch(shape_patch(shape, pose, **style))

    def time(self, shape: Shape, pose: ArrayLike, time: float, color: str) -> None:
        """Writes the time at the right side of a body.

        ``spread_labels`` later moves labels that overlap.
        """
        text = f"{round(time, 1):g} s"
        self.axes.add_artist(BodyLabel(text, label_rectangle(shape, pose), color))

    def cones(self, thing: Thing, shape: Cone) -> None:
        """Draws the cone of a range sensor at several times.

        At each time, the length of the cone is the range reading.
        """
        robot = thing.parent
        if robot is None or robot.name in self.mapping:
            return  # the map replaces the cones, which would hide the map
        times = self.times_of(robot)
        half = math.degrees(shape.half_angle)
        for time in times[:: max(1, math.ceil(len(times) / CONE_INSTANTS))]:
            tick = tick_at(self.result, time)
            echo = bool(shape.echo[tick])
            color = to_rgb(COLORS["echo" if echo else "empty"])
            x, y, theta = thing.pose(tick)
            axis = math.degrees(theta)
            wedge = Wedge(
                (x, y),
                shape.reach[tick],
                axis - half,
                axis + half,
                facecolor=(*color, 0.2 if echo else 0.07),
                edgecolor=color,
                linewidth=0.5,
                label=self.once(
                    "ultrasonic cone with an echo" if echo else "cone without an echo"
                ),
                zorder=1.5,
            )
            self.axes.add_patch(wedge)

    def known_floor(self, thing: Thing, shape: KnownFloor) -> None:
        """Draws the floor that a robot knew at the end, and the places of echoes."""
        known = known_space(shape.own, shape.own.simulated_s)
        if known is None:
            return
        free, echoed = known.free[-1], known.middles(known.hits[-1] > 0.0)
        # The color is transparent, because other objects and floors overlap.
        color = to_rgba(thing.color, 0.13)
        layer = np.zeros((*free.T.shape, 4))
        layer[free.T] = color
        limits = self.axes.axis()
        self.axes.imshow(
            layer,
            origin="lower",
            extent=known.extent,
            interpolation="nearest",
            zorder=0.3,
        ).set_gid("seen free")
        # ``imshow`` changes the limits of the axes. This call restores them.
        self.axes.axis(limits)
        square: dict[str, Any] = {"edgecolor": "none", "marker": "s", "s": 60}
        self.axes.scatter([], [], facecolor=color, label=thing.label, **square)
        if len(echoed):
            dots: dict[str, Any] = {"color": shape.echoes, "ms": 2.5, "zorder": 1.8}
            self.axes.plot(*echoed.T, ".", label=shape.echoes_label, **dots)

    def walls(self, thing: Thing, shape: Walls) -> None:
        self.axes.add_patch(
            Rectangle(
                shape.corner,
                *shape.size[:2],
                gid="room",
                fill=False,
                edgecolor=thing.color,
                linewidth=4.0,
                label=thing.label,
                zorder=1.2,
            )
        )

    def obstacle(self, thing: Thing, obstacle: Obstacle) -> None:
        """Draws an obstacle at rest as a filled shape, and a moving one as outlines."""
        label, color, shape = self.once(thing.label), thing.color, obstacle.shape
        gid = f"obstacle {thing.name}"
        if not thing.moves:
            style: dict[str, Any] = {"gid": gid, "color": color, "label": label}
            self.body(shape, thing.pose(0), zorder=3.5, **style)
            return
        for time in self.apart(thing, picture_times(self.result), 0.5 * APART_M):
            pose = thing.pose(tick_at(self.result, time))
            self.body(
                shape,
                pose,
                gid=f"{gid} at {time:g}",
                fill=False,
                edgecolor=color,
                linewidth=1.1,
                label=label if time == 0.0 else None,
                zorder=3.5,
            )
            self.time(shape, pose, time, color)
        if self.ends_only:
            self.body(shape, thing.pose(len(thing.times) - 1), color=color)

    def plume(self, thing: Thing, shape: Plume) -> None:
        """Draws the odor source, and its plume at the end of the run."""
        axes, color = self.axes, thing.color
        history = plume_history(shape.scenario, self.result.simulated_s)
        x = np.linspace(*axes.get_xlim(), 121)
        y = np.linspace(*axes.get_ylim(), 81)
        for last in deque(history, maxlen=1):
            dense = concentration_map(last.plume, x, y)
            levels = [0.1, 0.3, 1.0, 3.0, 1e9]
            tints = ["#F3E6EF", "#E7CCDF", "#D9AECB", "#C98BB5"]
            axes.contourf(x, y, dense, levels=levels, colors=tints, zorder=0.5)
            edge: dict[str, Any] = {"colors": color, "linewidths": 0.5, "zorder": 0.6}
            axes.contour(x, y, dense, levels=levels[:1], **edge)
            label = "odor at the end (0.1, 0.3, 1, 3 times C1)"
            axes.scatter([], [], marker="s", s=40, color="#D9AECB", label=label)
        style: dict[str, Any] = {"color": color, "ms": 12, "ls": "none"}
        axes.plot(*thing.poses[0, :2], "*", label=thing.label, **style)

    def trail(self, thing: Thing, shape: Trail) -> None:
        width, zorder = {"-": (1.8, 4), "--": (1.5, 3), ":": (1.2, 3.5)}[shape.line]
        self.axes.plot(
            *thing.poses[:, :2].T,
            shape.line,
            color=thing.color,
            linewidth=width,
            label=thing.label,
            zorder=zorder,
        )

    def source(self, thing: Thing, shape: SourceBody) -> None:
        """Draws the body of a source at both ends of its path.

        Dots show its positions in between, with the times. A source without a body is a
        single mark.
        """
        color = thing.color
        if not shape.is_body:
            style: dict[str, Any] = {"ls": "none", "ms": 6, "zorder": 4}
            place, label = thing.poses[-1, :2], thing.label
            self.axes.plot(*place, "D", color=color, label=label, **style)
            return
        body = box((shape.length, shape.width))
        ends = (0, len(thing.poses) - 1) if thing.moves else (0,)
        which = "first and last" if thing.moves else "at rest"
        for index in ends:
            self.body(
                body,
                thing.poses[index],
                gid="source",
                facecolor=(*to_rgb(color), 0.6 if index else 0.25),
                edgecolor=color,
                label=self.once(f"{thing.label.removeprefix('the ')}, {which}"),
                zorder=2.5,
            )
        times = self.times_of(next(iter(self.scene.bodies.values())))
        for time in self.apart(thing, times[-1:] if self.ends_only else times, APART_M):
            pose = thing.pose(tick_at(self.result, time))
            self.axes.plot(*pose[:2], "o", color=color, markersize=4, zorder=4)
            if thing.moves:
                self.time(body, pose, time, color)

    def estimates(self, thing: Thing, shape: Estimate) -> None:
        """Draws a cross for each new estimate. Early estimates are faint."""
        fresh, color = shape.fresh, thing.color
        if fresh is None or not fresh.any():
            return
        part = thing.times[fresh] / max(self.result.simulated_s, 1e-9)
        least = faintest(color)
        colors = [(*to_rgb(color), least + (1.0 - least) * p) for p in part]
        cross: dict[str, Any] = {"marker": "x", "s": 16}
        x, y = thing.poses[fresh, :2].T
        self.axes.scatter(x, y, c=colors, linewidths=0.9, zorder=6, **cross)
        # Without this empty plot, the sample in the legend would be as faint as the
        # first estimate.
        self.axes.scatter([], [], color=color, label=thing.label, **cross)

    def goal(self, thing: Thing, _: Goal) -> None:
        style: dict[str, Any] = {"ms": 11, "ls": "none", "zorder": 5}
        place, label = thing.poses[0, :2], thing.label
        self.axes.plot(*place, "*", color=thing.color, label=label, **style)

    def robot(self, thing: Thing, shape: RobotBody) -> None:
        """Draws the outline of a robot and its microphones at several times."""
        own, color = shape.parameters, thing.color
        for time in self.times_of(thing):
            pose = thing.pose(tick_at(self.result, time))
            body = box((own.length_m, own.width_m))
            self.body(
                body,
                pose,
                gid=f"robot at {time:g}",
                facecolor=(*to_rgb(color), 0.10),
                edgecolor=color,
                linewidth=1.0,
                label=self.once(thing.label),
                zorder=3,
            )
            if shape.hears:
                bar: dict[str, Any] = {"ms": 3.2, "lw": 2.0, "zorder": 5}
                microphones = microphones_W(pose, own).T
                self.axes.plot(*microphones, "-o", color=color, **bar)
            self.time(body, pose, time, color)

    def hit(self, thing: Thing, shape: Touched) -> None:
        """Draws the touched body where it was at the time of the collision."""
        if thing.seen is None:
            return
        tick = int(np.argmax(thing.seen))
        self.body(
            shape.shape,
            thing.pose(tick),
            gid="hit",
            facecolor=thing.color,
            edgecolor="white",
            linewidth=0.8,
            label=thing.label,
            zorder=8,
        )

    def contact(self, thing: Thing, _: Contact) -> None:
        """Draws the outline of a star, which does not hide the bodies."""
        small = self.ends_only
        self.axes.plot(
            *thing.poses[0, :2],
            "*",
            markerfacecolor="none",
            markeredgecolor=thing.color,
            markeredgewidth=0.9 if small else 1.4,
            markersize=9.0 if small else 19.0,
            label=thing.label,
            linestyle="none",
            zorder=9,
        )


#: Kinds of shapes in the order of drawing, which is the order of the legend.
_DRAW: dict[type, Callable[[_Painter, Thing, Any], None]] = {
    Cone: _Painter.cones,
    KnownFloor: _Painter.known_floor,
    Walls: _Painter.walls,
    Obstacle: _Painter.obstacle,
    Plume: _Painter.plume,
    Trail: _Painter.trail,
    SourceBody: _Painter.source,
    Estimate: _Painter.estimates,
    Goal: _Painter.goal,
    RobotBody: _Painter.robot,
    Touched: _Painter.hit,
    Contact: _Painter.contact,
}
#: Kinds of shapes that ``draw_scene`` leaves out if ``ends_only`` is true.
_SENSED = Cone, KnownFloor, Plume, Estimate
