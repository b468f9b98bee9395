"""Figures of sampled loops: stability charts, root loci, and silences of the sound."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from analysis.loops.linear_plots import panels
from analysis.report.palette import COLORS
from studies.linear.burst_gaps import GapChart
from studies.linear.root_locus import RootLocus
from studies.linear.sampled_stability import PolesAgainstPeriod, StabilityChart

_LINES = ("#0072B2", "#D55E00", "#009E73", "#A8498A", "#7A5200")
#: Marker of the values in the scenario.
_CURRENT: dict[str, Any] = {"color": "#F0E442", "markeredgecolor": "black"}
#: Limits of the color scale for growth rates, 1/s.
_SLOWEST, _FASTEST = -0.5, 0.5


def plot_chart(chart: StabilityChart) -> Figure:
    """Plots the growth rate of the slowest mode over two parameters.

    A star marks the values of the scenario.
    """
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    axes = figure.subplots()
    shown = np.clip(chart.growth_per_s, _SLOWEST, _FASTEST)
    mesh = axes.pcolormesh(
        chart.x,
        chart.y,
        shown,
        cmap="RdBu_r",
        norm=TwoSlopeNorm(0.0, _SLOWEST, _FASTEST),
        shading="nearest",
        rasterized=True,
    )
    if chart.growth_per_s.min() < 0.0 < chart.growth_per_s.max():
        axes.contour(chart.x, chart.y, chart.growth_per_s, levels=[0.0], colors="black")
    axes.plot(*chart.today, "*", markersize=14, **_CURRENT)
    axes.annotate("current", chart.today, textcoords="offset points", xytext=(9, 6))
    if chart.x.min() > 0.0:
        axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(chart.x_name)
    axes.set_ylabel(chart.y_name)
    axes.set_title(chart.title, fontsize=10)
    figure.colorbar(mesh, ax=axes, label="growth (1/s); blue: decay")
    return figure


def plot_poles_against_period(found: PolesAgainstPeriod) -> Figure:
    """Plots the poles and the growth rate of the slowest mode for many sample periods.

    The left panel shows the poles in the z plane. The right panel shows the growth
    rate.
    """
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    angle = np.linspace(0.0, 2.0 * np.pi, 300)
    left.plot(np.cos(angle), np.sin(angle), color=COLORS["empty"], linewidth=0.8)
    colors = np.repeat(np.log10(found.periods_s)[:, None], found.poles.shape[1], axis=1)
    dots = left.scatter(
        found.poles.real, found.poles.imag, c=10.0**colors, s=6, norm="log"
    )
    left.set_aspect("equal")
    left.set_xlim(-1.6, 1.3)
    left.set_ylim(-1.45, 1.45)
    left.set_xlabel("Re z")
    left.set_ylabel("Im z")
    figure.colorbar(dots, ax=left, label="sample period (s)")
    right.semilogx(found.periods_s, found.growth_per_s, color=_LINES[0])
    right.axhline(0.0, color="black", linewidth=0.8)
    right.axvline(
        found.today_s, color=COLORS["source"], linestyle="--", label="current"
    )
    right.set_ylim(-0.35, 0.5)
    right.set_xlabel("sample period (s)")
    right.set_ylabel("growth (1/s)")
    right.legend(fontsize=8)
    return figure


def plot_gap_chart(chart: GapChart) -> Figure:
    """Plots the largest multiplier of a burst cycle over the silence, for each hold."""
    figure = Figure(figsize=(6.8, 4.2), layout="constrained")
    axes = figure.subplots()
    styles = {"world": "-", "robot": "-", "motion": "--"}
    for hold, row, color in zip(chart.holds, chart.multiplier, _LINES, strict=False):
        axes.semilogy(
            chart.gaps_s, row, styles[hold], color=color, label=f"hold: {hold}"
        )
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.axvline(chart.today[0], color=COLORS["empty"], linestyle=":")
    if chart.today[1] in chart.holds:
        row = chart.multiplier[chart.holds.index(chart.today[1])]
        at = float(np.interp(chart.today[0], chart.gaps_s, row))
        axes.plot(chart.today[0], at, "*", markersize=14, label="current", **_CURRENT)
    axes.set_xlabel(f"silence after {chart.on_s:g} s of sound (s)")
    axes.set_ylabel("largest multiplier of a cycle")
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.legend(fontsize=8)
    return figure


def plot_root_loci(loci: Sequence[RootLocus]) -> Figure:
    """Plots poles in the s plane for 0.05 to 20 times the current gain."""
    figure, cells = panels(len(loci), columns=2, size=(4.8, 3.8))
    for axes, locus in zip(cells, loci, strict=True):
        _root_locus(figure, axes, locus)
    return figure


def _root_locus(figure: Figure, axes: Axes, locus: RootLocus) -> None:
    poles = locus.poles
    values = np.repeat(locus.values[:, None], poles.shape[1], axis=1)
    dots = axes.scatter(poles.real, poles.imag, c=values, s=7, norm="log")
    today, label = locus.poles_today, f"current: {locus.today:g}"
    axes.plot(today.real, today.imag, "*", markersize=11, label=label, **_CURRENT)
    slow = np.abs(locus.poles_today)[np.isfinite(locus.poles_today)]
    reach = 4.0 * max(float(slow[slow < 10.0].max(initial=0.5)), 0.5)
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set_xlim(-reach, 0.5 * reach)
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("Re s (1/s)")
    axes.set_ylabel("Im s (rad/s)")
    axes.set_title(f"{locus.parameter}\n({locus.loop})", fontsize=9)
    axes.legend(fontsize=8, loc="upper left")
    figure.colorbar(dots, ax=axes)
