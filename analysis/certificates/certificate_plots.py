"""Plots certified sets and simulated trials."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from analysis.certificates.certificate_trials import CertificateTrials
from analysis.certificates.disturbance_bounds import (
    DisturbanceBounds,
    ObstacleBound,
    SourceBound,
)
from analysis.certificates.energy_certificate import EnergyCertificate
from analysis.certificates.sos_region import SosRegion
from analysis.models.point_mass import PointMass
from analysis.nonlinear.phase_portrait import certified_speeds, head_on_model
from analysis.nonlinear.velocity_passivity import EnergyBalance
from analysis.reporting.palette import COLOURS
from systems.world.geometry import rectangle_corners


def draw_bodies(axes: Axes, model: PointMass) -> None:
    """Draws obstacles, the source's body, the follow distance and control point P.

    Args:
        axes: Axes to draw in. The function sets their labels and an equal scale.
        model: Point-mass model with bodies, source and start, in the world frame W.
    """
    for k, rectangle in enumerate(model.rectangles):
        is_source = k == len(model.rectangles) - 1
        colour = COLOURS["source" if is_source else "obstacle"]
        axes.add_patch(Polygon(rectangle_corners(rectangle), color=colour, zorder=3))
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    ring = model.p_WS + model.follow_distance_m * np.array(
        [np.cos(angle), np.sin(angle)]
    ).T.reshape(-1, 2)
    axes.plot(*ring.T, ":", color=COLOURS["source"], linewidth=1.0, zorder=3)
    axes.plot(*model.p_WP, "+", color=COLOURS["robot"], markersize=10, zorder=4)
    axes.set_aspect("equal")
    axes.set_xlabel("x of P (m)")
    axes.set_ylabel("y of P (m)")


def plot_energy_certificate(certificate: EnergyCertificate) -> Figure:
    """Plots a map of the largest speed from which the robot provably never collides.

    In white areas, not even a robot at rest is certified. The dotted ring is the follow
    distance. The cross is the robot's control point at the start of the scenario.
    """
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    axes = figure.subplots()
    speed = certificate.largest_speed().T
    image = axes.pcolormesh(
        certificate.x_m,
        certificate.y_m,
        speed,
        cmap="viridis",
        vmin=0.0,
        vmax=certificate.model.top_speed_m_s,
        shading="nearest",
        rasterized=True,
    )
    figure.colorbar(image, ax=axes, label="largest certified speed (m/s)")
    draw_bodies(axes, certificate.model)
    axes.set_xlim(certificate.x_m[0], certificate.x_m[-1])
    axes.set_ylim(certificate.y_m[0], certificate.y_m[-1])
    axes.set_title(
        f"{certificate.model.law.name}: {100 * certificate.rest_share:.1f} % of the "
        f"floor certified at rest, {100 * certificate.any_speed_share:.1f} % at any "
        "speed",
        fontsize=11,
    )
    return figure


def plot_certificate_trials(trials: CertificateTrials) -> Figure:
    """Plots starts by outcome, over the region that is certified at rest."""
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    axes = figure.subplots()
    certificate = trials.certificate
    axes.contourf(
        certificate.x_m,
        certificate.y_m,
        np.isfinite(certificate.largest_speed()).T.astype(float),
        levels=[0.5, 1.5],
        colors=["#DCEBF7"],
        zorder=0,
    )
    hit = trials.outside.collided
    for starts, marker, colour, label in (
        (trials.inside.starts, ".", COLOURS["robot"], "certified"),
        (trials.outside.starts[~hit], ".", COLOURS["echo"], "not certified, safe"),
        (trials.outside.starts[hit], "x", COLOURS["source"], "collides"),
    ):
        axes.plot(
            *starts[:2000, :2].T,
            marker,
            color=colour,
            markersize=4,
            label=f"{label}: {len(starts)}",
            zorder=2,
        )
    draw_bodies(axes, certificate.model)
    axes.set_xlim(certificate.x_m[0], certificate.x_m[-1])
    axes.set_ylim(certificate.y_m[0], certificate.y_m[-1])
    figure.legend(
        *axes.get_legend_handles_labels(), loc="outside lower center", ncols=3
    )
    axes.set_title(
        f"{certificate.model.law.name}: {len(trials.inside.starts)} starts inside and "
        f"{len(trials.outside.starts)} outside, certified / safe = {trials.ratio:.3f}",
        fontsize=11,
    )
    return figure


def plot_energy_balance(balance: EnergyBalance) -> Figure:
    """Plots energy, and work of the velocity term and of D_r, along one run."""
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    for energies, colour, label in (
        (balance.energies_j, "robot", "V"),
        (balance.dissipated_j, "empty", "taken by $D_r$"),
        (balance.injected_j, "source", "given by the velocity term"),
    ):
        above.plot(balance.times_s, energies, color=COLOURS[colour], label=label)
    above.set_ylabel("energy (J)")
    above.legend(loc="center right")
    below.plot(balance.times_s, balance.clearances_m, color=COLOURS["obstacle"])
    below.set_ylabel("clearance of P (m)")
    below.set_xlabel("time (s)")
    below.set_ylim(bottom=0.0)
    for axes in (above, below):
        axes.grid(color="#EEEEEE")
    passivity = balance.passivity
    above.set_title(
        f"{passivity.velocity_term} velocity term: gives at most "
        f"{passivity.largest_injection_n_s_m:.2f} $|v|^2$, $D_r$ takes "
        f"{passivity.attraction_damping_n_s_m:.2f} $|v|^2$",
        fontsize=11,
    )
    return figure


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
    axes.contour(rest + x, v, V.T, levels=[1.0], colors=[COLOURS["robot"]])
    axes.plot([], [], color=COLOURS["robot"], label="sum of squares, with motor lag")
    axes.plot(rest, 0.0, "o", color=COLOURS["obstacle"], markersize=4)
    axes.axvline(region.contact_m, color=COLOURS["source"], linewidth=1.0)
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
        source.plot(speeds, stretches, style, color=COLOURS["robot"], label=label)
    source.set_xlabel("speed of the source (m/s)")
    source.set_ylabel("largest |stretch| (m)")
    source.set_title("following a source that moves off", fontsize=11)
    for name, label, style, colour in (
        ("certified_s", "certified", "-", "robot"),
        ("encounter_s", "passing through the reach", "--", "obstacle"),
        ("simulated_contact_s", "earliest simulated contact", "x", "source"),
    ):
        speeds, times = _points(bounds.obstacle, name)
        obstacle.semilogy(speeds, times, style, color=COLOURS[colour], label=label)
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
