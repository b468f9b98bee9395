"""Draws the curves of a run over time."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from analysis.report.notebook_figure import NotebookFigure
from analysis.report.palette import COLORS, draw_grid
from analysis.views.bursts import heard_bursts
from analysis.views.curves import Curve, Panel, panels
from analysis.views.framing import picture_title
from diagrams import RunResult

#: Width of the picture, and height of a panel, inch.
WIDTH_IN, PANEL_IN = 8.0, 1.55
#: Largest number of characters in one line beside an axis.
LONGEST_LINE = 13


def plot_time_series(result: RunResult, clearance: ArrayLike | None = None) -> Figure:
    """Draws measured, estimated and commanded quantities of one robot over time.

    Bursts of the source are shaded. ``clearance`` is that of ``panels``. If the robot
    has a safety guard, one more panel shows the actions of the guard. Another panel
    shows the distance in which the robot can stop. It also shows the distance to spare:
    the distance to space that is not free, minus the distance that the guard needs.
    """
    shown, bursts = panels(result, clearance), heard_bursts(result)
    size = WIDTH_IN, 1.0 + PANEL_IN * len(shown)
    figure = NotebookFigure(figsize=size, layout="constrained")
    all_axes = np.atleast_1d(figure.subplots(len(shown), sharex=True))
    for axes, panel in zip(all_axes, shown, strict=True):
        for start, end in bursts:
            axes.axvspan(start, end, color=COLORS["sound"], alpha=0.25, linewidth=0)
            # Yellow is hard to see on white. The line at the bottom is easy to see.
            axes.axvspan(start, end, ymax=0.025, color=COLORS["sounding"], linewidth=0)
        _draw(axes, panel)
    hears = not result.full_scenario.drives_to_point(result.name)
    all_axes[-1].set(
        xlabel="time (s)" + (", shaded while the source sounds" if hears else ""),
        xlim=(0.0, max(result.simulated_s, 1e-3)),
    )
    figure.suptitle(picture_title(result), fontsize=11)
    figure.align_ylabels(list(all_axes))
    return figure


def _draw(axes: Axes, panel: Panel) -> None:
    for shade in panel.shades:
        (low, high), spans = shade.between, shade.spans
        axes.broken_barh(
            [(start, end - start) for start, end in spans],
            (low, high - low),
            facecolor=shade.color,
            alpha=shade.alpha,
            linewidth=0.0,
            label=shade.label,
        )
    for curve in panel.curves:
        axes.plot(curve.t, curve.y, **_style(curve))
    for count, time in enumerate(panel.instants):
        label = None if count else "new route"
        axes.axvline(time, color="black", ls=":", lw=1.0, label=label)
    if panel.rows:
        axes.set_yticks(*zip(*panel.rows, strict=True))
    unit = panel.unit.replace(" ", "\N{NO-BREAK SPACE}")  # stays on one line
    title = panel._replace(unit=unit).title
    axes.set_ylabel(textwrap.fill(title, LONGEST_LINE, break_long_words=False))
    axes.set_ylim(*panel.limits)
    draw_grid(axes, "y")
    axes.legend(
        loc="upper left",
        bbox_to_anchor=(1.005, 1.03),
        fontsize=8,
        frameon=False,
        handlelength=1.5,
    )


def _style(curve: Curve) -> dict[str, Any]:
    style: dict[str, Any] = {"color": curve.color, "label": curve.label}
    if curve.style == "dots":
        return {
            **style,
            "ls": "none",
            "marker": ".",
            "ms": 2 * curve.width,
            "zorder": 3,
        }
    if curve.style == "mark":
        return {**style, "ls": "none", "marker": "v"}
    lines = {"line": {}, "dashes": {"ls": "--"}, "steps": {"drawstyle": "steps-post"}}
    return {**style, "lw": curve.width, **lines[curve.style]}
