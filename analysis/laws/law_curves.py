"""Curves of the force of each law over distance and over speed.

Han 2019 describes such curves in words (figure 6), and so does Kim 2017. The figures
themselves are missing. The forces are those of the controllers of the simulation.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.laws.radial_law import radial_law
from diagrams.scenario.scenario import Scenario

#: Distances of the curves, m.
DISTANCES_M = np.linspace(0.0, 3.0, 301)[1:]
#: Speeds of approach of the curves, m/s. A negative speed means that the obstacle
#: recedes.
SPEEDS_M_S = np.linspace(-1.0, 1.0, 201)
#: Distance for the curves over speed, m. This distance is half of rho_0.
AT_DISTANCE_M = 0.4


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
    at_distance_m: float
    """Distance of the obstacle for ``force_n``, m."""
    speed_m_s: NDArray[np.float64]
    """(k,) speeds of approach, m/s; negative if the obstacle recedes."""
    force_n: NDArray[np.float64]
    """(k,) force at ``speed_m_s``, N."""


def law_curves(scenario: Scenario, laws: Iterable[str]) -> list[LawCurves]:
    """Computes the force curves of the named laws with the gains of a scenario.

    Raises InputError if a law does not exist or has no radial force.
    """
    closing = scenario.follower.collision_vector.velocity_term == "closing"
    # The law sees the speed of approach, or without ``closing`` its magnitude.
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
                at_distance_m=AT_DISTANCE_M,
                speed_m_s=SPEEDS_M_S,
                force_n=np.array(
                    [float(force(AT_DISTANCE_M, s)) for s in speeds.tolist()]
                ),
            )
        )
    return curves
