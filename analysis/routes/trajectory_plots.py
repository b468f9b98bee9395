"""Plots poles, bounds of the gains, adaptation and chains of robots on routes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from analysis.report.palette import COLORS, SERIES_COLORS, draw_grid
from analysis.routes.adaptation_stability import AdaptationStability
from analysis.routes.chain_run import BrakedChain, ChainRun
from analysis.routes.frozen_gains import WELL_DAMPED, FrozenPoint, GainBounds
from analysis.routes.robot_chain import RobotChain

_LINES = SERIES_COLORS[1:]
_MARKS = "osD^v"
#: Largest plotted amplification.
_HIGHEST = 4.0


def plot_frozen_poles(points: Sequence[FrozenPoint]) -> Figure:
    """Plots the poles at each operating point in the s plane.

    Two lines mark the damping ratio ``WELL_DAMPED``.
    """
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.subplots()
    for k, point in enumerate(points):
        poles = point.model.s_poles
        axes.plot(
            poles.real,
            poles.imag,
            _MARKS[k % len(_MARKS)],
            # Markers of different sizes do not hide one another.
            markersize=10 - 1.5 * k,
            markerfacecolor="none",
            markeredgecolor=_LINES[k % len(_LINES)],
            markeredgewidth=1.5,
            label=point.at.name,
        )
    _, left = axes.get_ylim(), axes.get_xlim()[0]
    slope = np.sqrt(1.0 / WELL_DAMPED**2 - 1.0)
    fastest = max(float(np.abs(p.model.s_poles.imag).max()) for p in points)
    reach = max(4.0, 1.3 * fastest)
    for sign in (1.0, -1.0):
        axes.plot(
            [0.0, left],
            [0.0, -sign * slope * left],
            "--",
            color=COLORS["empty"],
            linewidth=0.8,
            label=f"damping ratio {WELL_DAMPED:g}" if sign > 0.0 else None,
        )
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("Re s (1/s)")
    axes.set_ylabel("Im s (rad/s)")
    draw_grid(axes)
    axes.legend(fontsize=8)
    return figure


def plot_gain_bounds(bounds: GainBounds) -> Figure:
    """Plots bounds of the sum of all springs over the sum of all dampers.

    Below the bounds, the loop is stable or has a damping ratio of at least
    ``WELL_DAMPED``. Markers show the gains of the scenario.
    """
    figure = Figure(figsize=(7.2, 5.0), layout="constrained")
    axes = figure.subplots()
    damping = bounds.damping_n_s_m
    for k, late in enumerate(bounds.late_ticks):
        style, when = ("-", "--")[k], ("as built", f"{late} tick late")[k]
        for values, color, what in (
            (bounds.stable_n_m, _LINES[0], "stable below"),
            (bounds.damped_n_m, _LINES[1], f"damping ratio {WELL_DAMPED:g} below"),
        ):
            shown = np.where(values[:, k] > 0.0, values[:, k], np.nan)
            axes.loglog(damping, shown, style, color=color, label=f"{what}, {when}")
    axes.axvline(
        bounds.closed_damping_n_s_m,
        color="black",
        linewidth=0.8,
        linestyle=":",
        label="2 M/T",
    )
    for k, (name, (stiffness, value)) in enumerate(bounds.today.items()):
        axes.plot(
            value,
            stiffness,
            "*" if k == 0 else "P",
            color=COLORS["sound"],
            markeredgecolor="black",
            markersize=14 if k == 0 else 9,
            linestyle="none",
            label=f"current, {name}",
        )
    if bounds.box is not None:
        (low_k, high_k), (low_d, high_d) = bounds.box
        axes.add_patch(
            Rectangle(
                (low_d, low_k),
                high_d - low_d,
                high_k - low_k,
                facecolor=COLORS["left"],
                alpha=0.35,
                label="bounds of the adaptation",
            )
        )
    axes.set_xlabel("sum of all dampers (N s/m)")
    axes.set_ylabel("sum of all springs (N/m)")
    axes.grid(visible=True, which="both", linewidth=0.3)
    axes.legend(fontsize=8)
    return figure


def plot_adaptation(found: AdaptationStability) -> Figure:
    """Plots the stiffness K over time while a constant force pushes the robot.

    If the rule has a Lyapunov function V, a second panel shows V over time.
    """
    both = found.lyapunov is not None
    figure = Figure(figsize=(9.4 if both else 5.4, 3.8), layout="constrained")
    cells = figure.subplots(1, 2 if both else 1, squeeze=False)[0]
    if found.lyapunov is not None:
        run, axes = found.lyapunov, cells[0]
        axes.semilogy(
            run.time_s, run.continuous, color=_LINES[1], label="continuous time"
        )
        axes.semilogy(run.time_s, run.sampled, color=_LINES[0], label="sampled")
        axes.set_xlabel("time (s)")
        axes.set_ylabel("V/V(0)")
        draw_grid(axes)
        axes.legend(fontsize=8)
    axes, drift = cells[-1], found.drift
    axes.semilogx(
        drift.time_s,
        drift.gradient_n_m,
        "o",
        color="black",
        label="closed form of the gradient",
    )
    for k, name in enumerate(("without limits", "as set")):
        axes.semilogx(
            drift.curve_s,
            drift.curves_n_m[:, k],
            "-" if k == 0 else "--",
            color=_LINES[k],
            label=f"{found.rule}, {name}",
        )
    axes.set_xlabel(f"time under a push of {drift.push_n:.3g} N (s)")
    axes.set_ylabel("K (N/m)")
    draw_grid(axes)
    axes.legend(fontsize=8)
    return figure


def plot_chain(chain: RobotChain, runs: Sequence[ChainRun]) -> Figure:
    """Plots in three panels how much chains of robots amplify motions.

    The amplification is the amplitude of a robot divided by that of the first robot:

    - Left: amplification by two robots over frequency.
    - Middle: amplification by eight robots over the number of the robot, at one
      frequency. Dots show the simulations ``runs``.
    - Right: largest amplification by two robots over the damping D.
    """
    figure = Figure(figsize=(11.4, 3.9), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    for k, (name, peak) in enumerate(chain.peaks.items()):
        gain = np.clip(peak.gain[:, 0], 0.0, _HIGHEST)
        left.semilogx(peak.omega, gain, color=_LINES[k], label=name)
    left.set_xlabel("frequency (rad/s)")
    left.set_ylabel("amplitude of the second robot over the first")
    for k, run in enumerate(runs):
        robots = np.arange(1, len(run.simulated) + 1)
        middle.semilogy(robots, run.predicted, color=_LINES[k], label=run.name)
        middle.semilogy(robots, run.simulated, "o", color=_LINES[k], markersize=4)
    middle.set_xlabel("robot (line: response, dots: simulated)")
    middle.set_ylabel("amplitude over the first robot")
    for k, name in enumerate(("with feed-forward", "without feed-forward")):
        right.semilogx(
            chain.dampings, chain.peaks_by_damping[:, k], color=_LINES[k], label=name
        )
    right.axvline(
        chain.damping_n_s_m, color=COLORS["empty"], linestyle="--", label="current"
    )
    right.set_ylim(0.8, _HIGHEST)
    right.set_xlabel(f"D (N s/m) at K = {chain.stiffness_n_m:g} N/m")
    right.set_ylabel("largest amplification by a pair")
    for axes in (left, middle, right):
        axes.axhline(1.0, color="black", linewidth=0.8)
        axes.grid(visible=True, linewidth=0.3)
        axes.legend(fontsize=7)
    return figure


def plot_braked_chains(chains: Sequence[BrakedChain]) -> Figure:
    """Plots the gaps between neighbors after the first robot begins to brake."""
    figure = Figure(figsize=(11.4, 3.2), layout="constrained")
    cells = figure.subplots(1, len(chains), squeeze=False)[0]
    for axes, chain in zip(cells, chains, strict=True):
        count = chain.gap_m.shape[1]
        for k in range(count):
            shade = 0.15 + 0.75 * k / max(count - 1, 1)
            axes.plot(
                chain.time_s,
                chain.gap_m[:, k],
                color=(0.0, 0.25 + 0.5 * shade, 1.0 - 0.6 * shade),
                linewidth=0.9,
                label=f"{k + 1} and {k + 2}" if k in (0, count - 1) else None,
            )
        axes.set_title(chain.name, fontsize=9)
        axes.set_xlabel("time (s)")
        axes.set_ylabel("gap (m)")
        draw_grid(axes)
        axes.legend(fontsize=7, title="robots", title_fontsize=7)
    return figure
