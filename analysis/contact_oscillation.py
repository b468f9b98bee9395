"""Oscillation before an obstacle: harmonic balance against the simulated blocks.

The clearance is taken as c_0 + A exp(g t) sin(w t). Mean and first harmonic of
the law's own f(c, s) over a cycle, closed through the sampled chain from
acceleration to motion (``analysis.contact_mode``), give centre c_0, growth g
and frequency w by amplitude A. A limit cycle is where g falls through zero.
The simulation is the all-ideal build of the same builder, head-on to a wide box.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from analysis.contact_mode import motion_chain
from analysis.head_on import HeadOn, head_on
from analysis.ideal_loop import ideal_scenario
from analysis.linear_models import LinearModel
from analysis.velocity_terms import VARIANTS, Variant
from diagrams import Scenario, simulate
from systems.impedance import obstacle_speed
from systems.signals import FRAME_PERIOD_S

__all__ = [
    "ContactOscillation",
    "OscillationPrediction",
    "OscillationRun",
    "contact_oscillation",
    "predict_oscillation",
    "simulate_oscillation",
]

#: Phases of a cycle at which the law is evaluated.
_PHASES = 64
#: Depth and width of the box, m: wider than P ever strays.
_BOX_M = (0.1, 1.0)
#: Follow distance of the run, m: behind the box and clear of the master robot.
_ROOM_BEHIND_M = 0.5


@dataclass(frozen=True, eq=False)
class OscillationPrediction:
    """Harmonic balance by amplitude."""

    amplitudes_m: NDArray[np.float64]
    """(n,) A, m, as far as a balance was found."""
    centres_m: NDArray[np.float64]
    """(n,) c_0, m."""
    growth_per_s: NDArray[np.float64]
    """(n,) g of the amplitude, 1/s; negative: it decays."""
    frequencies_rad_s: NDArray[np.float64]
    """(n,) w."""
    clamp_amplitude_m: float
    """Above it A w passes the top speed, which the balance leaves out, m."""

    @property
    def limit_cycle(self) -> tuple[float, float, float] | None:
        """(A, c_0, w) where growth turns to decay, m, m, rad/s; none: nowhere."""
        g = self.growth_per_s
        falls = np.flatnonzero((g[:-1] > 0.0) & (g[1:] <= 0.0))
        if len(falls) == 0:
            return None
        k = int(falls[0])
        part = g[k] / (g[k] - g[k + 1])
        a, c, w = (
            float(v[k] + part * (v[k + 1] - v[k]))
            for v in (self.amplitudes_m, self.centres_m, self.frequencies_rad_s)
        )
        return a, c, w

    def at(self, amplitude: float) -> tuple[float, float, float]:
        """(centre, growth, frequency) at an amplitude, by interpolation."""
        centre, growth, frequency = (
            float(np.interp(amplitude, self.amplitudes_m, v))
            for v in (self.centres_m, self.growth_per_s, self.frequencies_rad_s)
        )
        return centre, growth, frequency

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        cycle = self.limit_cycle
        return {
            "amplitudes_m": self.amplitudes_m.tolist(),
            "centres_m": self.centres_m.tolist(),
            "growth_per_s": self.growth_per_s.tolist(),
            "frequencies_rad_s": self.frequencies_rad_s.tolist(),
            "clamp_amplitude_m": self.clamp_amplitude_m,
            "limit_cycle": None
            if cycle is None
            else dict(
                zip(("amplitude_m", "centre_m", "frequency_rad_s"), cycle, strict=True)
            ),
        }


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
        return {
            "cause": self.cause,
            "amplitudes_m": self.amplitudes_m.tolist(),
            "centres_m": self.centres_m.tolist(),
            "growth_per_s": self.growth_per_s.tolist(),
            "frequencies_rad_s": self.frequencies_rad_s.tolist(),
            "settled_amplitude_m": self.settled_amplitude_m,
        }


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
                name: {
                    "predicted": self.predictions[name].to_dict(),
                    "simulated": run.to_dict(),
                }
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

    Raises:
        ScenarioError: The law is not known.
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


def predict_oscillation(
    contact: HeadOn, term: Variant, *, largest_m: float = 0.4, points: int = 20
) -> OscillationPrediction:
    """Harmonic balance up to an amplitude.

    Args:
        contact: Law and gains.
        term: Velocity term.
        largest_m: Largest amplitude, m.
        points: Number of amplitudes.
    """
    chain = motion_chain(contact.scenario)
    mass = contact.scenario.robot.mass_kg
    frequency = np.sqrt(max(contact.stiffness_n_m, 1e-6) / mass)
    guess = np.array([contact.equilibrium_m, 0.0, frequency])
    rows = []
    for amplitude in largest_m * (np.arange(points) + 1.0) / points:
        found = root(
            lambda x, a=amplitude: _imbalance(contact, chain, term, float(a), x), guess
        )
        if not found.success or found.x[0] - amplitude <= 0.0:
            break
        guess = found.x
        rows.append([amplitude, *found.x])
    table = np.array(rows).reshape(-1, 4)
    top = contact.scenario.robot.top_speed_m_s
    below = table[table[:, 0] * table[:, 3] <= top, 0]
    return OscillationPrediction(
        amplitudes_m=table[:, 0],
        centres_m=table[:, 1],
        growth_per_s=table[:, 2],
        frequencies_rad_s=table[:, 3],
        clamp_amplitude_m=float(below.max(initial=0.0)),
    )


def _imbalance(
    contact: HeadOn,
    chain: LinearModel,
    term: Variant,
    amplitude: float,
    x: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Mean force, and what the first harmonic lacks to go round the loop."""
    centre, growth, frequency = x
    turn = frequency * FRAME_PERIOD_S
    phase = 2.0 * np.pi * np.arange(_PHASES) / _PHASES
    c = centre + amplitude * np.sin(phase)
    before = centre + amplitude * np.sin(phase - turn)
    force = np.array(
        [
            contact.force(
                now, obstacle_speed((now, 0.0), (then, 0.0), term, FRAME_PERIOD_S)
            )
            for now, then in zip(c.tolist(), before.tolist(), strict=True)
        ]
    )
    # sin(phase) is the imaginary part of exp(j phase).
    harmonic = 2.0j * np.mean(force * np.exp(-1j * phase)) / amplitude
    z = np.exp((growth + 1j * frequency) * FRAME_PERIOD_S)
    inverse = np.linalg.solve(z * np.eye(len(chain.A)) - chain.A, chain.B[:, 0])
    position, velocity = chain.C @ inverse
    scenario = contact.scenario
    mass, damping = scenario.robot.mass_kg, scenario.attraction.damping_n_s_m
    gap = mass + damping * velocity - harmonic * position
    gap = gap / (mass * abs(position))
    return np.array([force.mean(), gap.real, gap.imag])


