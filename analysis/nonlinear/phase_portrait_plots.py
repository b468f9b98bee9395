"""Picture of the head-on phase plane."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from analysis.nonlinear.phase_portrait import PhasePortrait
from analysis.reporting.palette import COLOURS

__all__ = ["plot_phase_portrait"]


def plot_phase_portrait(portrait: PhasePortrait) -> Figure:
    """Flow, basin of contact, certified region, equilibria and some runs."""
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    axes = figure.subplots()
    c, rate = portrait.clearances_m, portrait.rates_m_s
    for mask, colour in (
        (portrait.certified, "#DCEBF7"),
        (portrait.collides, "#F6D3BF"),
    ):
        axes.contourf(c, rate, mask.T.astype(float), levels=[0.5, 1.5], colors=[colour])
    axes.streamplot(
        c,
        rate,
        np.broadcast_to(rate[:, None], (len(rate), len(c))),
        portrait.accelerations_m_s2.T,
        color="#BBBBBB",
        linewidth=0.6,
        density=1.1,
        arrowsize=0.7,
    )
    for track in portrait.trajectories:
        axes.plot(*track.T, color=COLOURS["robot"], linewidth=1.0)
        axes.plot(*track[0], "o", color=COLOURS["robot"], markersize=3)
    for place in portrait.contact.equilibria_m:
        held = portrait.contact.slope(place) < 0.0
        axes.plot(
            place,
            0.0,
            "o",
            color=COLOURS["obstacle"],
            markerfacecolor=COLOURS["obstacle"] if held else "white",
            zorder=5,
        )
    axes.set_xlim(0.0, c[-1])
    axes.set_ylim(rate[0], rate[-1])
    axes.axvline(portrait.contact_m, color=COLOURS["source"], linewidth=1.0)
    axes.set_xlabel("clearance c (m)")
    axes.set_ylabel("dc/dt (m/s)")
    axes.set_title(
        f"{portrait.contact.law.name}, {portrait.contact.to_go_m:.1f} m to go behind "
        f"the obstacle: certified / safe = {portrait.ratio:.3f}",
        fontsize=11,
    )
    figure.legend(
        handles=[
            Patch(color="#DCEBF7", label="certified"),
            Patch(facecolor="white", edgecolor="#BBBBBB", label="safe, not certified"),
            Patch(color="#F6D3BF", label="touches"),
        ],
        loc="outside lower center",
        ncols=3,
    )
    return figure
