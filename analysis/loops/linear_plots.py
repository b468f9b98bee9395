"""Figures of operating points, loops, delays, contact, and uncertain parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from analysis.loops.contact_mode import ContactLimits
from analysis.loops.delayed_run import DelayCheck
from analysis.loops.equilibria import EquilibriumSearch
from analysis.loops.equilibrium_search import CellSearch
from analysis.loops.force_field import ForceField
from analysis.loops.gang_of_four import GangOfFour
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.linear_models import s_plane
from analysis.loops.margin_results import FrequencyResponse, LoopMargins
from analysis.loops.robustness import (
    PoleCloud,
    PoleSensitivity,
)
from analysis.loops.step_response import StepCheck
from analysis.report.palette import COLORS, draw_grid
from analysis.report.shape_patch import shape_patch

#: Marker, color and title of each kind of equilibrium.
_KINDS = {
    "sink": ("o", COLORS["robot"], "sink"),
    "saddle": ("X", COLORS["echo"], "saddle"),
    "source": ("^", COLORS["source"], "source"),
}


def plot_equilibria(search: EquilibriumSearch) -> Figure:
    """Plots bodies, streamlines of the force on P at rest, and all places of rest."""
    figure = Figure(figsize=(8.2, 6.2), layout="constrained")
    axes = figure.subplots()
    x0, x1, y0, y1 = search.area_m
    field = CellSearch(ForceField(ideal_loop(search.scenario)))
    x, y = np.meshgrid(np.linspace(x0, x1, 90), np.linspace(y0, y1, 80))
    force = field.forces(np.column_stack([x.ravel(), y.ravel()])).reshape(*x.shape, 2)
    axes.streamplot(
        x, y, force[..., 0], force[..., 1], color="#8C8C8C", linewidth=0.6,
        arrowsize=0.7, density=1.6,
    )  # fmt: skip
    for name, body in search.scenario.bodies().items():
        color = COLORS["source" if name == "source" else "obstacle"]
        pose = body.path.pose(0.0)
        axes.add_patch(shape_patch(body.shape, pose, facecolor=color, alpha=0.8))
    drawn = set()
    for point in search.points:
        marker, color, title = _KINDS[point.kind]
        label = None if title in drawn else title
        drawn.add(title)
        axes.plot(
            *point.p_WP, marker, color=color, markersize=9, label=label,
            markeredgecolor="black", linestyle="none", zorder=4,
        )  # fmt: skip
        if point.continuum:
            angle = np.linspace(0.0, 2.0 * np.pi, 200)
            px, py = point.p_WS
            radius = point.source_distance_m
            axes.plot(
                px + radius * np.cos(angle), py + radius * np.sin(angle), "--",
                color=color, linewidth=1.0, label="continuum",
            )  # fmt: skip
    for switch in search.switching:
        title = "attractive switching point" if switch.attractive else "switching point"
        label = None if title in drawn else title
        drawn.add(title)
        axes.plot(
            *switch.p_WP, "s", color=COLORS["estimate"], markersize=7, zorder=4,
            markeredgecolor="black", linestyle="none", label=label,
            fillstyle="full" if switch.attractive else "none",
        )  # fmt: skip
    axes.set_aspect("equal")
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0, y1)
    axes.set_xlabel("x in W (m)")
    axes.set_ylabel("y in W (m)")
    axes.set_title(f"Forces on P at rest, law: {search.scenario.only.law}", fontsize=10)
    axes.legend(fontsize=8, loc="upper right", framealpha=1.0)
    return figure


def plot_step(check: StepCheck) -> Figure:
    """Plots the distance from the source after a step: predicted and simulated."""
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    axes = figure.subplots()
    for distance, line, color, label in (
        (check.full_m, "-", "echo", "the scenario's sensors"),
        (check.ideal_m, "-", "robot", "exact sensors"),
        (check.predicted_m, "--", "source", "linear model"),
    ):
        if distance is not None:
            axes.plot(check.time_s, distance, line, color=COLORS[color], label=label)
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


_CYCLE = ("#0072B2", "#D55E00", "#009E73", "#A8498A", "#7A5200", "#3A9AD0")
#: Limits of a Nyquist diagram.
_NYQUIST_X, _NYQUIST_Y = (-3.2, 1.2), (-2.2, 2.2)
#: Lowest phase in a Bode diagram, deg.
_LOWEST_PHASE_DEG = -720.0
#: Contours of closed-loop magnitude, dB, with the position of each label: phase, deg,
#: and magnitude, dB. The labels are left of -180 deg, where few loops pass.
_CONTOURS_DB = {
    -12.0: (-330.0, -9.8),
    -6.0: (-330.0, -0.6),
    -3.0: (-330.0, 6.8),
    0.0: (-265.0, 15.2),
    1.0: (-243.0, 6.9),
    3.0: (-225.0, 3.0),
    6.0: (-210.0, 1.3),
    12.0: (-184.0, 2.4),
}


def plot_bode(loops: Sequence[LoopMargins]) -> Figure:
    """Plots magnitude and phase of each loop, and crossovers with phase margins."""
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    lowest = -360.0
    for loop, color in zip(loops, cycle(_CYCLE), strict=False):
        omega, L = loop.response.omega, loop.response.L
        upper.semilogx(omega, _size_db(L), color=color, label=loop.name)
        phase = _phase_deg(loop.response)
        lowest = min(lowest, float(phase.min()))
        lower.semilogx(omega, phase, color=color)
        if math.isfinite(loop.phase_margin_deg):
            at = loop.crossover_rad_s
            reached = float(np.interp(at, omega, phase))
            upper.plot(at, 0.0, "o", color=color, markersize=5)
            lower.plot([at, at], [-180.0, reached], color=color, linewidth=2.5)
    upper.axhline(0.0, color=COLORS["empty"], linewidth=0.8)
    lower.axhline(-180.0, color=COLORS["empty"], linewidth=0.8)
    upper.set_ylabel("|L| (dB)")
    upper.set_ylim(-80.0, 80.0)
    upper.set_yticks(np.arange(-80.0, 81.0, 20.0))
    lower.set_ylabel("phase (deg)")
    bottom = 90.0 * math.floor(max(lowest, _LOWEST_PHASE_DEG) / 90.0)
    lower.set_ylim(bottom - 10.0, 10.0)
    lower.set_yticks(np.arange(bottom, 1.0, 90.0))
    lower.set_xlabel("frequency (rad/s)")
    upper.legend(fontsize=8)
    for axes in (upper, lower):
        axes.grid(visible=True, which="major", linewidth=0.4)
    return figure


def plot_nyquist(loops: Sequence[LoopMargins]) -> Figure:
    """Plots L of each loop near -1, and the disk of its disk margin with skew 0.

    L does not enter the disk.
    """
    figure, cells = panels(len(loops), columns=3, size=(3.6, 3.8))
    for axes, loop in zip(cells, loops, strict=True):
        L = loop.response.L
        axes.plot(L.real, L.imag, color=_CYCLE[0], label="L")
        axes.plot(L.real, -L.imag, color=_CYCLE[0], linewidth=0.7, linestyle=":")
        axes.plot(-1.0, 0.0, "+", color=COLORS["source"], markersize=9)
        low, high = _disk_ends(loop.disk.alpha)
        axes.add_patch(
            Circle(
                ((low + high) / 2.0, 0.0),
                (high - low) / 2.0,
                facecolor=COLORS["source"],
                alpha=0.25,
                label=f"disk, $\\alpha$ = {loop.disk.alpha:.2f}",
            )
        )
        angle = np.linspace(0.0, 2.0 * np.pi, 200)
        axes.plot(np.cos(angle), np.sin(angle), color="#D0D0D0", linewidth=0.7)
        axes.set_xlim(*_NYQUIST_X)
        axes.set_ylim(*_NYQUIST_Y)
        axes.set_aspect("equal")
        axes.set_title(loop.name, fontsize=9)
        axes.set_xlabel("Re L")
        axes.set_ylabel("Im L")
        axes.legend(loc="upper right", fontsize=7)
    return figure


def panels(
    count: int, *, columns: int, size: tuple[float, float]
) -> tuple[Figure, list[Axes]]:
    """Creates a figure with ``count`` panels in rows, each ``size`` inches."""
    columns = min(columns, count)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    cells = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for axes in cells[count:]:
        axes.set_axis_off()
    return figure, cells[:count]


def _size_db(L: NDArray[np.complex128]) -> NDArray[np.float64]:
    return 20.0 * np.log10(np.maximum(np.abs(L), 1e-12))


def _phase_deg(response: FrequencyResponse) -> NDArray[np.float64]:
    """(n,) unwrapped phase, deg, shifted by full turns.

    In the middle of the logarithmic frequency range, it is between -330 and 30 deg.
    """
    omega = response.omega
    phase: NDArray[np.float64] = np.degrees(np.unwrap(np.angle(response.L)))
    middle = np.interp(math.sqrt(omega[0] * omega[-1]), omega, phase)
    return phase - 360.0 * round((float(middle) + 150.0) / 360.0)


def _disk_ends(alpha: float) -> tuple[float, float]:
    """Points at which the disk of skew 0 about -1 meets the real axis: left, right."""
    left = -(2.0 + alpha) / (2.0 - alpha) if alpha < 2.0 else -1e3
    return left, -(2.0 - alpha) / (2.0 + alpha)


def plot_nichols(loops: Sequence[LoopMargins]) -> Figure:
    """Plots magnitude against phase, over contours of equal closed-loop magnitude."""
    figure = Figure(figsize=(7.5, 5.6), layout="constrained")
    axes = figure.subplots()
    _contours(axes)
    for loop, color in zip(loops, cycle(_CYCLE), strict=False):
        L = loop.response.L
        phase = _phase_deg(loop.response)
        axes.plot(phase, _size_db(L), color=color, label=loop.name)
    axes.plot(-180.0, 0.0, "+", color=COLORS["source"], markersize=11)
    axes.set_xlim(-360.0, 0.0)
    axes.set_ylim(-40.0, 40.0)
    axes.set_xticks(np.arange(-360.0, 1.0, 45.0))
    axes.set_xlabel("phase of L (deg)")
    axes.set_ylabel("|L| (dB)")
    axes.legend(fontsize=8, loc="lower left")
    return figure


def _contours(axes: Axes) -> None:
    phase, size = np.meshgrid(np.linspace(-359.5, -0.5, 400), np.linspace(-40, 40, 400))
    L = 10.0 ** (size / 20.0) * np.exp(1j * np.radians(phase))
    drawn = axes.contour(
        phase,
        size,
        20.0 * np.log10(np.abs(L / (1.0 + L))),
        levels=list(_CONTOURS_DB),
        colors="#BBBBBB",
        linewidths=0.6,
        linestyles="solid",
    )
    places = list(_CONTOURS_DB.values())
    axes.clabel(drawn, fmt="%g dB", fontsize=7, colors="#767676", manual=places)


def plot_gang_of_four(gang: GangOfFour) -> Figure:
    """Plots the magnitudes of S, T, PS and CS over frequency, and marks their peaks."""
    figure = Figure(figsize=(8.0, 5.4), layout="constrained")
    titles = {
        "S": "S: remaining error of the estimate",
        "PS": "PS: push to position, m / (m/s$^2$)",
        "CS": "CS: error to acceleration, (m/s$^2$) / m",
        "T": "T = 1 - S",
    }
    for axes, (name, title) in zip(
        figure.subplots(2, 2, sharex=True).ravel(), titles.items(), strict=True
    ):
        size = np.abs(getattr(gang, name))
        axes.loglog(gang.omega, np.maximum(size, 1e-9), color=_CYCLE[0])
        peak = int(size.argmax())
        axes.plot(gang.omega[peak], size[peak], "o", color=COLORS["source"])
        # The label is on the left of a peak that is near the right border.
        at_border = gang.omega[peak] > 0.3 * gang.omega[-1]
        axes.annotate(
            f"{size[peak]:.2f}",
            (gang.omega[peak], size[peak]),
            textcoords="offset points",
            xytext=(-8 if at_border else 8, -3),
            ha="right" if at_border else "left",
            fontsize=8,
        )
        axes.set_title(title, fontsize=9)
        axes.set_ylim(bottom=max(1e-5, 0.3 * size.min()), top=3.0 * size.max())
        axes.grid(visible=True, linewidth=0.4)
        if axes.get_subplotspec().is_last_row():
            axes.set_xlabel("frequency (rad/s)")
    return figure


#: Poles faster than this hardly affect the motion and are not shown, 1/s.
_SLOW_1_S = 12.0


def plot_pole_cloud(cloud: PoleCloud) -> Figure:
    """Plots the poles ln(z)/T of all samples, with the nominal and the worst case."""
    figure = Figure(figsize=(8.0, 4.4), layout="constrained")
    axes = figure.subplots()
    for z, marker, size, color, label in (
        (np.concatenate(cloud.poles), ".", 3, COLORS["left"], "random values"),
        (cloud.worst_poles, "x", 8, COLORS["source"], "worst case"),
        (cloud.nominal_poles, "o", 6, COLORS["robot"], "nominal"),
    ):
        poles = s_plane(z, cloud.period_s)
        slow = poles[np.abs(poles) < _SLOW_1_S]
        axes.plot(
            slow.real,
            slow.imag,
            marker,
            markersize=size,
            color=color,
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


def plot_sensitivities(rows: Sequence[PoleSensitivity]) -> Figure:
    """Plots the first-order change of the slowest pole over each interval."""
    figure = Figure(figsize=(8.0, 0.4 * len(rows) + 1.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    ordered = sorted(rows, key=lambda row: abs(row.per_interval))
    names = [f"{row.parameter.symbol}" for row in ordered]
    for axes, part, title in (
        (left, "real", "decay: change of the real part (1/s)"),
        (right, "imag", "frequency: change of the imaginary part (rad/s)"),
    ):
        changes = [getattr(row.per_interval, part) for row in ordered]
        colors = [COLORS["source" if x > 0 else "robot"] for x in changes]
        axes.barh(names, changes, color=colors)
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.set_title(title, fontsize=10)
        draw_grid(axes, "x")
        axes.xaxis.set_major_locator(MaxNLocator(4))
    return figure


def plot_contact_limits(limits: ContactLimits) -> Figure:
    """Plots the largest stable K_0 and k_ref over the motor lag, for each latency."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    sides = (
        ("K_0 (N/m)", limits.stiffness_n_m, limits.stiffness_today_n_m),
        (
            "k_ref (N/m)",
            limits.reference_stiffness_n_m,
            limits.reference_stiffness_today_n_m,
        ),
    )
    for axes, (name, values, today) in zip(figure.subplots(1, 2), sides, strict=True):
        for k, ticks in enumerate(limits.latency_ticks):
            axes.loglog(
                limits.motor_lags_s,
                np.maximum(values[:, k], 1e-2),
                "o-",
                markersize=3,
                color=_CYCLE[k % len(_CYCLE)],
                label=f"{ticks * limits.tick_s * 1e3:.0f} ms",
            )
        axes.plot(
            limits.today[0],
            today,
            "*",
            markersize=14,
            color="#F0E442",
            markeredgecolor="black",
        )
        axes.annotate(
            "current",
            (limits.today[0], today),
            textcoords="offset points",
            xytext=(8, 4),
        )
        axes.set_xlabel("motor lag (s)")
        axes.set_ylabel(f"largest stable {name}")
        axes.grid(visible=True, which="both", linewidth=0.3)
        axes.legend(title="latency of echoes", fontsize=8, title_fontsize=8)
    return figure


def plot_delay_check(check: DelayCheck) -> Figure:
    """Plots the simulated offsets for 0.95 and 1.05 times the delay margin."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    runs = (("0.95", check.below), ("1.05", check.above))
    for axes, (share, run) in zip(figure.subplots(1, 2), runs, strict=True):
        axes.plot(run.time_s, 1e6 * run.offset_m, color=_CYCLE[0], linewidth=0.7)
        axes.set_title(
            f"{share} of {check.margin.delay_s * 1e3:.1f} ms at the "
            f"{check.margin.at}: growth {run.growth_per_s:+.4f} 1/s",
            fontsize=9,
        )
        axes.set_xlabel("time (s)")
        axes.set_ylabel("offset of P (um)")
    return figure
