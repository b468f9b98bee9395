"""Velocity terms about a contact equilibrium: one-sided models, describing functions.

The laws see s = |dC/dt|, which has a corner at rest: a linearisation exists for
either direction alone. Over an oscillation of speed amplitude A the printed term
damps nothing (its force is the same on the way in and out) and leaves a bias.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from analysis.laws.head_on import HeadOn, head_on
from diagrams import Scenario
from systems.laws.impedance_controller import obstacle_speed

Variant = Literal["printed", "closing"]
VARIANTS: tuple[Variant, ...] = get_args(Variant)
#: Points of a cycle in the describing function's integrals.
_CYCLE_POINTS = 240
#: Ticks of the cycle by which the blocks' own functions are measured.
_CYCLE_TICKS = 24


@dataclass(frozen=True)
class OneSidedModel:
    """The linear model on one side of rest: M x'' + D x' + K x = 0."""

    direction: str
    """``approaching`` or ``receding``."""
    stiffness_n_m: float
    """K_r - df/dc, N/m."""
    damping_n_s_m: float
    """D_r plus what the velocity term adds on this side, N s/m."""
    mass_kg: float
    """M."""

    @property
    def poles(self) -> NDArray[np.complex128]:
        """(2,) 1/s."""
        roots = np.roots([self.mass_kg, self.damping_n_s_m, self.stiffness_n_m])
        return roots.astype(complex)

    @property
    def natural_frequency_rad_s(self) -> float:
        """sqrt(K/M); 0 where the stiffness is not positive."""
        return math.sqrt(max(self.stiffness_n_m, 0.0) / self.mass_kg)

    @property
    def damping_ratio(self) -> float | None:
        """D / (2 sqrt(K M)); none without a positive stiffness."""
        if self.stiffness_n_m <= 0.0:
            return None
        return self.damping_n_s_m / (2.0 * math.sqrt(self.stiffness_n_m * self.mass_kg))

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        return {
            "direction": self.direction,
            "stiffness_n_m": self.stiffness_n_m,
            "damping_n_s_m": self.damping_n_s_m,
            "damping_ratio": self.damping_ratio,
            "natural_frequency_rad_s": self.natural_frequency_rad_s,
            "poles": self.poles,
        }


@dataclass(frozen=True, eq=False)
class DescribingFunction:
    """What a velocity term does to c = c_0 + (A/w) sin(w t), by speed amplitude A."""

    amplitudes_m_s: NDArray[np.float64]
    """(n,) A, m/s."""
    bias_n: NDArray[np.float64]
    """(n,) mean of f - f(c, 0), away from the obstacle, N."""
    damping_n_s_m: NDArray[np.float64]
    """(n,) damping by the first harmonic, N s/m; negative drives."""
    sampled_bias_n: NDArray[np.float64]
    """(n,) the same bias of the controller's own difference over a tick, N."""
    sampled_damping_n_s_m: NDArray[np.float64]
    """(n,) the same damping of the controller's own difference, N s/m."""


@dataclass(frozen=True, eq=False)
class VelocityTermVariant:
    """One of the two readings of s."""

    velocity_term: Variant
    """``printed`` or ``closing``."""
    approaching: OneSidedModel
    """c falls."""
    receding: OneSidedModel
    """c grows."""
    describing: DescribingFunction
    """At the equilibrium distance."""

    @property
    def amplitude_ratio(self) -> float | None:
        """How an infinitesimal oscillation shrinks in a cycle; none: it is none.

        The sides meet at rest, half a cycle each: exp(-pi z/sqrt(1 - z^2)) of
        each side's damping ratio z.
        """
        ratio = 1.0
        for side in (self.approaching, self.receding):
            z = side.damping_ratio
            if z is None or abs(z) >= 1.0:
                return None
            ratio *= math.exp(-math.pi * z / math.sqrt(1.0 - z * z))
        return ratio

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        return {
            "velocity_term": self.velocity_term,
            "sides": [self.approaching, self.receding],
            "amplitude_ratio": self.amplitude_ratio,
            "describing_function": self.describing,
        }


@dataclass(frozen=True, eq=False)
class VelocityTermAnalysis:
    """Both readings beside each other."""

    contact: HeadOn
    """Where the models hold."""
    variants: dict[str, VelocityTermVariant]
    """By velocity term."""

    @property
    def bias_shift_m(self) -> dict[str, float]:
        """How far the oscillation at the top speed shifts the centre, m."""
        return {
            name: float(v.describing.bias_n[-1]) / self.contact.stiffness_n_m
            for name, v in self.variants.items()
        }

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        return {
            "law": self.contact.law.name,
            "to_go_m": self.contact.to_go_m,
            "equilibrium_m": self.contact.equilibrium_m,
            "variants": self.variants,
            "bias_shift_m": self.bias_shift_m,
        }


