"""What energy a velocity term can feed into the loop, and whether D_r takes it.

A velocity term adds g = f(c, s) - f(c, 0) along u, away from the obstacle. For
a body at rest |u.v| <= s <= |v|, since the nearest point of a convex body
moves no faster than P. Hence the power of g is at most L |v|^2, with L the
steepest |g|/s on the side that does harm: upwards while P recedes (printed
term only), downwards while it approaches. With L <= D_r the whole loop
dissipates, and its energy function proves what it proves without the term.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from analysis.laws.radial_law import INCREMENT_STEPS
from analysis.models.point_mass import STEP_S, point_mass
from diagrams import Scenario


@dataclass(frozen=True)
class VelocityTermPassivity:
    """The sector of a velocity term beside the damping of the attraction."""

    velocity_term: str
    """``printed`` or ``closing``."""
    rise_n_s_m: float
    """Largest (f(c, s) - f(c, 0))/s, and 0 if it never rises, N s/m."""
    fall_n_s_m: float
    """Largest (f(c, 0) - f(c, s))/s, and 0 if it never falls, N s/m."""
    bodies: int
    """How many bodies may push at once."""
    attraction_damping_n_s_m: float
    """D_r, N s/m."""

    @property
    def largest_injection_n_s_m(self) -> float:
        """Largest power that the term gives, by |v|^2, N s/m."""
        harm = self.fall_n_s_m
        if self.velocity_term == "printed":
            harm = max(harm, self.rise_n_s_m)
        return self.bodies * harm

    @property
    def passive_alone(self) -> bool:
        """Whether the term never gives energy."""
        return self.largest_injection_n_s_m <= 0.0

    @property
    def covered(self) -> bool:
        """Whether D_r takes all that the term may give."""
        return self.largest_injection_n_s_m <= self.attraction_damping_n_s_m

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        names = (
            "velocity_term", "rise_n_s_m", "fall_n_s_m", "largest_injection_n_s_m",
            "attraction_damping_n_s_m", "passive_alone", "covered",
        )  # fmt: skip
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True, eq=False)
class EnergyBalance:
    """Where the energy of one run of the point mass goes."""

    passivity: VelocityTermPassivity
    """The bound."""
    times_s: NDArray[np.float64]
    """(n,) s."""
    energies_j: NDArray[np.float64]
    """(n,) V."""
    injected_j: NDArray[np.float64]
    """(n,) work of the velocity term so far; negative: it took energy."""
    dissipated_j: NDArray[np.float64]
    """(n,) work of D_r so far."""
    clearances_m: NDArray[np.float64]
    """(n,) distance of P from the nearest body."""

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        rate = np.diff(self.injected_j)
        return {
            **self.passivity.to_dict(),
            "injected_j": float(rate[rate > 0.0].sum()),
            "absorbed_j": float(-rate[rate < 0.0].sum()),
            "dissipated_j": float(self.dissipated_j[-1]),
            "largest_energy_rise_j": float(np.diff(self.energies_j).max(initial=0.0)),
        }


def velocity_term_passivity(
    scenario: Scenario, velocity_term: str | None = None
) -> VelocityTermPassivity:
    """The sector of the scenario's velocity term, or of another one.

    Args:
        scenario: Law, gains and bodies.
        velocity_term: ``printed`` or ``closing``; None: the scenario's.

    Returns:
        Largest slopes of the push in the obstacle's speed beside D_r, N s/m.

    Raises:
        InputError: The law is not known.
        ValueError: The law has no radial force.
    """
    model = point_mass(scenario)
    increments = model.law.increments_n[:, 1:]
    speeds = INCREMENT_STEPS[1] * np.arange(1, increments.shape[1] + 1)
    slopes = increments / speeds
    return VelocityTermPassivity(
        velocity_term=velocity_term or scenario.follower.collision_vector.velocity_term,
        rise_n_s_m=max(0.0, float(slopes.max())),
        fall_n_s_m=max(0.0, float(-slopes.min())),
        bodies=len(model.rectangles) if model.all_bodies else 1,
        attraction_damping_n_s_m=model.damping_n_s_m,
    )


def energy_balance(
    scenario: Scenario, *, duration_s: float = 30.0, velocity_term: str | None = None
) -> EnergyBalance:
    """Energies along a run of the point mass from the scenario's start.

    Args:
        scenario: Law, gains, bodies and start.
        duration_s: Simulated time, s.
        velocity_term: ``printed`` or ``closing``; None: the scenario's.

    Returns:
        At every step V, what was fed in and what D_r took, J.

    Raises:
        InputError: The law is not known.
        ValueError: The law has no radial force.
    """
    passivity = velocity_term_passivity(scenario, velocity_term)
    model = point_mass(scenario)
    start = np.append(model.p_WP, [0.0, 0.0])
    term: Any = passivity.velocity_term
    states = model.trajectory(start, duration_s=duration_s, term=term)
    added = model.force(states, term) - model.force(states, "none")
    power = np.sum(added * states[:, 2:], axis=1)
    loss = model.damping_n_s_m * np.sum(states[:, 2:] ** 2, axis=1)
    return EnergyBalance(
        passivity=passivity,
        times_s=STEP_S * np.arange(len(states), dtype=float),
        energies_j=model.energy(states),
        injected_j=cumulative_trapezoid(power, dx=STEP_S, initial=0.0),
        dissipated_j=cumulative_trapezoid(loss, dx=STEP_S, initial=0.0),
        clearances_m=model.clearances(states[:, :2]),
    )
