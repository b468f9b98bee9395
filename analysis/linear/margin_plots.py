"""Pictures of loops: Bode, Nyquist with its disk, Nichols, gang of four."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from analysis.linear.gang_of_four import GangOfFour
from analysis.linear.loop_margins import LoopMargins
from analysis.reporting.palette import COLOURS

__all__ = ["plot_bode", "plot_gang_of_four", "plot_nichols", "plot_nyquist"]

_CYCLE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
#: Part of the plane about -1 that is shown.
_NYQUIST_X, _NYQUIST_Y = (-3.2, 1.2), (-2.2, 2.2)
#: Closed-loop gains whose contours a Nichols chart shows, dB.
_CONTOURS_DB = (-12.0, -6.0, -3.0, 0.0, 1.0, 3.0, 6.0, 12.0)


def plot_bode(loops: Sequence[LoopMargins]) -> Figure:
    """Size and phase of each loop; crossovers with their phase margins."""
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for loop, colour in zip(loops, _cycle(loops), strict=True):
        omega, L = loop.response.omega, loop.response.L
        upper.loglog(omega, np.abs(L), color=colour, label=loop.name)
        phase = np.degrees(np.unwrap(np.angle(L)))
        phase -= 360.0 * round((phase[len(phase) // 2] + 150.0) / 360.0)
        lower.semilogx(omega, phase, color=colour)
        if math.isfinite(loop.phase_margin_deg):
            at = loop.crossover_rad_s
            reached = float(np.interp(at, omega, phase))
            upper.plot(at, 1.0, "o", color=colour, markersize=5)
            lower.plot([at, at], [-180.0, reached], color=colour, linewidth=2.5)
    upper.axhline(1.0, color=COLOURS["empty"], linewidth=0.8)
    lower.axhline(-180.0, color=COLOURS["empty"], linewidth=0.8)
    upper.set_ylabel("|L|")
    upper.set_ylim(1e-4, 1e4)
    lower.set_ylabel("phase (deg)")
    lower.set_ylim(-370.0, 10.0)
    lower.set_yticks(np.arange(-360.0, 1.0, 90.0))
    lower.set_xlabel("frequency (rad/s)")
    upper.legend(fontsize=8)
    for axes in (upper, lower):
        axes.grid(visible=True, which="major", linewidth=0.4)
    return figure


def plot_nyquist(loops: Sequence[LoopMargins]) -> Figure:
    """Each loop about -1, with the balanced disk that it stays out of."""
    columns = min(3, len(loops))
    rows = math.ceil(len(loops) / columns)
    figure = Figure(figsize=(3.6 * columns, 3.8 * rows), layout="constrained")
    cells = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for axes, loop in zip(cells, loops, strict=False):
        L = loop.response.L
        axes.plot(L.real, L.imag, color=_CYCLE[0], label="L")
        axes.plot(L.real, -L.imag, color=_CYCLE[0], linewidth=0.7, linestyle=":")
        axes.plot(-1.0, 0.0, "+", color=COLOURS["source"], markersize=9)
        low, high = _disk_ends(loop.disk.alpha)
        axes.add_patch(
            Circle(
                ((low + high) / 2.0, 0.0),
                (high - low) / 2.0,
                facecolor=COLOURS["source"],
                alpha=0.25,
                label=f"disk, $\\alpha$ = {loop.disk.alpha:.2f}",
            )
        )
        angle = np.linspace(0.0, 2.0 * np.pi, 200)
        axes.plot(np.cos(angle), np.sin(angle), color="#D0D0D0", linewidth=0.7)
        axes.set_xlim(*_NYQUIST_X)
        axes.set_ylim(*_NYQUIST_Y)
        axes.set_aspect("equal")
        axes.set_title(loop.name, fontsize=9)
        axes.set_xlabel("Re L")
        axes.set_ylabel("Im L")
        axes.legend(loc="upper right", fontsize=7)
    for axes in cells[len(loops) :]:
        axes.set_axis_off()
    return figure


def _disk_ends(alpha: float) -> tuple[float, float]:
    """Where the disk of skew 0 meets the real axis, left and right of -1."""
    left = -(2.0 + alpha) / (2.0 - alpha) if alpha < 2.0 else -1e3
    return left, -(2.0 - alpha) / (2.0 + alpha)


def plot_nichols(loops: Sequence[LoopMargins]) -> Figure:
    """Size against phase, over contours of equal closed-loop size."""
    figure = Figure(figsize=(7.5, 5.6), layout="constrained")
    axes = figure.subplots()
    _contours(axes)
    for loop, colour in zip(loops, _cycle(loops), strict=True):
        L = loop.response.L
        phase = np.degrees(np.unwrap(np.angle(L)))
        phase -= 360.0 * round((phase[len(phase) // 2] + 150.0) / 360.0)
        size = 20.0 * np.log10(np.maximum(np.abs(L), 1e-12))
        axes.plot(phase, size, color=colour, label=loop.name)
    axes.plot(-180.0, 0.0, "+", color=COLOURS["source"], markersize=11)
    axes.set_xlim(-360.0, 0.0)
    axes.set_ylim(-40.0, 40.0)
    axes.set_xticks(np.arange(-360.0, 1.0, 45.0))
    axes.set_xlabel("phase of L (deg)")
    axes.set_ylabel("|L| (dB)")
    axes.legend(fontsize=8, loc="lower left")
    return figure


def _contours(axes: Axes) -> None:
    phase, size = np.meshgrid(np.linspace(-359.5, -0.5, 400), np.linspace(-40, 40, 400))
    L = 10.0 ** (size / 20.0) * np.exp(1j * np.radians(phase))
    drawn = axes.contour(
        phase,
        size,
        20.0 * np.log10(np.abs(L / (1.0 + L))),
        levels=_CONTOURS_DB,
        colors="#BBBBBB",
        linewidths=0.6,
        linestyles="solid",
    )
    axes.clabel(drawn, fmt="%g dB", fontsize=7)


def plot_gang_of_four(gang: GangOfFour) -> Figure:
    """Sizes of S, T, PS and CS."""
    figure = Figure(figsize=(8.0, 5.4), layout="constrained")
    titles = {
        "S": "S: error of the estimate that is left",
        "PS": "PS: push to position, m / (m/s$^2$)",
        "CS": "CS: error to acceleration, (m/s$^2$) / m",
        "T": "T = 1 - S",
    }
    for axes, (name, title) in zip(
        figure.subplots(2, 2, sharex=True).ravel(), titles.items(), strict=True
    ):
        size = np.abs(getattr(gang, name))
        axes.loglog(gang.omega, np.maximum(size, 1e-9), color=_CYCLE[0])
        peak = int(size.argmax())
        axes.plot(gang.omega[peak], size[peak], "o", color=COLOURS["source"])
        axes.annotate(
            f"{size[peak]:.2f}",
            (gang.omega[peak], size[peak]),
            textcoords="offset points",
            xytext=(8, -3),
            fontsize=8,
        )
        axes.set_title(title, fontsize=9)
        axes.set_ylim(bottom=max(1e-5, 0.3 * size.min()), top=3.0 * size.max())
        axes.grid(visible=True, linewidth=0.4)
        if axes.get_subplotspec().is_last_row():
            axes.set_xlabel("frequency (rad/s)")
    return figure


def _cycle(loops: Sequence[LoopMargins]) -> list[str]:
    return [_CYCLE[k % len(_CYCLE)] for k in range(len(loops))]
