"""Draws a run from above."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from analysis.reporting.body_labels import spread_labels
from analysis.reporting.notebook_figure import NotebookFigure
from analysis.reporting.palette import COLOURS, draw_grid
from analysis.runs.known_space import known_space
from analysis.views.plume_history import concentration_map, plume_history
from analysis.views.scene import bounds, looks, picture_title
from analysis.views.trajectory_artists import (
    draw_collision,
    draw_cones,
    draw_estimates,
    draw_known_space,
    draw_obstacles,
    draw_robot,
    draw_room,
    draw_sources,
    times_apart,
)
from diagrams import RunResult

#: Width of the pictures, inch.
WIDTH_IN = 8.0
#: Space around the map for labels, title and legend, inch.
LEFT_IN, RIGHT_IN, BELOW_IN, ABOVE_IN = 0.75, 0.15, 1.3, 0.5


def plot_trajectory(result: RunResult) -> Figure:
    """Draws the run from above, in the world frame W.

    At a few times, the picture shows:

    - the rectangle of the robot with its microphone bar
    - the source and the moving obstacles
    - the cones of the range sensors, up to the range readings

    Labels show the times. With ideal obstacle sensing, there are no cones. For a robot
    with a safety guard, the floor that the robot knew at the end replaces the cones.

    Crosses show the source positions that the robot estimated. Early estimates are
    faint, and late estimates are strong.

    Args:
        result: Result of the run.

    Returns:
        Picture with axes in m.
    """
    figure, axes = map_axes(result)
    draw_grid(axes)
    axes.set_title(picture_title(result), fontsize=11)
    for look in looks(result):
        known = known_space(look.result, look.result.simulated_s)
        if known is None:
            draw_cones(axes, look.result, times_apart(look.result))
        else:
            # The map replaces the cones, which would hide the map.
            draw_known_space(axes, look, known)
    draw_room(axes, result)
    draw_obstacles(axes, result)
    if result.full_scenario.odor is not None:
        _draw_odor(axes, result)
    shown = looks(result)
    draw_sources(axes, result, times_apart(shown[0].result))
    for look in shown:
        draw_estimates(axes, look)
        draw_robot(axes, look, times_apart(look.result))
    draw_collision(axes, result)
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


def _draw_odor(axes: Axes, result: RunResult) -> None:
    """Draws the odor source, and its plume at the end of the run."""
    odor = result.full_scenario.odor
    assert odor is not None
    last = None
    for instant in plume_history(result.full_scenario, result.simulated_s):
        last = instant
    x = np.linspace(*axes.get_xlim(), 121)
    y = np.linspace(*axes.get_ylim(), 81)
    if last is not None:
        dense = concentration_map(last.plume, x, y)
        levels = [0.1, 0.3, 1.0, 3.0, 1e9]
        tints = ["#F3E6EF", "#E7CCDF", "#D9AECB", "#C98BB5"]
        axes.contourf(x, y, dense, levels=levels, colors=tints, zorder=0.5)
        edge = COLOURS["odor"]
        axes.contour(
            x, y, dense, levels=levels[:1], colors=edge, linewidths=0.5, zorder=0.6
        )
        label = "odor at the end (0.1, 0.3, 1, 3 times C1)"
        axes.scatter([], [], marker="s", s=40, color="#D9AECB", label=label)
    place = odor.position_m
    style: dict[str, Any] = {"color": COLOURS["odor"], "ms": 12, "ls": "none"}
    axes.plot(*place, "*", label="source of odour", **style)


def map_axes(result: RunResult) -> tuple[Figure, Axes]:
    """Makes axes with equal scales that show all bodies, with space for a legend below.

    The aspect ratio of the axes is limited. If necessary, the axes show more of the
    floor.

    Args:
        result: Result of the run.

    Returns:
        Two values. The first value is the figure. The second value is its axes, in the
        world frame W, m.
    """
    x_low, x_high, y_low, y_high = bounds(result, margin=0.7)
    width = WIDTH_IN - LEFT_IN - RIGHT_IN
    tallest, flattest = 1.3 * width, 0.4 * width
    more = max((y_high - y_low) * width / tallest - (x_high - x_low), 0.0) / 2.0
    x_low, x_high = x_low - more, x_high + more
    more = max((x_high - x_low) * flattest / width - (y_high - y_low), 0.0) / 2.0
    y_low, y_high = y_low - more, y_high + more
    height = width * (y_high - y_low) / (x_high - x_low)
    total = BELOW_IN + height + ABOVE_IN
    figure = NotebookFigure(figsize=(WIDTH_IN, total))
    axes = figure.add_axes(
        (LEFT_IN / WIDTH_IN, BELOW_IN / total, width / WIDTH_IN, height / total)
    )
    axes.set(aspect="equal", xlim=(x_low, x_high), ylim=(y_low, y_high))
    axes.xaxis.set_major_locator(MaxNLocator(steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(steps=[1, 2, 5, 10]))
    axes.set(xlabel="x in W (m)", ylabel="y in W (m)")
    return figure, axes
