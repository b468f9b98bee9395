"""Converts the curves of a picture over time to data that a page can draw."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator
from numpy.typing import NDArray

from diagrams import RunResult

#: Largest number of points of a curve. A screen cannot show more points.
MOST_POINTS = 1200


class Chart(NamedTuple):
    """Data of a chart that shows one quantity of one robot over time."""

    title: str
    """Name of the quantity, with its unit."""
    robot: str
    """Name of the robot. It is empty if there is only one robot."""
    limits: tuple[float, float]
    """Least and greatest value on the vertical axis."""
    ticks: list[tuple[float, str]] | None
    """Values on the vertical axis with their names. With None, the axis shows
    numbers."""
    series: list[dict[str, Any]]
    """Curves of the chart. Each curve has a label, a color, a style, times t in s, and
    values. The style is line, dashes, dots, or steps. With steps, each value holds from
    its time on. A value of None is a gap in the curve."""
    bursts: list[tuple[float, float]]
    """Start and end of each burst of the source that the robot hears, s."""


def time_chart(
    panel: Callable[[Axes, RunResult], None],
    own: RunResult,
    robot: str,
    bursts: list[tuple[float, float]],
) -> Chart:
    """Converts one panel of a picture over time to data.

    Args:
        panel: Function that draws the panel, from
            ``analysis.views.picture.time_panels``.
        own: Result of a run, for one robot.
        robot: Name of the robot. It is empty if there is only one robot.
        bursts: Start and end of each burst that the robot hears, s.

    Returns:
        Chart with the curves and dots of the panel. If the panel has no curves,
        ``series`` is empty.
    """
    axes = Figure().subplots()
    panel(axes, own)
    series = []
    for line in axes.get_lines():
        in_data = line.get_transform().contains_branch_seperately(axes.transData)
        if in_data[1]:  # otherwise, the line is vertical and marks a time
            series.append(_series(line, None if in_data[0] else own.simulated_s))
    ticks = None
    if isinstance(axes.yaxis.get_major_locator(), FixedLocator):
        names = [label.get_text() for label in axes.get_yticklabels()]
        ticks = list(zip(axes.get_yticks().tolist(), names, strict=True))
    low, high = sorted(axes.get_ylim())
    return Chart(
        " ".join(axes.get_ylabel().split()) or next((s["label"] for s in series), ""),
        robot,
        (float(f"{low:.4g}"), float(f"{high:.4g}")),
        ticks,
        [each for each in series if each["t"]],
        bursts,
    )


def _series(line: Line2D, across_s: float | None) -> dict[str, Any]:
    """Converts one line of a panel to the data of a curve.

    Args:
        line: Line of the panel.
        across_s: Duration of the run, s, for a horizontal line over the whole panel.
            For all other lines, it is None.

    Returns:
        Label, color, style, times and values of the curve.
    """
    t = np.asarray(line.get_xdata(), dtype=float).reshape(-1)
    values = np.asarray(line.get_ydata(), dtype=float).reshape(-1)
    dots = line.get_linestyle() == "None"
    if across_s is not None:
        t = np.array([0.0, across_s])
    elif dots:
        t, values = t[np.isfinite(values)], values[np.isfinite(values)]
    step = max(1, math.ceil(len(t) / MOST_POINTS))
    style = _style(line)
    if style == "steps":
        # All steps are kept. Otherwise, steps of a single tick would be lost.
        (t, values), step = _steps(t, values), 1
    label = str(line.get_label())
    return {
        "label": "" if label.startswith("_") else label,
        "colour": to_hex(line.get_color()),
        "style": style,
        "t": _short(t[::step], 3),
        "values": _short(values[::step], 4),
    }


def _style(line: Line2D) -> str:
    if line.get_drawstyle() == "steps-post":
        return "steps"
    styles = {"None": "dots", "-": "line"}
    return styles.get(str(line.get_linestyle()), "dashes")


def _steps(
    t: NDArray[np.float64], values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the first sample of each constant part, and the last sample."""
    new = np.flatnonzero(np.r_[True, values[1:] != values[:-1]])
    return np.r_[t[new], t[-1:]], np.r_[values[new], values[-1:]]


def _short(values: NDArray[np.float64], digits: int) -> list[float | None]:
    rounded = np.round(values, digits).tolist()
    return [value if math.isfinite(value) else None for value in rounded]
