"""Plots estimates and errors of the localization experiment over the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from analysis.arrays.cramer_rao import polar_point
from analysis.arrays.localization import LocalizationCell
from analysis.report.palette import COLORS

#: Color and label of each estimator.
_STYLES = {
    "paper": (COLORS["obstacle"], "the papers' estimator"),
    "fast": (COLORS["left"], "fast"),
    "ml": (COLORS["robot"], "maximum likelihood"),
}
#: Half axes of ellipses, in standard deviations.
_SIGMAS = 2.0
#: Longest exaggerated half axes along and across the line of sight, m.
_ROOM_M = (0.45, 0.2)
#: y of the labels with the exaggeration factors, m.
_LABELS_Y_M = -0.5
#: Limits of the axes x and y, m. They include the robot and all positions.
_X_M, _Y_M = (-0.35, 5.05), (-0.95, 4.3)


def plot_localization(cells: Sequence[LocalizationCell]) -> Figure:
    """Plots two maps of the estimates about the microphones' centroid, in B axes, m.

    - The left map is to scale. It shows each estimator's estimates, and those of Han
      2019, as means with two standard deviations of range and bearing.
    - The right map shows ellipses of two standard deviations about each estimator's
      mean, and those of the Cramer-Rao bound. The ellipses are exaggerated along and
      across the line of sight, by factors that are written at each distance. The
      papers' estimator is left out, because its errors do not form ellipses.
    """
    figure = Figure(figsize=(13.0, 7.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for axes in (left, right):
        _floor(axes, cells)
    _to_scale(left, cells)
    _exaggerated(right, cells)
    left.set_ylabel("y in B, left (m)")
    left.set_title("Where the source was found, to scale", fontsize=11)
    right.set_title("Spread about the mean, exaggerated as written", fontsize=11)
    for axes in (left, right):
        axes.legend(loc="upper right", fontsize=9, framealpha=1.0)
    return figure


def _floor(axes: Axes, cells: Sequence[LocalizationCell]) -> None:
    """Draws the microphones, the true positions, and arcs of equal range."""
    axes.set(aspect="equal", xlim=_X_M, ylim=_Y_M, xlabel="x in B, ahead (m)")
    arc = np.radians(np.linspace(-5.0, 75.0, 80))
    for distance in sorted({cell.paper.range_m for cell in cells}):
        x, y = distance * np.cos(arc), distance * np.sin(arc)
        axes.plot(x, y, color="#E5E5E5", linewidth=0.8, zorder=0)
    axes.plot(
        [0.0] * 3, [0.4, 0.0, -0.4], "o", markersize=5, color=COLORS["obstacle"],
        label="microphones",
    )  # fmt: skip
    truth = np.array([_truth(cell) for cell in cells])
    axes.plot(*truth.T, "+", markersize=11, color=COLORS["source"], label="source")


def _truth(cell: LocalizationCell) -> NDArray[np.float64]:
    return polar_point(cell.paper.range_m, cell.paper.bearing_deg)


def _to_scale(axes: Axes, cells: Sequence[LocalizationCell]) -> None:
    label: str | None = "Han 2019, 2 standard deviations"
    for paper in dict.fromkeys(cell.paper for cell in cells):
        x, y = polar_point(paper.range_mean_m, paper.bearing_mean_deg)
        across = paper.range_mean_m * math.radians(paper.bearing_std_deg)
        axes.add_patch(
            Ellipse(
                (x, y),
                2.0 * _SIGMAS * paper.range_std_m,
                2.0 * _SIGMAS * across,
                angle=paper.bearing_mean_deg,
                facecolor=COLORS["sound"],
                edgecolor=COLORS["echo"],
                alpha=0.6,
                label=label,
            )
        )
        label = None
    for name, group in _by_estimator(cells).items():
        color, title = _STYLES[name]
        found = np.concatenate([cell.heard.positions for cell in group])
        axes.plot(*found.T, ".", markersize=3, color=color, alpha=0.5, label=title)


def _exaggerated(axes: Axes, cells: Sequence[LocalizationCell]) -> None:
    drawn = [
        cell
        for cell in cells
        if cell.estimator != "paper" and len(cell.heard.positions) > 1
    ]
    for distance in sorted({cell.paper.range_m for cell in drawn}):
        ring = [cell for cell in drawn if cell.paper.range_m == distance]
        factors = _factors(ring)
        along, across = factors
        text = f"along x{along:g}\nacross x{across:g}"
        axes.annotate(
            text, (distance, _LABELS_Y_M), ha="center", va="center", fontsize=8
        )
        for cell in ring:
            _spread(axes, cell, factors)
    titles = [_STYLES[name] for name in _by_estimator(drawn)]
    for color, title in titles:
        axes.plot([], [], color=color, label=title)
    axes.plot([], [], "--", color=COLORS["source"], label="Cramer-Rao bound")


def _spread(axes: Axes, cell: LocalizationCell, factors: NDArray[np.float64]) -> None:
    """Draws estimates about their mean, their ellipse, and the bound's ellipse."""
    color = _STYLES[cell.estimator][0]
    truth, turn = _truth(cell), _along_and_across(cell)
    stretch = turn.T @ np.diag(factors) @ turn
    positions = cell.heard.positions
    about_mean = truth + (positions - positions.mean(axis=0)) @ stretch.T
    axes.plot(*about_mean.T, ".", markersize=1.5, color=color, alpha=0.35)
    for covariance, line, edge in (
        (np.cov(positions.T), "-", color),
        (cell.heard.bound.covariance, "--", COLORS["source"]),
    ):
        ellipse = _ellipse(truth, stretch @ covariance @ stretch.T)
        ellipse.set(linestyle=line, edgecolor=edge, linewidth=1.2)
        axes.add_patch(ellipse)


def _along_and_across(cell: LocalizationCell) -> NDArray[np.float64]:
    """(2, 2) unit vectors along the line of sight and to its left."""
    angle = math.radians(cell.paper.bearing_deg)
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, sine], [-sine, cosine]])


def _factors(cells: Sequence[LocalizationCell]) -> NDArray[np.float64]:
    """(2,) exaggeration factors of ellipses, along and across the line of sight.

    The largest ellipse at one distance gets half axes of ``_ROOM_M`` or slightly less.
    """
    stds = [(c.heard.positions @ _along_and_across(c).T).std(axis=0) for c in cells]
    wanted = np.array(_ROOM_M) / np.maximum(_SIGMAS * np.max(stds, axis=0), 1e-9)
    return np.array([_nice(value) for value in wanted])


def _nice(value: float) -> float:
    """Largest of 1, 2 and 5 times a power of ten that does not exceed ``value``."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(k * power for k in (5.0, 2.0, 1.0) if k * power <= value)


def _ellipse(center: NDArray[np.float64], covariance: NDArray[np.float64]) -> Ellipse:
    values, vectors = np.linalg.eigh(covariance)
    width, height = 2.0 * _SIGMAS * np.sqrt(np.maximum(values, 0.0))
    angle = math.degrees(math.atan2(vectors[1, 0], vectors[0, 0]))
    return Ellipse(
        (float(center[0]), float(center[1])), width, height, angle=angle, fill=False
    )


def _by_estimator(
    cells: Sequence[LocalizationCell],
) -> dict[str, list[LocalizationCell]]:
    names = dict.fromkeys(cell.estimator for cell in cells)
    return {name: [cell for cell in cells if cell.estimator == name] for name in names}
