"""Plots of certified sets of initial states, of simulated trials, and of energies."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from analysis.energy.certificate_trials import CertificateTrials
from analysis.energy.energy_certificate import EnergyCertificate
from analysis.energy.velocity_passivity import EnergyBalance
from analysis.loops.point_mass import PointMass
from analysis.report.palette import COLORS
from systems.world.shapes import rectangle_outline


def draw_bodies(axes: Axes, model: PointMass) -> None:
    """Draws bodies, a circle at the follow distance, and the start of control point P.

    Args:
        axes: Axes to draw in. The function sets their labels and an equal scale.
        model: Point-mass model with bodies, source and start, in the world frame W.
    """
    for k, rectangle in enumerate(model.rectangles):
        is_source = k == len(model.rectangles) - 1
        color = COLORS["source" if is_source else "obstacle"]
        axes.add_patch(Polygon(rectangle_outline(rectangle), color=color, zorder=3))
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    ring = model.p_WS + model.follow_distance_m * np.array(
        [np.cos(angle), np.sin(angle)]
    ).T.reshape(-1, 2)
    axes.plot(*ring.T, ":", color=COLORS["source"], linewidth=1.0, zorder=3)
    axes.plot(*model.p_WP, "+", color=COLORS["robot"], markersize=10, zorder=4)
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
    """Plots the starts of trials by outcome, over the region certified at rest.

    The number after each label counts all starts of this kind. At most 2000 of them are
    drawn.
    """
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
    for starts, marker, color, label in (
        (trials.inside.starts, ".", COLORS["robot"], "certified"),
        (trials.outside.starts[~hit], ".", COLORS["echo"], "not certified, safe"),
        (trials.outside.starts[hit], "x", COLORS["source"], "collides"),
    ):
        axes.plot(
            *starts[:2000, :2].T,
            marker,
            color=color,
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
    """Plots energies and the clearance of P along one run.

    The energies are the total energy V, the energy that the damping D_r has removed,
    and the energy that the velocity term of the law has added.
    """
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.0, 1.0])
    for energies, color, label in (
        (balance.energies_j, "robot", "V"),
        (balance.dissipated_j, "empty", "taken by $D_r$"),
        (balance.injected_j, "source", "given by the velocity term"),
    ):
        above.plot(balance.times_s, energies, color=COLORS[color], label=label)
    above.set_ylabel("energy (J)")
    above.legend(loc="center right")
    below.plot(balance.times_s, balance.clearances_m, color=COLORS["obstacle"])
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
