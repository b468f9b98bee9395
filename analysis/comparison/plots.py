"""Pictures of a comparison: rates with their intervals, and example runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from analysis.comparison.cells import LawCell, Mean
from analysis.comparison.laws_in_pairs import Comparison
from analysis.reporting.palette import COLOURS, draw_grid
from analysis.views.framing import bounds
from analysis.views.picture import draw_scene
from analysis.views.scene import make_scene
from diagrams import RunResult

#: Metrics that have a panel, with the titles of their axes.
_METRICS = {
    "minimum_obstacle_clearance_m": "least clearance from obstacles (m), all runs",
    "jerk_rms_m_s3": "rms jerk (m/s$^3$), successful runs",
}


def plot_rates(comparisons: Sequence[Comparison]) -> Figure:
    """Draws the success rate, the collision rate and two medians of every control law.

    All values have 95 % confidence intervals. Each scenario has one row of panels.
    """
    rows, columns = len(comparisons), 2 + len(_METRICS)
    tallest = max(len(comparison.cells) for comparison in comparisons)
    figure = Figure(
        figsize=(3.6 * columns, rows * (0.9 + 0.32 * tallest)), layout="constrained"
    )
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, comparison in zip(grid, comparisons, strict=True):
        cells = comparison.cells
        _rate_panel(axes[0], cells, [cell.success for cell in cells], "robot")
        _rate_panel(axes[1], cells, [cell.collision for cell in cells], "source")
        for panel, name in zip(axes[2:], _METRICS, strict=True):
            _median_panel(panel, cells, name)
        for panel in axes[1:]:
            panel.tick_params(labelleft=False)
        axes[0].set_title(cells[0].scenario, loc="left", fontsize=10)
    titles = ("success (%)", "collision (%)", *_METRICS.values())
    for panel, title in zip(grid[-1], titles, strict=True):
        panel.set_xlabel(title, fontsize=9)
    return figure


def _rate_panel(
    axes: Axes, cells: Sequence[LawCell], rates: Sequence[Mean], colour: str
) -> None:
    places = np.arange(len(cells))
    values = np.array([100.0 * rate.estimate for rate in rates])
    low = values - [100.0 * rate.low for rate in rates]
    high = [100.0 * rate.high for rate in rates] - values
    axes.barh(places, values, color=COLOURS[colour], alpha=0.75, height=0.6)
    axes.errorbar(
        values, places, xerr=np.maximum([low, high], 0.0), fmt="none", ecolor="black"
    )
    axes.set_xlim(0.0, 100.0)
    _label_laws(axes, cells)


def _median_panel(axes: Axes, cells: Sequence[LawCell], name: str) -> None:
    for place, cell in enumerate(cells):
        median = cell.metrics.get(name)
        if median is not None:
            axes.plot([median.low, median.high], [place, place], "k-")
            axes.plot(median.median, place, "o", color=COLOURS["robot"])
    axes.xaxis.set_major_locator(MaxNLocator(nbins=4))
    _label_laws(axes, cells)


def _label_laws(axes: Axes, cells: Sequence[LawCell]) -> None:
    axes.set_yticks(np.arange(len(cells)), [cell.label for cell in cells])
    axes.set_ylim(len(cells) - 0.5, -0.5)
    draw_grid(axes, "x")


def plot_examples(rows: Sequence[tuple[LawCell, Sequence[RunResult]]]) -> Figure:
    """Draws the worst, typical and best run of each cell from above, in W, m."""
    results = [result for _, runs in rows for result in runs]
    limits = np.array([bounds(result, margin=0.6) for result in results])
    x_low, y_low = limits[:, 0].min(), limits[:, 2].min()
    x_high, y_high = limits[:, 1].max(), limits[:, 3].max()
    width = 4.2
    height = width * (y_high - y_low) / (x_high - x_low) + 0.45
    figure = Figure(figsize=(3 * width, len(rows) * height), layout="constrained")
    grid = figure.subplots(len(rows), 3, squeeze=False, sharex=True, sharey=True)
    for panels, (cell, runs) in zip(grid, rows, strict=True):
        for panel in panels[len(runs) :]:
            panel.set_axis_off()
        for panel, example, result in zip(panels, cell.examples, runs, strict=False):
            draw_scene(panel, make_scene(result), ends_only=True)
            ending = f"{result.ending}, {result.simulated_s:.0f} s"
            panel.set_title(f"{cell.label}, {example.kind}: {ending}", fontsize=9)
            panel.set(aspect="equal", xlim=(x_low, x_high), ylim=(y_low, y_high))
    for panel in grid[-1]:
        panel.set_xlabel("x in W (m)")
    for panel in grid[:, 0]:
        panel.set_ylabel("y in W (m)")
    return figure
