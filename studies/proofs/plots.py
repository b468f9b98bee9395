"""Figures of proved regions, and of bounds on the effect of moving bodies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from analysis.report.palette import COLORS
from studies.nonlinear.phase_portrait import certified_speeds, head_on_model
from studies.proofs.disturbance_bounds import (
    DisturbanceBounds,
    ObstacleBound,
    SourceBound,
)
from studies.proofs.sos_region import SosRegion


def plot_sos_region(region: SosRegion) -> Figure:
    """Plots the region's slice w = v, and the region from energy without motor lag."""
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    axes = figure.subplots()
    model = region.model
    rest, scales = model.contact.equilibrium_m, model.scales
    x = np.linspace(*model.domain_m, 301)
    limit = certified_speeds(head_on_model(model.contact), rest + x, region.contact_m)
    axes.fill_between(
        rest + x,
        -np.minimum(limit, scales[1]),
        np.minimum(limit, scales[1]),
        color="#DCEBF7",
        label="energy, without motor lag",
    )
    v = np.linspace(-scales[1], scales[1], 301)
    grid_x, grid_v = np.meshgrid(x, v, indexing="ij")
    y = np.stack([grid_x, grid_v, grid_v], axis=-1) / scales
    V = np.einsum("...i,ij,...j->...", y, region.P, y)
    axes.contour(rest + x, v, V.T, levels=[1.0], colors=[COLORS["robot"]])
    axes.plot([], [], color=COLORS["robot"], label="sum of squares, with motor lag")
    axes.plot(rest, 0.0, "o", color=COLORS["obstacle"], markersize=4)
    axes.axvline(region.contact_m, color=COLORS["source"], linewidth=1.0)
    axes.set_xlabel("clearance c (m)")
    axes.set_ylabel("v = w (m/s)")
    axes.set_title(
        f"{model.contact.law.name}: with the lag {region.energy_collisions} of "
        f"{region.energy_starts} starts that the energy certifies touch, and "
        f"{region.collisions} of {region.starts} in the region",
        fontsize=10,
    )
    axes.grid(color="#EEEEEE")
    axes.legend(fontsize=8, loc="upper right")
    return figure


def plot_disturbance_bounds(bounds: DisturbanceBounds) -> Figure:
    """Plots the stretch over the source's speed, and the certified encounter time."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    source, obstacle = figure.subplots(1, 2)
    straight = [row for row in bounds.source if row.acceleration_m_s2 == 0.0]
    for name, label, style in (
        ("bound_m", "proved", "-"),
        ("linear_peak_m", "largest, linear", "--"),
        ("simulated_m", "simulated", "o"),
        ("steady_m", "steady", ":"),
    ):
        speeds, stretches = _points(straight, name)
        source.plot(speeds, stretches, style, color=COLORS["robot"], label=label)
    source.set_xlabel("speed of the source (m/s)")
    source.set_ylabel("largest |stretch| (m)")
    source.set_title("following a source that moves off", fontsize=11)
    for name, label, style, color in (
        ("certified_s", "certified", "-", "robot"),
        ("encounter_s", "passing through the reach", "--", "obstacle"),
        ("simulated_contact_s", "earliest simulated contact", "x", "source"),
    ):
        speeds, times = _points(bounds.obstacle, name)
        obstacle.semilogy(speeds, times, style, color=COLORS[color], label=label)
    obstacle.set_xlabel("speed of the obstacle (m/s)")
    obstacle.set_ylabel("time (s)")
    obstacle.set_title("an obstacle that comes at a waiting robot", fontsize=11)
    for axes in (source, obstacle):
        axes.grid(color="#EEEEEE", which="both")
        axes.legend(fontsize=8)
    source.set_ylim(bottom=0.0)
    return figure


def _points(
    rows: Sequence[SourceBound | ObstacleBound], name: str
) -> tuple[list[float], list[float]]:
    """Speeds and values of a field, from the rows in which the field is not None."""
    found = [row for row in rows if getattr(row, name) is not None]
    return [row.speed_m_s for row in found], [getattr(row, name) for row in found]
