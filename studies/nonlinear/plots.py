"""Figures of velocity terms, phase planes, and places where robots jam."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from analysis.report.palette import COLORS
from studies.nonlinear.contact_oscillation import ContactOscillation
from studies.nonlinear.equilibrium_maps import BOX_X_M, EquilibriumMap
from studies.nonlinear.phase_portrait import PhasePortrait
from studies.nonlinear.stiffness_ratio import RatioMap
from studies.nonlinear.velocity_terms import VelocityTermAnalysis

_STYLES = {"printed": (COLORS["robot"], "-"), "closing": (COLORS["source"], "--")}


def plot_velocity_terms(analysis: VelocityTermAnalysis) -> Figure:
    """Plots one-sided poles, and bias and damping by speed amplitude.

    Dots show the values with the speed that the controller computes over one period.

    Args:
        analysis: Models of both velocity terms.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    plane, bias, damping = figure.subplots(1, 3)
    for name, variant in analysis.variants.items():
        color, line = _STYLES[name]
        for side, marker in ((variant.approaching, "<"), (variant.receding, ">")):
            size = 9 if name == "printed" else 5
            plane.plot(
                side.poles.real,
                side.poles.imag,
                marker,
                color=color,
                markersize=size,
                linestyle="none",
                label=f"{name}, {side.direction}",
            )
        found = variant.describing
        for axes, exact, sampled in (
            (bias, found.bias_n, found.sampled_bias_n),
            (damping, found.damping_n_s_m, found.sampled_damping_n_s_m),
        ):
            axes.plot(found.amplitudes_m_s, exact, line, color=color, label=name)
            axes.plot(
                found.amplitudes_m_s[::3], sampled[::3], ".", color=color, markersize=5
            )
    plane.axvline(0.0, color=COLORS["empty"], linewidth=0.8)
    _label(plane, "real part (1/s)", "imaginary part (rad/s)", "one-sided poles")
    plane.legend(fontsize=8, loc="center left")
    amplitude = "speed amplitude (m/s)"
    _label(bias, amplitude, "N", "bias away from the obstacle")
    _label(damping, amplitude, "N s/m", "damping by the first harmonic")
    for axes in (bias, damping):
        axes.legend(fontsize=8)
    return figure


def plot_contact_oscillation(oscillation: ContactOscillation) -> Figure:
    """Plots the clearance over time, and growth rate and center by amplitude."""
    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    motion, growth, center = figure.subplots(1, 3)
    largest = 0.0
    for name, run in oscillation.runs.items():
        color, line = _STYLES[name]
        predicted = oscillation.predictions[name]
        motion.plot(run.times_s, run.clearances_m, color=color, linewidth=0.9)
        for axes, curve, dots in (
            (growth, predicted.growth_per_s, run.growth_per_s),
            (center, predicted.centers_m, run.centers_m),
        ):
            axes.plot(predicted.amplitudes_m, curve, line, color=color, label=name)
            axes.plot(run.amplitudes_m, dots, ".", color=color, markersize=6)
        largest = max(largest, float(run.amplitudes_m.max(initial=0.05)))
    motion.axhline(
        oscillation.contact.equilibrium_m, color=COLORS["empty"], linewidth=0.8
    )
    _label(motion, "time (s)", "clearance (m)", "simulated build, head-on")
    growth.axhline(0.0, color=COLORS["empty"], linewidth=0.8)
    _label(growth, "amplitude (m)", "growth (1/s)", "growth: lines predicted")
    _label(center, "amplitude (m)", "center (m)", "center: dots simulated")
    for axes in (growth, center):
        axes.set_xlim(0.0, 1.2 * largest)
        axes.legend(fontsize=8)
    _fit(growth, oscillation, "growth_per_s", 1.2 * largest)
    _fit(center, oscillation, "centers_m", 1.2 * largest)
    return figure


def _label(axes: Axes, x: str, y: str, title: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, fontsize=11)
    axes.grid(color="#EEEEEE")


def _fit(axes: Axes, oscillation: ContactOscillation, name: str, reach: float) -> None:
    """Sets the limits of y to the values within the limits of x."""
    values = [getattr(run, name) for run in oscillation.runs.values()]
    for prediction in oscillation.predictions.values():
        near = prediction.amplitudes_m <= reach
        values.append(getattr(prediction, name)[near])
    shown = np.concatenate(values)
    if len(shown):
        margin = 0.1 * max(float(np.ptp(shown)), 1e-3)
        axes.set_ylim(shown.min() - margin, shown.max() + margin)


