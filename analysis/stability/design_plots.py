"""Figure of ``phonotaxis design``: forces near an obstacle, and stiffness limits."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.loops.contact_mode import largest_contact_stiffness
from analysis.loops.law_curves import LAW_STYLES
from analysis.loops.push_and_pull import DESIGNED_LAWS, spring
from analysis.loops.radial_law import radial_law
from analysis.stability.design_study import DesignStudy

#: Values of D_r on the axis of the right panel, N s/m.
_DAMPING_N_S_M = np.linspace(0.2, 2.0, 37)
#: Largest stiffness on the axis of the right panel, N/m.
_STIFFNESS_N_M = 30.0
#: Distances of the obstacle on the axis of the left panel, m.
_DISTANCE_M = np.linspace(0.005, 1.2, 240)


def plot_design(study: DesignStudy) -> Figure:
    """Plots the forces of the laws, and compares their stiffness with its limits.

    The left panel shows forces over the distance of an obstacle: the push of each law
    away from the obstacle, and the pull of the attraction toward the source. In shaded
    areas, the push exceeds the pull. The right panel has the damping D_r of the
    attraction on its horizontal axis. It shows the largest stiffness of each law, and
    the stiffness up to which the motion in front of an obstacle is stable. Both panels
    use the scenario's current attraction, not the recommended one.
    """
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    balance, conflict = figure.subplots(1, 2)
    _plot_balance(balance, study)
    _plot_conflict(conflict, study)
    return figure


def _plot_balance(axes: Axes, study: DesignStudy) -> None:
    scenario, to_go = study.today.scenario, study.today.meters_to_go
    nearest = scenario.follower.ultrasonic.minimum_range_m
    pull = scenario.follower.attraction.stiffness_n_m * (_DISTANCE_M + to_go)
    for law in DESIGNED_LAWS:
        color, title = LAW_STYLES[law]
        push = spring(law, scenario)
        force = np.array([push(c) for c in _DISTANCE_M.tolist()])
        axes.plot(_DISTANCE_M, force, color=color, label=title)
        stops = (force > pull) & (nearest <= _DISTANCE_M)
        axes.fill_between(
            _DISTANCE_M, pull, force, where=stops.tolist(), color=color, alpha=0.15
        )
    axes.plot(_DISTANCE_M, pull, color="black", label="attraction's pull")
    axes.axvline(nearest, color="black", linewidth=0.8, linestyle=":")
    axes.set_xlim(0.0, _DISTANCE_M[-1])
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("distance c of an obstacle ahead (m)")
    axes.set_ylabel("force (N)")
    axes.set_title(
        f"every shaded area holds {study.kinetic_energy_j:.2f} J; target {to_go:g} m on"
    )
    axes.legend()


def _plot_conflict(axes: Axes, study: DesignStudy) -> None:
    scenario = study.today.scenario
    attraction = scenario.follower.attraction
    spare = study.gains.requirements.spare_latency_ticks
    lines = dict.fromkeys((0, spare), "-") | {spare: "--"}
    for ticks, line in lines.items():
        limits = [
            largest_contact_stiffness(scenario, damping_n_s_m=D_r, latency_ticks=ticks)
            - attraction.stiffness_n_m
            for D_r in _DAMPING_N_S_M.tolist()
        ]
        age = f"{1e3 * scenario.tick_s * ticks:g} ms"
        label = f"contact is stable below: echoes {age} old"
        axes.plot(_DAMPING_N_S_M, limits, f"k{line}", label=label)
    for law in DESIGNED_LAWS:
        color, title = LAW_STYLES[law]
        stiffness = radial_law(scenario.with_robot(law=law)).stiffest_n_m
        if stiffness < _STIFFNESS_N_M:
            label = f"{title}: {stiffness:.1f} N/m"
            axes.axhline(stiffness, color=color, label=label)
        else:
            label = f"{title}: {stiffness:.0f} N/m, off the scale"
            axes.plot([], [], color=color, label=label)
    axes.axvline(attraction.damping_n_s_m, color="black", linewidth=0.8, linestyle=":")
    axes.set_xlim(_DAMPING_N_S_M[0], _DAMPING_N_S_M[-1])
    axes.set_ylim(0.0, _STIFFNESS_N_M)
    axes.set_xlabel("damping of the attraction D_r (N s/m)")
    axes.set_ylabel("stiffest slope of the push (N/m)")
    axes.set_title("the stiffness that the barrier costs, and what contact allows")
    axes.legend(fontsize=8, loc="lower right")
