"""Curves of the force of each law over distance and over speed, and their figure.

Han 2019 (figure 6) and Kim 2017 describe such curves in their texts. Their figures are
not available to this project. The forces here are those of the simulation's
controllers.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.loops.radial_law import radial_law
from analysis.report.palette import SERIES_COLORS
from diagrams.scenario.scenario import Scenario
from systems.laws.catalog import LAWS

#: Distances of the curves, m.
DISTANCES_M = np.linspace(0.0, 3.0, 301)[1:]
#: Speeds of approach of the curves, m/s. At a negative speed, the obstacle recedes.
SPEEDS_M_S = np.linspace(-1.0, 1.0, 201)
#: Distance for the curves over speed, m. This distance is half of rho_0.
AT_DISTANCE_M = 0.4
#: Color and title of each law of the package, by name.
LAW_STYLES = {
    law.name: (law.color or color, law.label)
    for law, color in zip(LAWS.values(), cycle(SERIES_COLORS), strict=False)
}


@dataclass(frozen=True)
class LawCurves:
    """Force of one law away from an obstacle straight ahead."""

    law: str
    velocity_term: str
    """``printed`` or ``closing``."""
    distance_m: NDArray[np.float64]
    """(n,) distances of the obstacle, m."""
    push_n: NDArray[np.float64]
    """(n,) force at ``distance_m`` for an obstacle at rest, N."""
    speed_m_s: NDArray[np.float64]
    """(k,) speeds of approach, m/s; negative if the obstacle recedes."""
    force_n: NDArray[np.float64]
    """(k,) force at ``speed_m_s`` and ``AT_DISTANCE_M``, N."""


def law_curves(scenario: Scenario, laws: Iterable[str]) -> list[LawCurves]:
    """Computes the force curves of the named laws with the gains of a scenario."""
    closing = scenario.follower.collision_vector.velocity_term == "closing"
    # The law uses the speed of approach, which is at least 0, with ``closing``, and
    # the magnitude of the speed with ``printed``.
    speeds = np.maximum(SPEEDS_M_S, 0.0) if closing else np.abs(SPEEDS_M_S)
    curves = []
    for law in laws:
        force = radial_law(scenario.with_robot(law=law)).function
        curves.append(
            LawCurves(
                law=law,
                velocity_term=scenario.follower.collision_vector.velocity_term,
                distance_m=DISTANCES_M,
                push_n=np.array([float(force(c, 0.0)) for c in DISTANCES_M.tolist()]),
                speed_m_s=SPEEDS_M_S,
                force_n=np.array(
                    [float(force(AT_DISTANCE_M, s)) for s in speeds.tolist()]
                ),
            )
        )
    return curves


def plot_law_curves(curves: Sequence[LawCurves]) -> Figure:
    """Plots forces over the distance (left) and over the speed of approach (right).

    On the left, the obstacle is at rest. Curves with the velocity term ``closing`` are
    dashed and appear only on the right, because a velocity term depends on speed.
    """
    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    by_distance, by_speed = figure.subplots(1, 2)
    for curve in curves:
        color, title = LAW_STYLES.get(curve.law, (None, curve.law))
        if curve.velocity_term == "printed":
            by_distance.plot(curve.distance_m, curve.push_n, color=color, label=title)
            by_speed.plot(curve.speed_m_s, curve.force_n, color=color, label=title)
        else:
            by_speed.plot(curve.speed_m_s, curve.force_n, "--", color=color)
    by_distance.set_xlabel("distance c (m)")
    by_distance.set_ylabel("force away from the obstacle (N)")
    by_distance.set_title("the obstacle at rest")
    by_speed.set_xlabel("speed of approach (m/s); negative: receding")
    by_speed.set_title(f"at c = {AT_DISTANCE_M:g} m; dashed: s of the approach only")
    for axes in (by_distance, by_speed):
        axes.set_ylim(bottom=0.0)
        axes.grid(visible=True, alpha=0.3)
    by_distance.legend()
    return figure
