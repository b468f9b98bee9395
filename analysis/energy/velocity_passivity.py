"""Energy that a velocity term feeds into the loop, compared with the damping D_r.

A velocity term is the dependence of the law's force f(c, s) on the speed s. It adds the
force g = f(c, s) - f(c, 0) along u, away from the obstacle. The robot's control point
has the velocity v. For a body at rest, |u.v| <= s <= |v|, because the nearest point of
a convex body moves no faster than the control point. Hence the power of g is at most L
|v|^2. L is the largest |g|/s for the sign of g that adds energy:

- g > 0 while the robot moves away (printed term only)
- g < 0 while the robot approaches

If L <= D_r, the whole loop dissipates energy. All conclusions from its energy function
without the velocity term then remain valid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from analysis.loops.point_mass import STEP_S, point_mass
from analysis.loops.radial_law import INCREMENT_STEPS
from diagrams import Scenario


@dataclass(frozen=True)
class VelocityTermPassivity:
    """Bounds of a velocity term, compared with the damping of the attraction."""

    velocity_term: str
    """``printed`` or ``closing``."""
    rise_n_s_m: float
    """Largest (f(c, s) - f(c, 0))/s, N s/m. If the force never increases with s: 0."""
    fall_n_s_m: float
    """Largest (f(c, 0) - f(c, s))/s, N s/m. If the force never decreases with s: 0."""
    bodies: int
    """Largest number of bodies that push at the same time."""
    attraction_damping_n_s_m: float
    """Damping D_r of the attraction, N s/m."""

    @property
    def largest_injection_n_s_m(self) -> float:
        """Largest power of the velocity term over |v|^2, N s/m."""
        harm = self.fall_n_s_m
        if self.velocity_term == "printed":
            harm = max(harm, self.rise_n_s_m)
        return self.bodies * harm

    @property
    def passive_alone(self) -> bool:
        """Whether the term never adds energy."""
        return self.largest_injection_n_s_m <= 0.0

    @property
    def covered(self) -> bool:
        """Whether D_r dissipates at least the energy that the term can add."""
        return self.largest_injection_n_s_m <= self.attraction_damping_n_s_m

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
        names = (
            "velocity_term", "rise_n_s_m", "fall_n_s_m", "largest_injection_n_s_m",
            "attraction_damping_n_s_m", "passive_alone", "covered",
        )  # fmt: skip
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True, eq=False)
class EnergyBalance:
    """Energies along one run of the point mass."""

    passivity: VelocityTermPassivity
    """Bounds of the velocity term."""
    times_s: NDArray[np.float64]
    """(n,) times, s."""
    energies_j: NDArray[np.float64]
    """(n,) energies V: kinetic plus potential."""
    injected_j: NDArray[np.float64]
    """(n,) work of the velocity term so far. If negative, the term removed energy."""
    dissipated_j: NDArray[np.float64]
    """(n,) energy that D_r has dissipated so far."""
    clearances_m: NDArray[np.float64]
    """(n,) distances of P from the nearest body."""

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
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
    """Computes how much power the velocity term of a law can add.

    A velocity term is the dependence of the law's force on the speed of the obstacle.

    Args:
        scenario: Scenario with law, gains and bodies.
        velocity_term: ``printed`` or ``closing``. With None: the scenario's.

    Returns:
        Largest slopes of the push in the obstacle's speed, and the damping of the
        attraction.

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
    """Computes the energies along a run of the point mass from the scenario's start.

    A velocity term is the dependence of the law's force on the speed of the obstacle.

    Args:
        scenario: Scenario with law, gains, bodies and start.
        duration_s: Simulated time, s.
        velocity_term: ``printed`` or ``closing``. With None: the scenario's.

    Returns:
        Energy, work of the velocity term, and energy that the damping dissipates, at
        every step.

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