def velocity_term_analysis(
    scenario: Scenario, *, to_go_m: float | None = None
) -> VelocityTermAnalysis:
    """One-sided models and describing functions of both velocity terms.

    Args:
        scenario: Law, attraction and mass.
        to_go_m: See ``head_on``.

    Returns:
        By velocity term: stiffness, N/m, and damping, N s/m, of both sides.

    Raises:
        InputError: The law is not known.
        ValueError: There is no contact equilibrium.
    """
    contact = head_on(scenario, to_go_m=to_go_m)
    _, slope = contact.law.gradient(contact.equilibrium_m, 0.0)
    damping = scenario.follower.attraction.damping_n_s_m
    variants: dict[str, VelocityTermVariant] = {}
    for term in VARIANTS:
        sides = [
            OneSidedModel(
                direction,
                contact.stiffness_n_m,
                damping + added,
                scenario.only.robot.mass_kg,
            )
            for direction, added in (
                ("approaching", slope),
                ("receding", -slope if term == "printed" else 0.0),
            )
        ]
        describing = describe_velocity_term(contact, term)
        variants[term] = VelocityTermVariant(term, sides[0], sides[1], describing)
    return VelocityTermAnalysis(contact, variants)


def describe_velocity_term(
    contact: HeadOn, term: Variant, *, points: int = 36
) -> DescribingFunction:
    """Describing function of a velocity term up to the top speed.

    Args:
        contact: Law and equilibrium distance.
        term: Which s.
        points: Amplitudes up to the top speed.

    Returns:
        Bias, N, and damping, N s/m, by amplitude of the speed, m/s.
    """
    top = contact.scenario.only.robot.top_speed_m_s
    amplitudes = top * (np.arange(points) + 1.0) / points
    c = contact.equilibrium_m
    rest = contact.law.force(c)

    def added(s: float) -> float:
        return contact.law.force(c, s) - rest

    phase = 2.0 * np.pi * (np.arange(_CYCLE_POINTS) + 0.5) / _CYCLE_POINTS
    exact = [_harmonics(added, _speeds(a, phase, term), phase, a) for a in amplitudes]
    sampled = [_sampled_harmonics(contact, added, a, term) for a in amplitudes]
    bias, damping = np.array(exact).T
    sampled_bias, sampled_damping = np.array(sampled).T
    return DescribingFunction(amplitudes, bias, damping, sampled_bias, sampled_damping)


def _speeds(
    amplitude: float, phase: NDArray[np.float64], term: Variant
) -> NDArray[np.float64]:
    """s of c' = A cos(phase)."""
    rate = amplitude * np.cos(phase)
    return np.abs(rate) if term == "printed" else np.maximum(-rate, 0.0)


def _harmonics(
    added: Callable[[float], float],
    speeds: NDArray[np.float64],
    phase: NDArray[np.float64],
    amplitude: float,
) -> tuple[float, float]:
    """(bias, damping) of a force over one cycle; the phase is that of c'."""
    force = np.array([added(s) for s in speeds.tolist()])
    return float(force.mean()), -2.0 * float(np.mean(force * np.cos(phase))) / amplitude


def _sampled_harmonics(
    contact: HeadOn, added: Callable[[float], float], amplitude: float, term: Variant
) -> tuple[float, float]:
    """The same of the controller's difference of C over a tick."""
    tick_s = contact.scenario.tick_s
    omega = 2.0 * np.pi / (_CYCLE_TICKS * tick_s)
    turn = omega * tick_s
    # Ticks fall between those of the exact integral's symmetric grid.
    phase = turn * (np.arange(_CYCLE_TICKS, dtype=float) + 0.25)
    c = contact.equilibrium_m + amplitude / omega * np.sin(phase)
    before = contact.equilibrium_m + amplitude / omega * np.sin(phase - turn)
    return _harmonics(added, sensed_speeds(c, before, term, tick_s), phase, amplitude)


def sensed_speeds(
    now_m: NDArray[np.float64],
    before_m: NDArray[np.float64],
    term: Variant,
    tick_s: float,
) -> NDArray[np.float64]:
    """The controller's s of an obstacle straight ahead.

    Args:
        now_m: (n,) distances at a tick, m.
        before_m: (n,) distances a tick before, m.
        term: Velocity term.
        tick_s: The period, s.

    Returns:
        (n,) m/s.
    """
    pairs = zip(now_m.tolist(), before_m.tolist(), strict=True)
    closing = term == "closing"
    return np.array(
        [obstacle_speed((c, 0.0), (then, 0.0), closing, tick_s) for c, then in pairs]
    )
