"""Draws rates and metrics of a sweep over its cells, its grid, and drawn fields."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from analysis.batches.cells import (
    Quantity,
    by_cell,
    cell_label,
    marginal,
    quantities,
    short,
)
from analysis.batches.plan import SweepPlan
from analysis.report.intervals import Estimate
from analysis.report.palette import draw_grid, luminance

WIDTH_IN = 9.0
#: MOST_NUMBERS: greatest number of columns of a heat map with numbers in its fields.
#: MOST_TICKS: greatest number of values that an axis shows.
MOST_NUMBERS, MOST_TICKS = 8, 20
#: Colors of curves, after Okabe and Ito. Color-blind people can distinguish them.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#A8498A")


def grid_axes(plan: SweepPlan) -> list[str]:
    """Returns the fields of the grid that have more than one value."""
    return [path for path, values in plan.grid.items() if len(values) > 1]


def plot_heat_maps(
    plan: SweepPlan, results: pd.DataFrame, x: str, y: str, rest: dict[str, Any]
) -> Figure:
    """Draws a heat map of each quantity over two fields of the grid, x and y.

    The other fields of the grid have the values ``rest``. Lighter cells have larger
    values. Cells without an estimate are hatched.
    """
    runs, cells = by_cell(plan, results), plan.cells()
    chosen = [
        [
            runs[cells.index({**rest, x: x_value, y: y_value})]
            for x_value in plan.grid[x]
        ]
        for y_value in plan.grid[y]
    ]
    rows = len(plan.grid[y])
    figure, panels = _panels(results, min(max(3.5, 1.4 + 0.26 * rows), 12.0))
    for axes, quantity in panels:
        values = [[quantity.estimate(each).value for each in row] for row in chosen]
        # The limits are those of all cells, so that a color has the same meaning on
        # every map of a sweep.
        _heat_map(axes, quantity, np.array(values), _limits(quantity, runs))
        _ticks(axes, "x", x, plan.grid[x])
        _ticks(axes, "y", y, plan.grid[y])
    return figure


def _limits(quantity: Quantity, runs: Sequence[pd.DataFrame]) -> tuple[float, float]:
    """Least and greatest value of the color scale."""
    if quantity.rate:
        return 0.0, 1.0
    values = np.array([quantity.estimate(each).value for each in runs])
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    spare = 0.5 * max(abs(low), 1e-9) if low == high else 0.0
    return low - spare, high + spare


def _panels(
    results: pd.DataFrame, height_in: float
) -> tuple[Figure, list[tuple[Axes, Quantity]]]:
    """Makes a panel for each quantity. Each row has two panels and the given height."""
    shown = quantities(results, pictures=True)
    rows = math.ceil(len(shown) / 2)
    figure = Figure(figsize=(WIDTH_IN, height_in * rows), layout="constrained")
    all_axes = list(figure.subplots(rows, 2).flat)
    for axes in all_axes[len(shown) :]:
        axes.set_axis_off()
    return figure, list(zip(all_axes, shown, strict=False))


def _heat_map(
    axes: Axes, quantity: Quantity, values: np.ndarray, limits: tuple[float, float]
) -> None:
    axes.set_facecolor("#E5E5E5")
    axes.patch.set(hatch="////", edgecolor="#B0B0B0")
    image = axes.imshow(
        values,
        origin="lower",
        aspect="auto",
        cmap="cividis",
        vmin=limits[0],
        vmax=limits[1],
    )
    axes.set_title(quantity.label, fontsize=10)
    bar = axes.figure.colorbar(image, ax=axes, pad=0.02)
    bar.ax.tick_params(labelsize=8)
    if quantity.rate:
        bar.ax.yaxis.set_major_formatter(PercentFormatter(1.0))
    rows, columns = values.shape
    if columns > MOST_NUMBERS or rows > 2 * MOST_NUMBERS:
        return
    size = 9 if columns <= 4 else 7
    for (row, column), value in np.ndenumerate(values):
        text = "-" if math.isnan(value) else f"{100 * value:.0f} %"
        if not quantity.rate and not math.isnan(value):
            text = f"{value:.3g}"
        dark = not math.isnan(value) and luminance(image.to_rgba(value)) < 0.18
        color = "white" if dark else "black"
        axes.text(
            column, row, text, ha="center", va="center", color=color, fontsize=size
        )


def _ticks(axes: Axes, side: str, path: str, values: Sequence[Any]) -> None:
    every = math.ceil(len(values) / MOST_TICKS)
    labels = [short(value, 16) for value in values[::every]]
    turned = side == "x" and max(map(len, labels)) * len(labels) > 32
    axis = axes.xaxis if side == "x" else axes.yaxis
    axis.set_ticks(
        range(0, len(values), every),
        labels,
        fontsize=8,
        rotation=30 if turned else 0,
        ha="right" if turned or side == "y" else "center",
    )
    axis.set_label_text(path, fontsize=9)


def plot_cells(plan: SweepPlan, results: pd.DataFrame) -> Figure:
    """Draws one panel per quantity, with one row per cell and 95 % intervals."""
    labels = [cell_label(fields) for fields in plan.cells()]
    places = np.arange(len(labels), dtype=float)
    figure, panels = _panels(results, 0.9 + 0.32 * len(labels))
    for k, (axes, quantity) in enumerate(panels):
        estimates = [quantity.estimate(runs) for runs in by_cell(plan, results)]
        if quantity.rate:
            values = [each.value for each in estimates]
            axes.barh(places, values, color=COLORS[0], alpha=0.4, height=0.6)
            axes.set_xlim(0.0, 1.0)
            axes.xaxis.set_major_formatter(PercentFormatter(1.0))
        _errorbars(axes, places, estimates, COLORS[0], "", across=True)
        axes.set_yticks(places, labels if k % 2 == 0 else [""] * len(labels))
        axes.set_ylim(len(labels) - 0.5, -0.5)
        axes.set_title(quantity.label, fontsize=10)
        draw_grid(axes, "x")
    return figure


def plot_line(plan: SweepPlan, results: pd.DataFrame, x: str) -> Figure:
    """Draws each quantity over x, the only field of the grid, with 95 % intervals."""
    figure, panels = _panels(results, 3.0)
    for axes, quantity in panels:
        estimates = [quantity.estimate(runs) for runs in by_cell(plan, results)]
        places = np.arange(len(estimates), dtype=float)
        _errorbars(axes, places, estimates, COLORS[0], "")
        _frame(axes, quantity)
        _ticks(axes, "x", x, plan.grid[x])
    return figure


def plot_marginal(plan: SweepPlan, results: pd.DataFrame, key: str) -> Figure:
    """Draws each quantity as a function of one drawn field, a key of ``plan.draw``.

    The curves are those of the first field of the grid that has two to four values: one
    curve per value. If there is no such field, there is one curve. Each curve combines
    the runs with all values of the other fields.
    """
    runs = results
    split = next(
        (path for path in grid_axes(plan) if len(plan.grid[path]) <= len(COLORS)), None
    )
    groups = {"all runs": runs}
    if split is not None:
        cells = plan.cells()
        groups = {
            cell_label({split: value}): runs[
                [cells[cell][split] == value for cell in runs["cell"]]
            ]
            for value in plan.grid[split]
        }
    figure, panels = _panels(results, 3.0)
    for axes, quantity in panels:
        for (label, group), color in zip(groups.items(), COLORS, strict=False):
            if group.empty:
                continue
            found = marginal(plan, key, group, quantity)
            _errorbars(axes, found.places, found.estimates, color, label)
            if found.labels:
                axes.set_xticks(found.places, found.labels, fontsize=7, rotation=30)
        axes.set_xlabel(key.partition(",")[0], fontsize=9)
        _frame(axes, quantity)
    figure.legend(
        *figure.axes[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=len(groups),
        frameon=False,
    )
    return figure


def _errorbars(
    axes: Axes,
    places: np.ndarray,
    estimates: Sequence[Estimate],
    color: str,
    label: str,
    *,
    across: bool = False,
) -> None:
    """Draws estimates as a curve; if ``across`` is true, as one point per row."""
    value, low, high = np.array([(each.value, *each.ends) for each in estimates]).T
    spread = [np.maximum(value - low, 0.0), np.maximum(high - value, 0.0)]
    axes.errorbar(
        value if across else places,
        places if across else value,
        xerr=spread if across else None,
        yerr=None if across else spread,
        color=color,
        label=label,
        linestyle="none" if across else "-",
        marker="o",
        markersize=4,
        capsize=3,
        linewidth=1,
    )


def _frame(axes: Axes, quantity: Quantity) -> None:
    axes.set_title(quantity.label, fontsize=10)
    draw_grid(axes)
    if quantity.rate:
        axes.set_ylim(-0.03, 1.03)
