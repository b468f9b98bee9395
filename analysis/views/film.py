"""Draws the frames of a movie: the scene of a run at one time, from above."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, Polygon, Rectangle, Wedge
from numpy.typing import NDArray

from analysis.report.palette import COLORS, draw_grid
from analysis.report.shape_patch import shape_patch
from analysis.views.framing import run_title, tick_at
from analysis.views.picture import map_axes
from analysis.views.scene import (
    Cone,
    Contact,
    Estimate,
    Goal,
    Obstacle,
    Plume,
    Rings,
    RobotBody,
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

#: Resolution of the frames, dots per inch. The frames are 8 inches wide.
DPI = 90
#: Rings around a source while it sounds. ``RING_S``: time between two rings, s.
#: ``RING_M_S``: growth of the radius, m/s; sound is about a hundred times faster.
#: ``RING_M``: largest radius, m.
RING_S, RING_M_S, RING_M = 0.15, 3.0, 1.5
#: Kinds of shapes in the order of drawing.
_ORDER = (
    *(Walls, Plume, Goal, Obstacle, Trail, SourceBody, Rings),
    *(Cone, RobotBody, Estimate, Touched, Contact),
)

#: Kinds of shapes in the legend.
_NAMED = RobotBody, SourceBody, Obstacle, Estimate, Plume
#: Styles of the shapes that are drawn as a marker at their position.
_MARKS: dict[type, dict[str, Any]] = {
    Plume: {"marker": "*", "ms": 11},
    Goal: {"marker": "*", "ms": 11},
    Estimate: {"marker": "x", "ms": 9, "mew": 2.2},
    Contact: {"marker": "*", "ms": 19, "mew": 1.4, "mfc": "none"},
}


class RunFrames:
    """Draws frames that show a run from above at any time of the run.

    Frames and ``plot_trajectory`` show the same part of the floor in the same colors.
    """

    def __init__(self, result: RunResult) -> None:
        self._result, scene = result, make_scene(result)
        figure, self._axes = map_axes(result)
        figure.set_dpi(DPI)
        self._canvas = FigureCanvasAgg(figure)
        draw_grid(self._axes)
        self._axes.set_title(run_title(result), fontsize=11, wrap=True)
        samples = [
            Polygon(np.zeros((1, 2)), color=layer.colors[0], label=layer.label)
            for layer in scene.layers
            if isinstance(layer.things[0].shape, _NAMED)
        ]
        figure.legend(
            handles=samples, loc="lower center", ncols=4, fontsize=8.5, frameon=False
        )
        self._axes.set_autoscale_on(False)
        things = sorted(
            (thing for thing in scene.things if isinstance(thing.shape, _ORDER)),
            key=lambda thing: _ORDER.index(type(thing.shape)),
        )
        fixed = Walls, Plume, Goal, Obstacle
        self._moving = [
            each for each in things if each.moves or not isinstance(each.shape, fixed)
        ]
        for thing in things:
            if thing not in self._moving:
                for artist in self._artists(thing, 0.0):
                    self._axes.add_artist(artist)
        self._canvas.draw()
        self._rest = self._canvas.copy_from_bbox(figure.bbox)

    def frames(self, frames_per_s: float) -> Iterator[NDArray[np.uint8]]:
        """Yields the frames of a movie. The last frame shows the end of the run.

        Each frame has the shape (rows, columns, 3): red, green and blue, 0 to 255.
        """
        count = max(1, round(self._result.simulated_s * frames_per_s))
        for number in range(count):
            yield self.frame(min((number + 1) / frames_per_s, self._result.simulated_s))

    def frame(self, time: float) -> NDArray[np.uint8]:
        """Returns the frame at a time, s, in the format of ``frames``."""
        self._canvas.restore_region(self._rest)
        clock = self._axes.text(
            0.99,
            0.98,
            f"{time:.1f} s",
            transform=self._axes.transAxes,
            ha="right",
            va="top",
            fontsize=12,
        )
        artists = [a for thing in self._moving for a in self._artists(thing, time)]
        for artist in (*artists, clock):
            self._axes.draw_artist(artist)
            artist.remove()
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def _artists(self, thing: Thing, time: float) -> list[Any]:
        """Adds a thing at a time, s, to the axes, and returns its artists."""
        tick = tick_at(self._result, time)
        if not thing.visible(tick):
            return []
        add, plot, color = self._axes.add_patch, self._axes.plot, thing.color
        pose = thing.pose(tick)
        x, y, theta = pose

        def body(shape: Shape, alpha: float | None = None) -> Artist:
            return add(shape_patch(shape, pose, color=color, alpha=alpha))

        found: list[Any] = []
        match thing.shape:
            case Walls(corner, (wide, deep, _)):
                walls = Rectangle(corner, wide, deep, fill=False, ec=color, lw=4.0)
                found = [add(walls)]
            case Obstacle(shape) | Touched(shape):
                found = [body(shape)]
            case Trail(line):
                way = thing.poses[: tick + 1, :2].T
                found = plot(*way, line, color=color, lw=1.6 if line == "-" else 1.0)
            case SourceBody(length, width, is_body=True):
                found = [body(box((length, width)), 0.6)]
            case SourceBody():
                found = plot(x, y, "D", color=color, ms=6)
            case Rings(bursts):
                found = [add(each) for each in circles((x, y), bursts, time, color)]
            case Cone(half_angle, reach, echo):
                axis, half = math.degrees(theta), math.degrees(half_angle)
                tint = to_rgb(COLORS["echo" if echo[tick] else "empty"])
                ends = axis - half, axis + half
                found = [add(Wedge((x, y), reach[tick], *ends, fc=(*tint, 0.2)))]
            case RobotBody(own, hears):
                found = [body(box((own.length_m, own.width_m)), 0.55)]
                if hears:
                    bar = microphones_W(pose, own).T
                    found += plot(*bar, "-o", color=color, ms=3.2, lw=2.0)
            case mark:
                found = plot(x, y, color=color, ls="none", **_MARKS[type(mark)])
        return found


def circles(
    center: tuple[float, float],
    bursts: list[tuple[float, float]],
    time: float,
    color: str,
) -> Iterator[Circle]:
    """Yields the rings around a loudspeaker that are visible at a time, s.

    During a burst, a new ring leaves the loudspeaker every ``RING_S``. Each ring grows
    and fades. ``center`` is the position of the loudspeaker in W, m. Each burst has a
    start and an end, s.
    """
    for start, end in bursts:
        for left in np.arange(0.0, min(time, end) - start, RING_S):
            radius = RING_M_S * (time - start - left)
            if radius < RING_M:
                fade = 1.0 - radius / RING_M
                yield Circle(center, radius, fill=False, ec=color, lw=1.8, alpha=fade)