def plot_phase_portrait(portrait: PhasePortrait) -> Figure:
    """Plots flow, basin of contact, certified region, equilibria and some runs."""
    figure = Figure(figsize=(9.0, 4.6), layout="constrained")
    axes = figure.subplots()
    c, rate = portrait.clearances_m, portrait.rates_m_s
    for mask, color in (
        (portrait.certified, "#DCEBF7"),
        (portrait.collides, "#F6D3BF"),
    ):
        axes.contourf(c, rate, mask.T.astype(float), levels=[0.5, 1.5], colors=[color])
    axes.streamplot(
        c,
        rate,
        np.broadcast_to(rate[:, None], (len(rate), len(c))),
        portrait.accelerations_m_s2.T,
        color="#8C8C8C",
        linewidth=0.6,
        density=1.1,
        arrowsize=0.7,
    )
    for track in portrait.trajectories:
        axes.plot(*track.T, color=COLORS["robot"], linewidth=1.0)
        axes.plot(*track[0], "o", color=COLORS["robot"], markersize=3)
    for place in portrait.contact.equilibria_m:
        held = portrait.contact.slope(place) < 0.0
        axes.plot(
            place,
            0.0,
            "o",
            color=COLORS["obstacle"],
            markerfacecolor=COLORS["obstacle"] if held else "white",
            zorder=5,
        )
    axes.set_xlim(0.0, c[-1])
    axes.set_ylim(rate[0], rate[-1])
    axes.axvline(portrait.contact_m, color=COLORS["source"], linewidth=1.0)
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
            Patch(facecolor="white", edgecolor="#8C8C8C", label="safe, not certified"),
            Patch(color="#F6D3BF", label="touches"),
        ],
        loc="outside lower center",
        ncols=3,
    )
    return figure


_MARKERS = {
    "goal": (".", COLORS["empty"], "beyond the boxes"),
    "jam": ("o", COLORS["source"], "held before them"),
    "collision": ("x", COLORS["obstacle"], "hits a box"),
}
_NAMES = {
    "gap_m": "gap between two boxes (m)",
    "offset_m": "offset of one box from the line (m)",
}


def plot_equilibrium_maps(maps: Sequence[EquilibriumMap]) -> Figure:
    """Plots x of the places of rest over the parameter, with one panel per map.

    A line shows x of the boxes.

    Args:
        maps: Maps to plot.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(3.4 * len(maps), 3.6), layout="constrained")
    panels = figure.subplots(1, len(maps), sharey=True, squeeze=False)[0]
    for axes, found in zip(panels, maps, strict=True):
        for outcome, (marker, color, label) in _MARKERS.items():
            points = [p for p in found.points if p.outcome == outcome]
            if points:
                axes.plot(
                    [p.value for p in points],
                    [p.x_m for p in points],
                    marker,
                    color=color,
                    label=label,
                )
        axes.axhline(BOX_X_M, color=COLORS["obstacle"], linewidth=0.8)
        _label(axes, _NAMES[found.parameter], "", f"{found.law}, {found.sensing}")
        axes.legend(fontsize=8)
    panels[0].set_ylabel("x of P at rest (m)")
    return figure


def plot_ratio_map(found: RatioMap) -> Figure:
    """Plots the head-on equilibria of the active law over k_ref/K_0."""
    figure = Figure(figsize=(6.0, 3.8), layout="constrained")
    axes = figure.subplots()
    outer = "held along the line, not to the side: saddle"
    inner = "the push vanishes, P moves on: source"
    ratios, colors = found.ratios, COLORS
    axes.semilogx(ratios, found.outer_m, "-", color=colors["robot"], label=outer)
    axes.semilogx(ratios, found.inner_m, "--", color=colors["source"], label=inner)
    axes.axvline(found.today, color=COLORS["empty"], linewidth=0.8)
    axes.set_xticks(
        [1.5, 2, 4, 8, 16, 32, 64], ["1.5", "2", "4", "8", "16", "32", "64"]
    )
    axes.minorticks_off()
    title = f"one small obstacle, {found.to_go_m:.1f} m to go behind it"
    _label(axes, "$k_{ref}/K_0$ (line: the scenario's)", "clearance (m)", title)
    axes.set_ylim(0.0, 1.6)
    axes.legend(fontsize=8)
    return figure
