"""Draws the runs of one scenario under several laws in one picture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from analysis.report.body_labels import BodyLabel, spread_labels
from analysis.report.palette import COLORS, ROBOT_COLORS, draw_grid
from analysis.report.shape_patch import shape_patch
from analysis.views.framing import picture_times, tick_at
from analysis.views.picture import draw_scene, map_axes
from analysis.views.scene import (
    Contact,
    Goal,
    Obstacle,
    Scene,
    SourceBody,
    Thing,
    Touched,
    Trail,
    Walls,
    make_scene,
)
from diagrams import RunResult
from systems.world.shapes import box

#: Styles of the paths, one after another for each round of the colors.
_LINES = ("-", "--", "-.", ":")
#: Largest number of times that are marked on a path.
_MOST_TIMES = 6
#: Number of columns of the legend, and the height of one of its rows, inch.
_COLUMNS, _ROW_IN = 2, 0.19


def plot_laws(results: Mapping[str, RunResult]) -> Figure:
    """Draws the paths of the robots under several laws from above, in W, m.

    Dots mark the same times on all paths. Robots are drawn at their ends. The legend
    states how each run ended.

    Args:
        results: Results of one scenario by law, at least one.

    Returns:
        The figure.
    """
    runs = [*results.values()]
    longest = max(runs, key=lambda run: run.simulated_s)
    scene = make_scene(longest)
    rows = math.ceil((len(runs) + 4) / _COLUMNS)
    figure, axes = map_axes(*runs, below_in=0.6 + _ROW_IN * rows)
    draw_grid(axes)
    scenario = longest.full_scenario
    axes.set_title(
        f"{scenario.name}, seed {scenario.seed}, under {len(runs)} laws", fontsize=11
    )
    things = [
        thing
        for thing in scene.things
        if isinstance(thing.shape, Obstacle | Walls | SourceBody | Goal)
        or (isinstance(thing.shape, Trail) and thing.shape.line == "--")
    ]
    _draw(axes, scene, things)
    times = picture_times(longest, most=_MOST_TIMES)
    for number, ((law, result), color) in enumerate(
        zip(results.items(), cycle(ROBOT_COLORS), strict=False)
    ):
        _draw_contacts(axes, result, color)
        label = f"{law}: {_outcome(result)}"
        line = _LINES[number // len(ROBOT_COLORS) % len(_LINES)]
        _draw_paths(axes, result, label, color, line)
        _mark_times(axes, result, times, color)
        ends = [(-1, color, "")]
        if not number:
            ends.append((0, COLORS["obstacle"], "start"))
        for tick, tint, text in ends:
            _draw_robots(axes, result, tick, tint, text)
    spread_labels(axes)
    handles, labels = axes.get_legend_handles_labels()
    shown_once = dict(zip(labels, handles, strict=True))
    first = [name for name in shown_once if name.split(":")[0] in results]
    names = [*first, *(name for name in shown_once if name not in first)]
    figure.legend(
        [shown_once[name] for name in names],
        names,
        loc="lower center",
        ncols=_COLUMNS,
        fontsize=8.5,
        frameon=False,
    )
    return figure


def _outcome(result: RunResult) -> str:
    fault = f" ({result.collision.fault}'s fault)" if result.collision else ""
    return f"{result.ending}{fault} after {result.simulated_s:.1f} s"


def _draw(axes: Axes, scene: Scene, things: list[Thing]) -> None:
    layer = scene.layers[0]._replace(things=things)
    draw_scene(axes, Scene(scene.result, scene.bodies, [layer]), ends_only=True)


def _draw_contacts(axes: Axes, result: RunResult, color: str) -> None:
    scene = make_scene(result)
    things = [
        replace(thing, color=color) if isinstance(thing.shape, Contact) else thing
        for thing in scene.things
        if isinstance(thing.shape, Touched | Contact)
    ]
    _draw(axes, scene, things)


def _draw_paths(
    axes: Axes, result: RunResult, label: str, color: str, line: str
) -> None:
    for own in result.robots.values():
        axes.plot(
            *own.vector("p_WP"), line, color=color, linewidth=1.8, label=label, zorder=4
        )


def _mark_times(axes: Axes, result: RunResult, times: np.ndarray, color: str) -> None:
    """Draws a dot with the time on each path at each of the times of the run, s."""
    for own in result.robots.values():
        for time in times[(times > 0.0) & (times < own.simulated_s)]:
            tick = tick_at(own, time)
            place = own.vector("p_WP")[:, tick]
            axes.plot(*place, "o", color=color, markersize=4, zorder=5)
            small = [*place, own.poses("WB")[tick, 2], 0.05, 0.05]
            axes.add_artist(BodyLabel(f"{time:g} s", small, color))


def _draw_robots(
    axes: Axes, result: RunResult, tick: int, color: str, text: str
) -> None:
    """Draws the outlines of the robots at a tick, with a text beside them."""
    for body in _bodies(result, tick):
        axes.add_patch(
            shape_patch(
                box((float(body[3]), float(body[4]))),
                body[:3],
                facecolor=(*to_rgb(color), 0.10),
                edgecolor=color,
                gid="robot",
                zorder=3,
            )
        )
        if text:
            axes.add_artist(BodyLabel(text, body, color))


def _bodies(result: RunResult, tick: int) -> Iterator[np.ndarray]:
    for own in result.robots.values():
        size = own.scenario.only.robot
        yield np.array([*own.poses("WB")[tick], size.length_m, size.width_m])
