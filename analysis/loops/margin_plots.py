"""Bode, Nyquist and Nichols plots of a loop, with its margins."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from matplotlib.patches import Circle

from analysis.report.notebook_figure import NotebookFigure
from analysis.report.palette import COLORS
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Kind of a plot, as the package ``control`` names its functions.
PlotKind = Literal["bode", "nyquist", "nichols"]
#: Range of both axes of a Nyquist plot. Integrators lead out of every range.
_REACH = 4.0
#: Magnitudes of a Nichols plot, dB.
_LEVELS_DB = (-60.0, 40.0)


class _Mark(NamedTuple):
    """A point of the curve that determines a margin."""

    place: int
    """Index of the nearest frequency of the response."""
    text: str
    color: str


def plot_margins(margins: Any, kind: PlotKind) -> Figure:
    """Plots a loop transfer function and marks the points that determine its margins.

    Args:
        margins: ``LoopMargins``. An unstable closed loop has no marks.
        kind: Kind of the plot.

    Returns:
        The figure. The curves are those of the package ``control``.

    Raises:
        InputError: The kind is not known.
    """
    import control

    plots = {
        "bode": control.bode_plot,
        "nyquist": control.nyquist_plot,
        "nichols": control.nichols_plot,
    }
    if kind not in plots:
        raise InputError("kind", f"is {kind!r}; use one of {', '.join(plots)}")
    response = margins.response
    figure = NotebookFigure(figsize=(7.0, 5.6), layout="constrained")
    rows = 2 if kind == "bode" else 1
    axes = figure.subplots(rows, squeeze=False, sharex=True)[:, 0]
    system = control.frd(response.L, response.omega, name="L")
    options = {"warn_encirclements": False} if kind == "nyquist" else {}
    plots[kind](system, ax=axes if rows > 1 else axes[0], title="", **options)
    marks = [*_marks(margins)] if margins.stable else []
    if kind == "nyquist":
        _finish_nyquist(axes[0], margins)
    elif kind == "nichols":
        axes[0].set_ylim(*_LEVELS_DB)
    for mark in marks:
        if kind == "nyquist":
            L = response.L[mark.place]
            points = [(L.real, L.imag)]
        else:
            curves = [_curve(each, len(response.omega)) for each in axes]
            points = [(x[mark.place], y[mark.place]) for x, y in curves]
        for axis, point in zip(axes, points, strict=True):
            axis.plot(*point, "o", color=mark.color, zorder=5, label=mark.text)
    state = "stable" if margins.stable else "unstable"
    figure.suptitle(f"{margins.name}: closed loop {state}", fontsize=11)
    if marks:
        axes[0].legend(loc="best", fontsize=8)
    return figure


def _marks(margins: Any) -> Iterator[_Mark]:
    omega, L = margins.response.omega, margins.response.L
    for gain, name in (
        (margins.gain_increase_margin, "gain up"),
        (margins.gain_reduction_margin, "gain down"),
    ):
        if 0.0 < gain < math.inf:
            yield _Mark(
                int(np.abs(L + 1.0 / gain).argmin()),
                f"{name}: {gain:.3g} ({20.0 * math.log10(gain):+.3g} dB)",
                COLORS["source"],
            )
    phase, nearest = margins.crossover_rad_s, margins.modulus_frequency_rad_s
    phase_text = f"phase: {margins.phase_margin_deg:.3g} deg at {phase:.3g} rad/s"
    nearest_text = f"nearest to -1: {margins.modulus_margin:.3g} at {nearest:.3g} rad/s"
    for where, text, color in (
        (phase, phase_text, COLORS["law"]),
        (nearest, nearest_text, COLORS["estimate"]),
    ):
        if omega[0] <= where <= omega[-1]:
            yield _Mark(int(np.abs(omega - where).argmin()), text, color)


def _curve(axes: Any, points: int) -> tuple[Any, Any]:
    """Returns the data of the curve with this number of points."""
    return next(
        line.get_data() for line in axes.get_lines() if len(line.get_xdata()) == points
    )


def _finish_nyquist(axes: Any, margins: Any) -> None:
    """Draws the unit circle and the modulus margin, at the same scale on both axes."""
    axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, ls=":", ec=COLORS["empty"]))
    if margins.stable:
        disk = Circle((-1.0, 0.0), margins.modulus_margin, fc=COLORS["estimate"])
        disk.set_alpha(0.15)
        axes.add_patch(disk)
    reach = min(1.1 * float(np.abs(margins.response.L).max()), _REACH)
    reach = max(reach, 1.5)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
