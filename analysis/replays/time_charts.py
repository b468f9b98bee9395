"""The curves of the picture over time as data, for a page to draw them."""

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

#: A curve has so many points at most; a screen shows no more.
MOST_POINTS = 1200


class Chart(NamedTuple):
    """One quantity of one robot over time."""

    title: str
    """With its unit."""
    robot: str
    """Whose; empty where there is one."""
    limits: tuple[float, float]
    """Of the axis."""
    ticks: list[tuple[float, str]] | None
    """Names of values; none: the values are numbers."""
    series: list[dict[str, Any]]
    """Label, colour, style, t in s, and values; none is a gap.

    The style is line, dashes, dots, or steps: each value holds from its t on.
    """
    bursts: list[tuple[float, float]]
    """When what is heard sounds, s."""


def time_chart(
    panel: Callable[[Axes, RunResult], None],
    own: RunResult,
    robot: str,
    bursts: list[tuple[float, float]],
) -> Chart:
    """What a panel of the picture over time shows, as data.

    Args:
        panel: Draws it, as of ``analysis.runs.run_plots.time_panels``.
        own: The run of one robot.
        robot: Its name; empty where it is the only one.
        bursts: When what it hears sounds, s.

    Returns:
        Its curves and dots; without any ``series`` is empty.
    """
    axes = Figure().subplots()
    panel(axes, own)
    series = []
    for line in axes.get_lines():
        in_data = line.get_transform().contains_branch_seperately(axes.transData)
        if in_data[1]:  # else it is upright, and marks a moment
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
    """One curve; of a line from side to side its length, s."""
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
        # Thinned, it would lose what lasts for a tick.
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
    """The begin of each value, and the end of the last."""
    new = np.flatnonzero(np.r_[True, values[1:] != values[:-1]])
    return np.r_[t[new], t[-1:]], np.r_[values[new], values[-1:]]


def _short(values: NDArray[np.float64], digits: int) -> list[float | None]:
    rounded = np.round(values, digits).tolist()
    return [value if math.isfinite(value) else None for value in rounded]
