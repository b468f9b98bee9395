"""Oscillation before an obstacle: harmonic balance compared with simulation.

In the simulation, the robot has exact sensors and drives head-on toward a wide box.
``studies.nonlinear.harmonic_balance`` computes the prediction.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.ideal_scenarios import changed, ideal_scenario
from diagrams import Scenario, simulate
from studies.nonlinear.harmonic_balance import (
    OscillationPrediction,
    predict_oscillation,
)
from studies.nonlinear.head_on import HeadOn, head_on
from studies.nonlinear.velocity_terms import VARIANTS, Variant

#: Depth and width of the box, m. P never moves as far sideways as the box is wide.
_BOX_M = (0.1, 1.0)
#: Smallest distance of the source behind the box, m. This distance keeps the leader
#: robot, which carries the source, clear of the box.
_ROOM_BEHIND_M = 0.5


@dataclass(frozen=True, eq=False)
class OscillationRun:
    """Simulated clearance, with the properties of each cycle."""

    times_s: NDArray[np.float64]
    """(n,) times of the control periods, s."""
    clearances_m: NDArray[np.float64]
    """(n,) distances of P from the box, m."""
    cause: str
    """Why the run ended."""
    amplitudes_m: NDArray[np.float64]
    """(cycles,) amplitudes: half of the difference between maximum and minimum, m."""
    centers_m: NDArray[np.float64]
    """(cycles,) mean clearances over each cycle, m."""
    growth_per_s: NDArray[np.float64]
    """(cycles,) growth rates of the amplitude, 1/s."""
    frequencies_rad_s: NDArray[np.float64]
    """(cycles,) frequencies, rad/s."""

    @property
    def settled_amplitude_m(self) -> float:
        """Mean amplitude of the last three cycles, m. Without cycles: 0."""
        return float(np.mean(self.amplitudes_m[-3:])) if len(self.amplitudes_m) else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
        every_tick = ("times_s", "clearances_m")
        cycles = {k: v for k, v in vars(self).items() if k not in every_tick}
        return cycles | {"settled_amplitude_m": self.settled_amplitude_m}


@dataclass(frozen=True, eq=False)
class ContactOscillation:
    """Prediction and simulation of the oscillation for both velocity terms."""

    contact: HeadOn
    """The head-on approach."""
    predictions: dict[str, OscillationPrediction]
    """Predictions by velocity term."""
    runs: dict[str, OscillationRun]
    """Simulations by velocity term."""

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
        return {
            "law": self.contact.law.name,
            "to_go_m": self.contact.to_go_m,
            "equilibrium_m": self.contact.equilibrium_m,
            "variants": {
                name: {"predicted": self.predictions[name], "simulated": run}
                for name, run in self.runs.items()
            },
        }


def contact_oscillation(
    scenario: Scenario,
    *,
    to_go_m: float | None = None,
    start_m: float | None = None,
    duration_s: float = 40.0,
) -> ContactOscillation:
    """Predicts and simulates the oscillation before an obstacle.

    The results are given for each velocity term. A velocity term is the dependence of
    the law's force on the speed of the obstacle.

    Args:
        scenario: Scenario with law, gains and robot.
        to_go_m: Distance from the obstacle's face to the goal, m, see ``head_on``.
        start_m: Clearance at which the run starts at rest, m. With None the start is
            0.2 m farther than the equilibrium.
        duration_s: Simulated time, s.

    Returns:
        Prediction and simulation by velocity term.

    Raises:
        InputError: The law is not known.
        ValueError: There is no contact equilibrium.
    """
    contact = head_on(scenario, to_go_m=to_go_m)
    start = contact.equilibrium_m + 0.2 if start_m is None else start_m
    return ContactOscillation(
        contact,
        {term: predict_oscillation(contact, term) for term in VARIANTS},
        {
            term: simulate_oscillation(contact, term, start, duration_s)
            for term in VARIANTS
        },
    )


def simulate_oscillation(
    contact: HeadOn, term: Variant, start_m: float, duration_s: float
) -> OscillationRun:
    """Simulates a head-on approach to an obstacle, and divides the motion into cycles.

    The robot starts at rest and has exact sensors.

    Args:
        contact: Head-on approach with law, gains and distance to the goal.
        term: Velocity term of the law: ``printed`` or ``closing``.
        start_m: Clearance at the start, m.
        duration_s: Simulated time, s.

    Returns:
        Clearance over time, and amplitude, center, growth rate and frequency of each
        cycle.

    Raises:
        InputError: The law is not known.
    """
    result = simulate(
        _head_on_scenario(contact, term, start_m, duration_s), engine="compiled"
    )
    face = contact.scenario.only.robot.control_point_m + start_m
    clearances = face - result.columns["p_WP_x"]
    cycles = _cycles(result.time, clearances)
    return OscillationRun(result.time, clearances, result.cause, *cycles)


def _head_on_scenario(
    contact: HeadOn, term: Variant, start_m: float, duration_s: float
) -> Scenario:
    """Scenario with P ``start_m`` before a box, the goal ``to_go_m`` behind it."""
    scenario = contact.scenario
    face = scenario.only.robot.control_point_m + start_m
    follow = max(
        scenario.follower.attraction.follow_distance_m,
        _BOX_M[0] + _ROOM_BEHIND_M - contact.to_go_m,
    )
    middle, far = face + 0.5 * _BOX_M[0], face + contact.to_go_m + follow
    box = {"name": "box", "size_m": list(_BOX_M), "waypoints_m": [[middle, 0.0]]}
    changes = {
        "duration_s": duration_s,
        "start": {"position_m": [0.0, 0.0], "heading_deg": 0.0},
        "obstacles": [box],
        "source": {"waypoints_m": [[far, 0.0]], "heading_deg": 0.0},
        "attraction": {"follow_distance_m": follow},
        "collision_vector": {"velocity_term": term},
        "tracker": {"hold": "world"},
        "stop": {"stuck_after_s": 2.0 * duration_s, "goal_margin_m": 1e-6},
    }
    return changed(ideal_scenario(scenario), changes)


def _cycles(
    times: NDArray[np.float64], clearances: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Amplitude, center, growth rate and frequency of each cycle from peak to peak."""
    inner = clearances[1:-1]
    peaks = np.flatnonzero((inner >= clearances[:-2]) & (inner > clearances[2:])) + 1
    peaks = peaks[clearances[peaks] > np.median(clearances[-len(times) // 4 :])]
    rows = []
    for a, b in pairwise(peaks.tolist()):
        swing = clearances[a : b + 1]
        top = 0.5 * (swing[0] + swing[-1])
        span = times[b] - times[a]
        rows.append(
            [
                0.5 * (top - swing.min()),
                np.trapezoid(swing, times[a : b + 1]) / span,
                span,
            ]
        )
    table = np.array(rows).reshape(-1, 3)
    amplitudes, centers, spans = table.T
    if len(table) < 2:
        return amplitudes, centers, np.zeros(len(table)), 2.0 * np.pi / spans
    growth = np.gradient(np.log(amplitudes), np.cumsum(spans))
    return amplitudes, centers, growth, 2.0 * np.pi / spans