def simulate_oscillation(
    contact: HeadOn, term: Variant, start_m: float, duration_s: float
) -> OscillationRun:
    """Runs the all-ideal build head-on from rest, and takes its cycles apart.

    Raises:
        ScenarioError: The law is not known.
    """
    result = simulate(_head_on_scenario(contact, term, start_m, duration_s))
    face = contact.scenario.robot.control_point_m + start_m
    clearances = face - result.columns["p_WP_x"]
    cycles = _cycles(result.time, clearances)
    return OscillationRun(result.time, clearances, result.cause, *cycles)


def _head_on_scenario(
    contact: HeadOn, term: Variant, start_m: float, duration_s: float
) -> Scenario:
    """P at rest ``start_m`` before a box, the goal ``to_go_m`` behind its face."""
    scenario = contact.scenario
    face = scenario.robot.control_point_m + start_m
    follow = max(
        scenario.attraction.follow_distance_m,
        _BOX_M[0] + _ROOM_BEHIND_M - contact.to_go_m,
    )
    data = ideal_scenario(scenario).model_dump() | {
        "duration_s": duration_s,
        "start": {"position_m": [0.0, 0.0], "heading_deg": 0.0},
        "obstacles": [
            {
                "name": "box",
                "size_m": list(_BOX_M),
                "waypoints_m": [[face + 0.5 * _BOX_M[0], 0.0]],
            }
        ],
    }
    source = {
        "waypoints_m": [[face + contact.to_go_m + follow, 0.0]],
        "heading_deg": 0.0,
    }
    data["source"] = data["source"] | source
    data["attraction"] = data["attraction"] | {"follow_distance_m": follow}
    data["repulsion"] = data["repulsion"] | {"velocity_term": term}
    data["tracker"] = data["tracker"] | {"hold": "world"}
    data["stop"] = data["stop"] | {
        "stuck_after_s": 2.0 * duration_s,
        "goal_margin_m": 1e-6,
    }
    return Scenario.model_validate(data)


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
