"""Velocity terms of the laws near an obstacle: one-sided models, describing functions.

A velocity term is the dependence of the law's force on the obstacle's speed s. The
printed laws use s = |dC/dt|, where C is the vector to the nearest point. At rest this
norm has a corner. Therefore a linearization exists only for each direction separately.
In an oscillation the printed term has no damping, because its force is the same on the
way in and on the way out. It adds a bias.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from diagrams import Scenario
from studies.nonlinear.head_on import HeadOn, head_on
from systems.laws.impedance_controller import obstacle_speed

Variant = Literal["printed", "closing"]
VARIANTS: tuple[Variant, ...] = get_args(Variant)
#: Points of a cycle in the integrals of the describing function.
_CYCLE_POINTS = 240
#: Control periods of a cycle for the sampled describing function.
_CYCLE_TICKS = 24


@dataclass(frozen=True)
class OneSidedModel:
    """Linear model on one side of rest: M x'' + D x' + K x = 0."""

    direction: str
    """``approaching`` or ``receding``."""
    stiffness_n_m: float
    """Stiffness K_r - df/dc, N/m."""
    damping_n_s_m: float
    """D_r plus the damping of the velocity term on this side, N s/m."""
    mass_kg: float
    """Virtual mass M."""

    @property
    def poles(self) -> NDArray[np.complex128]:
        """(2,) poles, 1/s."""
        roots = np.roots([self.mass_kg, self.damping_n_s_m, self.stiffness_n_m])
        return roots.astype(complex)

    @property
    def natural_frequency_rad_s(self) -> float:
        """sqrt(K/M); 0 if the stiffness is not positive."""
        return math.sqrt(max(self.stiffness_n_m, 0.0) / self.mass_kg)

    @property
    def damping_ratio(self) -> float | None:
        """D / (2 sqrt(K M)), or None if the stiffness is not positive."""
        if self.stiffness_n_m <= 0.0:
            return None
        return self.damping_n_s_m / (2.0 * math.sqrt(self.stiffness_n_m * self.mass_kg))

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
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
    """Describing function of a velocity term over the speed amplitude A.

    A velocity term is the dependence of the law's force on the obstacle's speed. The
    clearance oscillates as c = c_0 + (A/w) sin(w t).
    """

    amplitudes_m_s: NDArray[np.float64]
    """(n,) speed amplitudes A, m/s."""
    bias_n: NDArray[np.float64]
    """(n,) mean of f(c, s) - f(c, 0), N. Positive: away from the obstacle."""
    damping_n_s_m: NDArray[np.float64]
    """(n,) damping by the first harmonic, N s/m. If negative, energy is added."""
    sampled_bias_n: NDArray[np.float64]
    """(n,) bias with the speed s that the controller computes, N."""
    sampled_damping_n_s_m: NDArray[np.float64]
    """(n,) damping with the speed s that the controller computes, N s/m."""


@dataclass(frozen=True, eq=False)
class VelocityTermVariant:
    """Models of one velocity term: ``printed`` or ``closing``."""

    velocity_term: Variant
    """``printed``: s = |dC/dt|. ``closing``: s is the speed of approach."""
    approaching: OneSidedModel
    """Model while the clearance c decreases."""
    receding: OneSidedModel
    """Model while the clearance c increases."""
    describing: DescribingFunction
    """Describing function at the equilibrium distance."""

    @property
    def amplitude_ratio(self) -> float | None:
        """Ratio of successive amplitudes of a very small oscillation.

        The models ``approaching`` and ``receding`` are each valid for half a cycle. A
        model with the damping ratio z multiplies the amplitude by exp(-pi z/sqrt(1 -
        z^2)) in this half. Without an oscillation the ratio is None.
        """
        ratio = 1.0
        for side in (self.approaching, self.receding):
            z = side.damping_ratio
            if z is None or abs(z) >= 1.0:
                return None
            ratio *= math.exp(-math.pi * z / math.sqrt(1.0 - z * z))
        return ratio

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
        return {
            "velocity_term": self.velocity_term,
            "sides": [self.approaching, self.receding],
            "amplitude_ratio": self.amplitude_ratio,
            "describing_function": self.describing,
        }


@dataclass(frozen=True, eq=False)
class VelocityTermAnalysis:
    """Models of both velocity terms for one head-on approach."""

    contact: HeadOn
    """Head-on approach that the models belong to."""
    variants: dict[str, VelocityTermVariant]
    """Models by velocity term."""

    @property
    def bias_shift_m(self) -> dict[str, float]:
        """Shift of an oscillation's center at the top speed, m, by velocity term."""
        return {
            name: float(v.describing.bias_n[-1]) / self.contact.stiffness_n_m
            for name, v in self.variants.items()
        }

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
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
    """Computes one-sided models and describing functions of both velocity terms.

    A velocity term is the dependence of the law's force on the speed of the obstacle.

    Args:
        scenario: Scenario with law, attraction and mass.
        to_go_m: Distance from the obstacle's face to the goal, m, see ``head_on``.

    Returns:
        Models by velocity term.

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
    """Computes the describing function of a velocity term up to the top speed.

    A velocity term is the dependence of the law's force on the obstacle's speed.

    Args:
        contact: Head-on approach to an obstacle, with law and equilibrium distance.
        term: Velocity term: ``printed`` or ``closing``.
        points: Number of speed amplitudes.

    Returns:
        Bias and damping by speed amplitude.
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
    """Speeds s of an oscillation with c' = A cos(phase)."""
    rate = amplitude * np.cos(phase)
    return np.abs(rate) if term == "printed" else np.maximum(-rate, 0.0)


def _harmonics(
    added: Callable[[float], float],
    speeds: NDArray[np.float64],
    phase: NDArray[np.float64],
    amplitude: float,
) -> tuple[float, float]:
    """(bias, damping) of a force over one cycle, where the phase is that of c'."""
    force = np.array([added(s) for s in speeds.tolist()])
    return float(force.mean()), -2.0 * float(np.mean(force * np.cos(phase))) / amplitude


def _sampled_harmonics(
    contact: HeadOn, added: Callable[[float], float], amplitude: float, term: Variant
) -> tuple[float, float]:
    """(bias, damping) with the speed s that the controller computes over one period."""
    tick_s = contact.scenario.tick_s
    omega = 2.0 * np.pi / (_CYCLE_TICKS * tick_s)
    turn = omega * tick_s
    # The phases are shifted against the symmetric grid of the exact integral.
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
    """Returns the speed that the controller computes for an obstacle straight ahead.

    Args:
        now_m: (n,) distances of the obstacle, m.
        before_m: (n,) distances one control period earlier, m.
        term: Definition of the speed. ``printed``: magnitude of the distance's rate.
            ``closing``: speed of approach, 0 if the distance grows.
        tick_s: Control period, s.

    Returns:
        (n,) speeds, m/s, at least 0.
    """
    pairs = zip(now_m.tolist(), before_m.tolist(), strict=True)
    closing = term == "closing"
    return np.array(
        [obstacle_speed((c, 0.0), (then, 0.0), closing, tick_s) for c, then in pairs]
    )
