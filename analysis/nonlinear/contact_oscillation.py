"""Oscillation before an obstacle: harmonic balance against the simulated blocks.

The simulation is the all-ideal build of the same builder, head-on to a wide box;
``analysis.nonlinear.harmonic_balance`` predicts.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.laws.head_on import HeadOn, head_on
from analysis.models.ideal_scenarios import changed, ideal_scenario
from analysis.nonlinear.harmonic_balance import (
    OscillationPrediction,
    predict_oscillation,
)
from analysis.nonlinear.velocity_terms import VARIANTS, Variant
from diagrams import Scenario, simulate

#: Depth and width of the box, m: wider than P ever strays.
_BOX_M = (0.1, 1.0)
#: Follow distance of the run, m: behind the box and clear of the master robot.
_ROOM_BEHIND_M = 0.5


@dataclass(frozen=True, eq=False)
class OscillationRun:
    """Clearance in the simulated build, cycle by cycle."""

    times_s: NDArray[np.float64]
    """(n,) ticks, s."""
    clearances_m: NDArray[np.float64]
    """(n,) distance of P from the box, m."""
    cause: str
    """How the run ended."""
    amplitudes_m: NDArray[np.float64]
    """(cycles,) half the swing, m."""
    centres_m: NDArray[np.float64]
    """(cycles,) mean over the cycle, m."""
    growth_per_s: NDArray[np.float64]
    """(cycles,) growth of the amplitude from cycle to cycle, 1/s."""
    frequencies_rad_s: NDArray[np.float64]
    """(cycles,) rad/s."""

    @property
    def settled_amplitude_m(self) -> float:
        """Mean amplitude of the last three cycles, m; 0 without cycles."""
        return float(np.mean(self.amplitudes_m[-3:])) if len(self.amplitudes_m) else 0.0

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        every_tick = ("times_s", "clearances_m")
        cycles = {k: v for k, v in vars(self).items() if k not in every_tick}
        return cycles | {"settled_amplitude_m": self.settled_amplitude_m}


@dataclass(frozen=True, eq=False)
class ContactOscillation:
    """Prediction and simulation of both velocity terms."""

    contact: HeadOn
    """The approach."""
    predictions: dict[str, OscillationPrediction]
    """By velocity term."""
    runs: dict[str, OscillationRun]
    """By velocity term."""

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
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

    Args:
        scenario: Law, gains and robot.
        to_go_m: See ``head_on``.
        start_m: Clearance from which the run starts at rest, m; none: 0.2 m
            beyond the equilibrium.
        duration_s: Simulated time, s.

    Returns:
        Both by velocity term.

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
    """Runs the all-ideal build head-on from rest, and takes its cycles apart.

    Args:
        contact: Law, gains and distance to go.
        term: Velocity term.
        start_m: Clearance from which the run starts, m.
        duration_s: Simulated time, s.

    Returns:
        Clearance at each tick, m; amplitude, m, growth, 1/s, and frequency, rad/s, of
        each cycle.

    Raises:
        InputError: The law is not known.
    """
    result = simulate(_head_on_scenario(contact, term, start_m, duration_s))
    face = contact.scenario.only.robot.control_point_m + start_m
    clearances = face - result.columns["p_WP_x"]
    cycles = _cycles(result.time, clearances)
    return OscillationRun(result.time, clearances, result.cause, *cycles)


def _head_on_scenario(
    contact: HeadOn, term: Variant, start_m: float, duration_s: float
) -> Scenario:
    """P at rest ``start_m`` before a box, the goal ``to_go_m`` behind its face."""
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
    """Amplitude, centre, growth and frequency of each cycle, peak to peak."""
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
    amplitudes, centres, spans = table.T
    if len(table) < 2:
        return amplitudes, centres, np.zeros(len(table)), 2.0 * np.pi / spans
    growth = np.gradient(np.log(amplitudes), np.cumsum(spans))
    return amplitudes, centres, growth, 2.0 * np.pi / spans
