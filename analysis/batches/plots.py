"""Draws rates and metrics of a sweep over its cells, its grid, and drawn fields."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter
from matplotlib.transforms import ScaledTranslation

from analysis.batches.cells import (
    Quantity,
    by_cell,
    cell_label,
    marginal,
    quantities,
    short,
)
from analysis.batches.field_words import field_label
from analysis.batches.plan import SweepPlan
from analysis.report.intervals import Estimate
from analysis.report.palette import draw_grid, luminance
from diagrams.scenario.suggestions import did_you_mean
from systems.framework.input_error import InputError

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
    axis.set_label_text(field_label(path), fontsize=9)


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


def plot_panels(
    plan: SweepPlan, results: pd.DataFrame, over: str, by: str = ""
) -> Figure:
    """Draws one panel per quantity over a field; see ``plot_over``."""
    figure, panels = _panels(results, 3.0)
    for axes, quantity in panels:
        _draw_over(axes, plan, results, quantity, over, by)
        axes.set_title(quantity.label, fontsize=10)
        axes.xaxis.label.set_fontsize(9)
        axes.tick_params(labelsize=8)
    _legend(figure, plan, by)
    return figure


def is_number(plan: SweepPlan, path: str) -> bool:
    """Returns whether a field of the grid has several values, which are numbers."""
    kinds = {type(value) for value in plan.grid[path]}
    return len(plan.grid[path]) > 1 and kinds <= {int, float}


def numbers_of(plan: SweepPlan) -> list[str]:
    """Returns the fields that vary and are numbers: those of the grid, then the draws.

    Of several fields that are drawn together, the result has the first one.
    """
    drawn = [
        key.partition(",")[0].strip()
        for key, draw in plan.draw.items()
        if draw.boxes is None and draw.numeric
    ]
    return [path for path in plan.grid if is_number(plan, path)] + drawn


def split_field(plan: SweepPlan) -> str:
    """Returns the first field of the grid with two to four values; empty if none."""
    few = (path for path in grid_axes(plan) if len(plan.grid[path]) <= len(COLORS))
    return next(few, "")


def _errorbars(
    axes: Axes,
    places: np.ndarray,
    estimates: Sequence[Estimate],
    color: str,
    label: str,
    *,
    across: bool = False,
    joined: bool = True,
    shift_pt: float = 0.0,
) -> None:
    """Draws estimates as a curve; if ``across`` is true, as one point per row.

    Without ``joined``, there is no line between the points, for example because they
    belong to categories. ``shift_pt`` moves the curve to the right, in points, so that
    the intervals of several curves stay visible.
    """
    value, low, high = np.array([(each.value, *each.ends) for each in estimates]).T
    spread = [np.maximum(value - low, 0.0), np.maximum(high - value, 0.0)]
    drawn = axes.errorbar(
        value if across else places,
        places if across else value,
        xerr=spread if across else None,
        yerr=None if across else spread,
        color=color,
        label=label,
        linestyle="-" if joined and not across else "none",
        marker="o",
        markersize=4,
        capsize=3,
        linewidth=1,
    )
    # Not as an argument, because the limits of the axes would then omit the curve.
    shift = ScaledTranslation(shift_pt / 72.0, 0.0, axes.figure.dpi_scale_trans)
    for artist in drawn.get_children():
        artist.set_transform(axes.transData + shift)


def plot_over(
    plan: SweepPlan, results: pd.DataFrame, name: str, over: str, by: str = ""
) -> Figure:
    """Draws one rate or metric over a field, with 95 % intervals.

    A drawn number is sorted into at least four bins with equal numbers of runs.
    Categories, such as laws, are points that no line joins.

    Args:
        plan: Plan of the sweep.
        results: Table of its runs.
        name: ``success``, ``collision``, or the column of a metric.
        over: Field on the horizontal axis: a field of ``plan.grid`` or ``plan.draw``.
        by: Field of the grid with one curve per value. Empty means a single curve.

    Returns:
        The figure.

    Raises:
        InputError: The quantity or a field is not one of the sweep.
    """
    quantity = _quantity(results, name)
    drawn = _drawn(plan)
    if over not in drawn and over not in plan.grid:
        raise _not_in("over", over, [*plan.grid, *drawn])
    if by and by not in plan.grid:
        raise _not_in("by", by, plan.grid)
    figure = Figure(figsize=(5.0, 3.6), layout="constrained")
    axes = figure.add_subplot()
    _draw_over(axes, plan, results, quantity, over, by)
    axes.set_ylabel(quantity.label)
    _legend(figure, plan, by)
    return figure


def _drawn(plan: SweepPlan) -> dict[str, str]:
    """Returns the key in ``plan.draw`` of each drawn field."""
    return {path.strip(): key for key in plan.draw for path in key.split(",")}


def _draw_over(
    axes: Axes,
    plan: SweepPlan,
    results: pd.DataFrame,
    quantity: Quantity,
    over: str,
    by: str,
) -> None:
    cells, drawn = plan.cells(), _drawn(plan)
    for k, value in enumerate(plan.grid[by] if by else [None]):
        own = [cells[cell].get(by) == value for cell in results["cell"]]
        group = results[own] if by else results
        if group.empty:
            continue
        if over in drawn:
            found = marginal(plan, drawn[over], group, quantity)
            places, names, estimates = found.places, found.labels, found.estimates
        else:
            places, names = _places(plan.grid[over])
            of_run = [cells[cell][over] for cell in group["cell"]]
            estimates = tuple(
                quantity.estimate(group[[at == each for at in of_run]])
                for each in plan.grid[over]
            )
        color, label = COLORS[k % len(COLORS)], short(value) if by else ""
        shift = 4.0 * (k - 0.5 * (len(plan.grid[by]) - 1)) if by else 0.0
        _errorbars(
            axes, places, estimates, color, label, joined=not names, shift_pt=shift
        )
        if names:
            axes.set_xticks(places, names, rotation=30 if len(names) > 4 else 0)
    axes.set_xlabel(field_label(over, plan.base))
    draw_grid(axes)
    if quantity.rate:
        axes.set_ylim(-0.03, 1.03)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=""))


def _legend(figure: Figure, plan: SweepPlan, by: str) -> None:
    if by:
        figure.legend(
            *figure.axes[0].get_legend_handles_labels(),
            title=field_label(by, plan.base),
            loc="outside lower center",
            ncols=4,
            frameon=False,
        )


def _places(values: Sequence[Any]) -> tuple[np.ndarray, tuple[str, ...]]:
    """Positions of the values on an axis, and their names if they are no numbers."""
    if all(isinstance(value, int | float) for value in values):
        return np.array(values, dtype=float), ()
    return np.arange(len(values), dtype=float), tuple(short(value) for value in values)


def _quantity(results: pd.DataFrame, name: str) -> Quantity:
    known = [each.name for each in quantities(results)]
    if name in known or name in results:
        return Quantity(name)
    raise _not_in("quantity", name, known)


def _not_in(field: str, name: str, known: Iterable[str]) -> InputError:
    names = list(known)
    return InputError(
        field,
        f"{name!r} is not there; use {', '.join(names)}{did_you_mean(name, names)}",
    )
