"""Pictures of the velocity terms and of the oscillation before an obstacle."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.nonlinear.contact_oscillation import ContactOscillation
from analysis.nonlinear.velocity_terms import VelocityTermAnalysis
from analysis.reporting.palette import COLOURS

__all__ = ["plot_contact_oscillation", "plot_velocity_terms"]

_STYLES = {"printed": (COLOURS["robot"], "-"), "closing": (COLOURS["source"], "--")}


def plot_velocity_terms(analysis: VelocityTermAnalysis) -> Figure:
    """One-sided poles, and bias and damping by speed amplitude.

    Dots: the controller's own difference over a tick.
    """
    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    plane, bias, damping = figure.subplots(1, 3)
    for name, variant in analysis.variants.items():
        colour, line = _STYLES[name]
        for side, marker in ((variant.approaching, "<"), (variant.receding, ">")):
            size = 9 if name == "printed" else 5
            plane.plot(
                side.poles.real,
                side.poles.imag,
                marker,
                color=colour,
                markersize=size,
                linestyle="none",
                label=f"{name}, {side.direction}",
            )
        found = variant.describing
        for axes, exact, sampled in (
            (bias, found.bias_n, found.sampled_bias_n),
            (damping, found.damping_n_s_m, found.sampled_damping_n_s_m),
        ):
            axes.plot(found.amplitudes_m_s, exact, line, color=colour, label=name)
            axes.plot(
                found.amplitudes_m_s[::3], sampled[::3], ".", color=colour, markersize=5
            )
    plane.axvline(0.0, color=COLOURS["empty"], linewidth=0.8)
    plane.set_xlabel("real part (1/s)")
    plane.set_ylabel("imaginary part (rad/s)")
    plane.set_title("one-sided poles", fontsize=11)
    plane.legend(fontsize=8, loc="center left")
    for axes, title, unit in (
        (bias, "bias away from the obstacle", "N"),
        (damping, "damping by the first harmonic", "N s/m"),
    ):
        axes.set_xlabel("speed amplitude (m/s)")
        axes.set_ylabel(f"{unit}")
        axes.set_title(title, fontsize=11)
        axes.legend(fontsize=8)
    for axes in (plane, bias, damping):
        axes.grid(color="#EEEEEE")
    return figure


def plot_contact_oscillation(oscillation: ContactOscillation) -> Figure:
    """Simulated clearance; growth and centre by amplitude, predicted and simulated."""
    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    motion, growth, centre = figure.subplots(1, 3)
    largest = 0.0
    for name, run in oscillation.runs.items():
        colour, line = _STYLES[name]
        predicted = oscillation.predictions[name]
        motion.plot(run.times_s, run.clearances_m, color=colour, linewidth=0.9)
        for axes, curve, dots in (
            (growth, predicted.growth_per_s, run.growth_per_s),
            (centre, predicted.centres_m, run.centres_m),
        ):
            axes.plot(predicted.amplitudes_m, curve, line, color=colour, label=name)
            axes.plot(run.amplitudes_m, dots, ".", color=colour, markersize=6)
        largest = max(largest, float(run.amplitudes_m.max(initial=0.05)))
    motion.axhline(
        oscillation.contact.equilibrium_m, color=COLOURS["empty"], linewidth=0.8
    )
    _label(motion, "time (s)", "clearance (m)", "simulated build, head-on")
    growth.axhline(0.0, color=COLOURS["empty"], linewidth=0.8)
    _label(growth, "amplitude (m)", "growth (1/s)", "growth: lines predicted")
    _label(centre, "amplitude (m)", "centre (m)", "centre: dots simulated")
    for axes in (growth, centre):
        axes.set_xlim(0.0, 1.2 * largest)
        axes.legend(fontsize=8)
    _fit(growth, oscillation, "growth_per_s", 1.2 * largest)
    _fit(centre, oscillation, "centres_m", 1.2 * largest)
    return figure


def _label(axes: Axes, x: str, y: str, title: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, fontsize=11)
    axes.grid(color="#EEEEEE")


def _fit(axes: Axes, oscillation: ContactOscillation, name: str, reach: float) -> None:
    """Limits of y by what lies within the limits of x."""
    values = [getattr(run, name) for run in oscillation.runs.values()]
    for prediction in oscillation.predictions.values():
        near = prediction.amplitudes_m <= reach
        values.append(getattr(prediction, name)[near])
    shown = np.concatenate(values)
    if len(shown):
        margin = 0.1 * max(float(np.ptp(shown)), 1e-3)
        axes.set_ylim(shown.min() - margin, shown.max() + margin)
