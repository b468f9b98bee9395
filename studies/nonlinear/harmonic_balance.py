"""Prediction of the oscillation before an obstacle by harmonic balance.

The robot's clearance is assumed to be c_0 + A exp(g t) sin(w t). The repulsion f(c, s)
then has a mean and a first harmonic over a cycle. Both must agree with the motion that
they cause according to the sampled model of the robot
(``analysis.loops.contact_mode``). For each amplitude A, this balance gives the center
c_0, the growth rate g and the frequency w. The amplitude at which g changes from
positive to negative is that of a limit cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from analysis.loops.contact_mode import motion_chain
from analysis.loops.linear_models import LinearModel
from studies.nonlinear.head_on import HeadOn
from studies.nonlinear.velocity_terms import Variant, sensed_speeds

#: Number of phases of a cycle at which the law is evaluated.
_PHASES = 64


@dataclass(frozen=True, eq=False)
class OscillationPrediction:
    """Predicted oscillation as a function of its amplitude."""

    amplitudes_m: NDArray[np.float64]
    """(n,) amplitudes A up to the largest for which a balance was found, m."""
    centers_m: NDArray[np.float64]
    """(n,) centers c_0 of the oscillation, m."""
    growth_per_s: NDArray[np.float64]
    """(n,) growth rates g of the amplitude, 1/s; negative if the oscillation decays."""
    frequencies_rad_s: NDArray[np.float64]
    """(n,) frequencies w, rad/s."""
    clamp_amplitude_m: float
    """Largest amplitude whose speed A w does not exceed the top speed, m."""

    @property
    def limit_cycle(self) -> tuple[float, float, float] | None:
        """(A, c_0, w) of the limit cycle in m, m and rad/s, or None without one."""
        g = self.growth_per_s
        falls = np.flatnonzero((g[:-1] > 0.0) & (g[1:] <= 0.0))
        if len(falls) == 0:
            return None
        k = int(falls[0])
        part = g[k] / (g[k] - g[k + 1])
        a, c, w = (
            float(v[k] + part * (v[k + 1] - v[k]))
            for v in (self.amplitudes_m, self.centers_m, self.frequencies_rad_s)
        )
        return a, c, w

    def at(self, amplitude: float) -> tuple[float, float, float]:
        """(c_0, g, w) at an amplitude, m, by interpolation: m, 1/s and rad/s."""
        center, growth, frequency = (
            float(np.interp(amplitude, self.amplitudes_m, v))
            for v in (self.centers_m, self.growth_per_s, self.frequencies_rad_s)
        )
        return center, growth, frequency

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
        names = ("amplitude_m", "center_m", "frequency_rad_s")
        cycle = self.limit_cycle and dict(zip(names, self.limit_cycle, strict=True))
        return vars(self) | {"limit_cycle": cycle}


def predict_oscillation(
    contact: HeadOn, term: Variant, *, largest_m: float = 0.4, points: int = 20
) -> OscillationPrediction:
    """Predicts the oscillation before an obstacle for several amplitudes.

    The method is harmonic balance.

    Args:
        contact: Head-on approach to the obstacle, with law and gains.
        term: Velocity term of the law: ``printed`` or ``closing``.
        largest_m: Largest amplitude, m.
        points: Number of amplitudes.

    Returns:
        Center, growth rate and frequency for each amplitude. If an amplitude has no
        balance, the results end before this amplitude.
    """
    chain = motion_chain(contact.scenario)
    mass = contact.scenario.only.robot.mass_kg
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
    top = contact.scenario.only.robot.top_speed_m_s
    below = table[table[:, 0] * table[:, 3] <= top, 0]
    return OscillationPrediction(
        amplitudes_m=table[:, 0],
        centers_m=table[:, 1],
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
    """Residual of the balance: mean force, then real and imaginary first harmonic."""
    center, growth, frequency = x
    tick_s = contact.scenario.tick_s
    turn = frequency * tick_s
    phase = 2.0 * np.pi * np.arange(_PHASES) / _PHASES
    c = center + amplitude * np.sin(phase)
    before = center + amplitude * np.sin(phase - turn)
    speeds = sensed_speeds(c, before, term, tick_s)
    places = zip(c.tolist(), speeds.tolist(), strict=True)
    force = np.array([contact.force(*place) for place in places])
    # sin(phase) is the imaginary part of exp(j phase).
    harmonic = 2.0j * np.mean(force * np.exp(-1j * phase)) / amplitude
    z = np.exp((growth + 1j * frequency) * tick_s)
    inverse = np.linalg.solve(z * np.eye(len(chain.A)) - chain.A, chain.B[:, 0])
    position, velocity = chain.C @ inverse
    scenario = contact.scenario
    mass, damping = (
        scenario.only.robot.mass_kg,
        scenario.follower.attraction.damping_n_s_m,
    )
    gap = mass + damping * velocity - harmonic * position
    gap = gap / (mass * abs(position))
    return np.array([force.mean(), gap.real, gap.imag])
