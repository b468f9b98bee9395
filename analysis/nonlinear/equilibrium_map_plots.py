"""Pictures of where the laws jam."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from analysis.nonlinear.equilibrium_maps import BOX_X_M, EquilibriumMap
from analysis.nonlinear.stiffness_ratio import RatioMap
from analysis.reporting.palette import COLOURS

__all__ = ["plot_equilibrium_maps", "plot_ratio_map"]

_MARKERS = {
    "goal": (".", COLOURS["empty"], "beyond the boxes"),
    "jam": ("o", COLOURS["source"], "held before them"),
    "collision": ("x", COLOURS["obstacle"], "hits a box"),
}
_NAMES = {
    "gap_m": "gap between two boxes (m)",
    "offset_m": "offset of one box from the line (m)",
}


def plot_equilibrium_maps(maps: Sequence[EquilibriumMap]) -> Figure:
    """x of the rest points by the parameter, a panel a map.

    The line is where the boxes stand.
    """
    figure = Figure(figsize=(3.4 * len(maps), 3.6), layout="constrained")
    panels = figure.subplots(1, len(maps), sharey=True, squeeze=False)[0]
    for axes, found in zip(panels, maps, strict=True):
        for outcome, (marker, colour, label) in _MARKERS.items():
            points = [p for p in found.points if p.outcome == outcome]
            if points:
                axes.plot(
                    [p.value for p in points],
                    [p.x_m for p in points],
                    marker,
                    color=colour,
                    label=label,
                )
        axes.axhline(BOX_X_M, color=COLOURS["obstacle"], linewidth=0.8)
        axes.set_xlabel(_NAMES[found.parameter])
        axes.set_title(f"{found.law}, {found.sensing}", fontsize=11)
        axes.grid(color="#EEEEEE")
        axes.legend(fontsize=8)
    panels[0].set_ylabel("x of P at rest (m)")
    return figure


def plot_ratio_map(found: RatioMap) -> Figure:
    """Head-on equilibria of the active law over k_ref/K_0."""
    figure = Figure(figsize=(6.0, 3.8), layout="constrained")
    axes = figure.subplots()
    axes.semilogx(
        found.ratios,
        found.outer_m,
        "-",
        color=COLOURS["robot"],
        label="held along the line, slips off to the side: saddle",
    )
    axes.semilogx(
        found.ratios,
        found.inner_m,
        "--",
        color=COLOURS["source"],
        label="the vanishing push gives way: source",
    )
    axes.axvline(found.today, color=COLOURS["empty"], linewidth=0.8)
    axes.set_xticks(
        [1.5, 2, 4, 8, 16, 32, 64], ["1.5", "2", "4", "8", "16", "32", "64"]
    )
    axes.minorticks_off()
    axes.set_xlabel("$k_{ref}/K_0$ (line: the scenario's)")
    axes.set_ylabel("clearance (m)")
    axes.set_title(
        f"one small obstacle, {found.to_go_m:.1f} m to go behind it", fontsize=11
    )
    axes.set_ylim(0.0, 1.6)
    axes.grid(color="#EEEEEE")
    axes.legend(fontsize=8)
    return figure
