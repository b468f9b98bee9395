"""Energy that a velocity term feeds into the loop, compared with the damping D_r.

The law pushes the robot away from an obstacle with the force f(c, s), where c is the
distance and s the relative speed of the obstacle. Its velocity term is the additional
force g = f(c, s) - f(c, 0). It acts along the unit vector u, away from the obstacle.
The robot's control point has the velocity v.

For a body at rest, s <= |v|, because the vector to the nearest point of a convex body
changes no faster than the control point moves. If L is the largest value of |g|/s, the
power of g is therefore at most |g| |v| <= L |v|^2. Only values of g that add energy
count in L:

- g > 0, which adds energy while the robot moves away (``printed`` term only)
- g < 0, which adds energy while the robot approaches

The damping of the attraction removes the power D_r |v|^2. If L <= D_r, the velocity
term cannot make the kinetic plus potential energy grow. Conclusions from this energy
are then valid for a law with this term, too.
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
    """Definition of the speed s: ``printed``, the rate of change of the vector to the
    obstacle, or ``closing``, the speed of approach."""
    rise_n_s_m: float
    """Largest (f(c, s) - f(c, 0))/s, N s/m; at least 0."""
    fall_n_s_m: float
    """Largest (f(c, 0) - f(c, s))/s, N s/m; at least 0."""
    bodies: int
    """Largest number of bodies that push at the same time."""
    attraction_damping_n_s_m: float
    """Damping D_r of the attraction, N s/m."""

    @property
    def largest_injection_n_s_m(self) -> float:
        """Largest power that the velocity term can add, divided by |v|^2, N s/m."""
        harm = self.fall_n_s_m
        if self.velocity_term == "printed":
            harm = max(harm, self.rise_n_s_m)
        return self.bodies * harm

    @property
    def passive_alone(self) -> bool:
        """Whether the velocity term never adds energy."""
        return self.largest_injection_n_s_m <= 0.0

    @property
    def covered(self) -> bool:
        """Whether D_r removes at least the energy that the velocity term can add."""
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
    """(n,) energies V, J: kinetic plus potential."""
    injected_j: NDArray[np.float64]
    """(n,) work of the velocity term from the start to each time, J. A negative value
    means that the term has removed energy."""
    dissipated_j: NDArray[np.float64]
    """(n,) energy that the damping D_r has removed from the start to each time, J."""
    clearances_m: NDArray[np.float64]
    """(n,) distances of the control point P from the nearest body, m."""

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

    The velocity term is the part of the law's force that depends on the relative speed
    of the obstacle.

    Args:
        scenario: Scenario with law, gains and bodies.
        velocity_term: ``printed`` or ``closing``. None: that of the scenario.

    Returns:
        Largest ratios of the velocity term to the speed, and the damping of the
        attraction.

    Raises:
        InputError: The law is not known or has no radial force, or the scenario adds
            the pushes of more than three bodies.
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

    The velocity term is the part of the law's force that depends on the relative speed
    of the obstacle.

    Args:
        scenario: Scenario with law, gains, bodies and start.
        duration_s: Simulated time, s.
        velocity_term: ``printed`` or ``closing``. None: that of the scenario.

    Returns:
        Energy, work of the velocity term, and energy that the damping removes, at every
        step.

    Raises:
        InputError: The law is not known or has no radial force, or the scenario adds
            the pushes of more than three bodies.
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
