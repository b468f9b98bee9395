"""Pictures of pole clouds and sensitivities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from analysis.linear.robustness import PoleCloud, PoleSensitivity
from analysis.reporting.palette import COLOURS, draw_grid

__all__ = ["plot_pole_cloud", "plot_sensitivities"]

#: Faster poles than this do not shape the motion and are not shown, 1/s.
_SLOW_1_S = 12.0


def plot_pole_cloud(cloud: PoleCloud) -> Figure:
    """Poles over the box, in the s plane (ln z / T), with the worst case."""
    figure = Figure(figsize=(8.0, 4.4), layout="constrained")
    axes = figure.subplots()
    everything = _s(cloud, np.concatenate(cloud.poles))
    for poles, marker, size, colour, label in (
        (everything, ".", 3, COLOURS["left"], "random values"),
        (_s(cloud, cloud.worst_poles), "x", 8, COLOURS["source"], "worst case"),
        (_s(cloud, cloud.nominal_poles), "o", 6, COLOURS["robot"], "nominal"),
    ):
        slow = poles[np.abs(poles) < _SLOW_1_S]
        axes.plot(
            slow.real,
            slow.imag,
            marker,
            markersize=size,
            color=colour,
            fillstyle="full" if marker == "." else "none",
            label=label,
        )
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set_xlabel("real part of ln(z)/T (1/s); left of 0 decays")
    axes.set_ylabel("imaginary part (rad/s)")
    axes.grid(color="#E5E5E5", linewidth=0.6)
    axes.legend(
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=3,
        fontsize=9,
        frameon=False,
    )
    return figure


def _s(cloud: PoleCloud, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    kept = poles[np.abs(poles) > 0.0].astype(complex)
    return np.asarray(np.log(kept) / cloud.period_s)


def plot_sensitivities(rows: Sequence[PoleSensitivity]) -> Figure:
    """What each parameter's interval does to the slowest pole, to first order."""
    figure = Figure(figsize=(8.0, 0.4 * len(rows) + 1.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    ordered = sorted(rows, key=lambda row: abs(row.per_interval))
    names = [f"{row.parameter.symbol}" for row in ordered]
    for axes, part, title in (
        (left, "real", "decay: change of the real part (1/s)"),
        (right, "imag", "frequency: change of the imaginary part (rad/s)"),
    ):
        changes = [getattr(row.per_interval, part) for row in ordered]
        colours = [COLOURS["source" if x > 0 else "robot"] for x in changes]
        axes.barh(names, changes, color=colours)
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.set_title(title, fontsize=10)
        draw_grid(axes, "x")
        axes.xaxis.set_major_locator(MaxNLocator(4))
    return figure
