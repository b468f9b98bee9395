"""Pictures of equilibria over the floor, and of a small step."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from analysis.linear.step_response import StepCheck
from analysis.models.equilibria import EquilibriumSearch
from analysis.models.equilibrium_search import CellSearch
from analysis.models.force_field import ForceField
from analysis.models.ideal_loop import ideal_loop
from analysis.reporting.palette import COLOURS
from systems.world.geometry import rectangle_corners

__all__ = ["plot_equilibria", "plot_step"]

#: How each kind is drawn: marker, colour, title.
_KINDS = {
    "sink": ("o", COLOURS["robot"], "sink"),
    "saddle": ("X", COLOURS["echo"], "saddle"),
    "source": ("^", COLOURS["source"], "source"),
}


def plot_equilibria(search: EquilibriumSearch) -> Figure:
    """Bodies, directions of the force on P at rest, and all equilibria."""
    figure = Figure(figsize=(8.2, 6.2), layout="constrained")
    axes = figure.subplots()
    x0, x1, y0, y1 = search.area_m
    field = CellSearch(ForceField(ideal_loop(search.scenario)))
    x, y = np.meshgrid(np.linspace(x0, x1, 90), np.linspace(y0, y1, 80))
    force = field.forces(np.column_stack([x.ravel(), y.ravel()])).reshape(*x.shape, 2)
    axes.streamplot(
        x, y, force[..., 0], force[..., 1], color="#C8C8C8", linewidth=0.6,
        arrowsize=0.7, density=1.6,
    )  # fmt: skip
    for name, body in search.scenario.bodies().items():
        colour = COLOURS["source" if name == "source" else "obstacle"]
        corners = rectangle_corners(body.rectangle(0.0))
        axes.add_patch(Polygon(corners, facecolor=colour, alpha=0.8))
    drawn = set()
    for point in search.points:
        marker, colour, title = _KINDS[point.kind]
        label = None if title in drawn else title
        drawn.add(title)
        axes.plot(
            *point.p_WP, marker, color=colour, markersize=9, label=label,
            markeredgecolor="black", linestyle="none", zorder=4,
        )  # fmt: skip
        if point.continuum:
            angle = np.linspace(0.0, 2.0 * np.pi, 200)
            px, py = point.p_WS
            radius = point.source_distance_m
            axes.plot(
                px + radius * np.cos(angle), py + radius * np.sin(angle), "--",
                color=colour, linewidth=1.0, label="continuum",
            )  # fmt: skip
    for number, switch in enumerate(search.switching):
        axes.plot(
            *switch.p_WP, "s", color=COLOURS["estimate"], markersize=7, zorder=4,
            markeredgecolor="black", linestyle="none",
            label=None if number else "nearest body changes",
        )  # fmt: skip
    axes.set_aspect("equal")
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0, y1)
    axes.set_xlabel("x in W (m)")
    axes.set_ylabel("y in W (m)")
    axes.set_title(f"Forces on P at rest, law: {search.scenario.law}", fontsize=10)
    axes.legend(fontsize=8, loc="upper right", framealpha=1.0)
    return figure


def plot_step(check: StepCheck) -> Figure:
    """Distance from the source after a small step, in both builds."""
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    axes = figure.subplots()
    if check.full_m is not None:
        axes.plot(
            check.time_s,
            check.full_m,
            color=COLOURS["echo"],
            label="the scenario's build",
        )
    axes.plot(check.time_s, check.ideal_m, color=COLOURS["robot"], label="all ideal")
    axes.set_xlabel("time (s)")
    axes.set_ylabel("distance of P from the source (m)")
    axes.set_title(
        f"predicted {check.predicted.frequency_rad_s:.4f} rad/s, damping "
        f"{check.predicted.damping_ratio:.4f}; simulated "
        f"{check.ideal.frequency_rad_s:.4f} rad/s, {check.ideal.damping_ratio:.4f}",
        fontsize=9,
    )
    axes.legend(fontsize=8)
    return figure
