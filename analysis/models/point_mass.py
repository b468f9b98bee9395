"""The model of the certificates: P as a point mass in continuous time.

    M p'' = F_m + sum of f(c, s) u,   |p'| <= top speed

with exact nearest points in all directions, obstacles at rest, no motor lag
and no sampling. Force and energy of the law are those of ``RadialLaw``, the
attraction is that of ``systems.laws.impedance.attraction_force``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.laws.radial_law import RadialLaw, radial_law
from analysis.models import point_mass_kernels as kernels
from diagrams import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point, nearest_point_on_rectangle

VelocityTermModel = Literal["none", "printed", "closing"]
_TERMS = {"none": 0, "printed": 1, "closing": 2}
#: Runge-Kutta step of ``PointMass.run``, s: a twentieth of a radian in the
#: stiffest contact mode that margins allow.
STEP_S = 0.02
#: Slower than this after a run is at rest, m/s.
REST_M_S = 1e-3


@dataclass(frozen=True, eq=False)
class PointMassRuns:
    """What became of n starts."""

    starts: NDArray[np.float64]
    """(n, 4): x, y in m, vx, vy in m/s."""
    contact_times_s: NDArray[np.float64]
    """(n,) when P came as near as the contact distance; infinity: never."""
    closest_m: NDArray[np.float64]
    """(n,) least distance between P and a body."""
    energy_rises_j: NDArray[np.float64]
    """(n,) largest rise of V above its least value so far."""

    @property
    def collided(self) -> NDArray[np.bool_]:
        """(n,) whether P touched a body."""
        return np.isfinite(self.contact_times_s)


@dataclass(frozen=True, eq=False)
class PointMass:
    """The scenario's world and gains, frozen at t = 0."""

    law: RadialLaw
    """Tabulated law."""
    rectangles: NDArray[np.float64]
    """(n, 5) bodies in W, the source last: x, y, theta, length, width."""
    p_WS: NDArray[np.float64]
    """(2,) the source, m."""
    p_WP: NDArray[np.float64]
    """(2,) the control point at the start, m."""
    stiffness_n_m: float
    """K_r."""
    damping_n_s_m: float
    """D_r."""
    follow_distance_m: float
    """d_f."""
    mass_kg: float
    """M."""
    top_speed_m_s: float
    """Largest |v|."""
    all_bodies: bool
    """Forces of all bodies, or of the nearest one alone."""

    @property
    def top_kinetic_energy_j(self) -> float:
        """M v^2 / 2 at the top speed."""
        return 0.5 * self.mass_kg * self.top_speed_m_s**2

    def distances(self, points: ArrayLike) -> NDArray[np.float64]:
        """(n, bodies) distances of points (n, 2) from each body, m; 0 inside."""
        points = np.asarray(points, dtype=float)
        nearest = [nearest_point_on_rectangle(points.T, r) for r in self.rectangles]
        return np.array([np.hypot(x, y) for x, y in nearest]).T

    def clearances(self, points: ArrayLike) -> NDArray[np.float64]:
        """(n,) distances from the nearest body, m."""
        return self.distances(points).min(axis=1)

    def obstacle_energy(self, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) energy of the repulsion at (n, bodies) distances, J."""
        energies = self.law.energy(distances)
        return energies.sum(axis=1) if self.all_bodies else energies.max(axis=1)

    def attraction_energy(self, source_distance: ArrayLike) -> NDArray[np.float64]:
        """K_r (r - d_f)^2 / 2 at distances r from the source, J."""
        stretch = np.asarray(source_distance) - self.follow_distance_m
        return 0.5 * self.stiffness_n_m * stretch**2

    def potential(self, points: ArrayLike) -> NDArray[np.float64]:
        """(n,) potential energy at points (n, 2), J."""
        points = np.asarray(points, dtype=float)
        r = np.hypot(*(points - self.p_WS).T)
        return self.attraction_energy(r) + self.obstacle_energy(self.distances(points))

    def energy(self, states: ArrayLike) -> NDArray[np.float64]:
        """(n,) V of states (n, 4), J."""
        states = np.asarray(states, dtype=float)
        kinetic = 0.5 * self.mass_kg * np.sum(states[:, 2:] ** 2, axis=1)
        return kinetic + self.potential(states[:, :2])

    def force(self, states: ArrayLike, term: VelocityTermModel) -> NDArray[np.float64]:
        """Sum of all forces on P.

        Args:
            states: (n, 4) x, y, vx, vy, m and m/s.
            term: The velocity term: none (s = 0), or as the laws offer it.

        Returns:
            (n, 2) in W, N.
        """
        states = np.ascontiguousarray(states, dtype=float)
        return kernels.forces(states, self._world(term))

    def run(
        self,
        starts: ArrayLike,
        *,
        contact_m: float,
        duration_s: float = 40.0,
        term: VelocityTermModel,
    ) -> PointMassRuns:
        """Integrates every start until contact or the end.

        Classical Runge-Kutta with fixed steps of STEP_S; after each step |v| is
        cut to the top speed, which is the clamp in the limit of short steps.

        Args:
            starts: (n, 4) x, y, vx, vy, m and m/s.
            contact_m: P touches a body that is nearer, m.
            duration_s: Simulated time, s.
            term: The velocity term: none (s = 0), or as the laws offer it.

        Returns:
            Contact times, s, least distances, m, and rises of V, J.
        """
        starts = np.ascontiguousarray(starts, dtype=float)
        steps = round(duration_s / STEP_S)
        times, closest, rises = kernels.run(
            starts, steps, STEP_S, contact_m, self._world(term)
        )
        return PointMassRuns(starts, times, closest, rises)

    def trajectory(
        self, start: ArrayLike, *, duration_s: float, term: VelocityTermModel
    ) -> NDArray[np.float64]:
        """States of one start; contact is ignored.

        Args:
            start: (4,) x, y, vx, vy, m and m/s.
            duration_s: Simulated time, s.
            term: The velocity term: none (s = 0), or as the laws offer it.

        Returns:
            (steps + 1, 4) x, y, vx, vy, STEP_S apart.
        """
        start = np.ascontiguousarray(start, dtype=float)
        steps = round(duration_s / STEP_S)
        return kernels.trajectory(start, steps, STEP_S, self._world(term))

    def _world(self, term: VelocityTermModel) -> tuple[Any, ...]:
        gains = (
            self.stiffness_n_m,
            self.damping_n_s_m,
            self.follow_distance_m,
            self.mass_kg,
            self.top_speed_m_s,
            float(self.all_bodies),
            float(_TERMS[term]),
        )
        tables = (self.law.forces_n, self.law.energies_j, self.law.increments_n)
        return self._bodies(), self.p_WS, gains, tables

    def _bodies(self) -> NDArray[np.float64]:
        """(n, 6) centre, cosine and sine of the heading, half extents."""
        x, y, theta, length, width = self.rectangles.T
        half = 0.5 * np.array([length, width])
        return np.stack([x, y, np.cos(theta), np.sin(theta), *half], axis=1)


def point_mass(scenario: Scenario) -> PointMass:
    """The point-mass model of a scenario, its bodies at rest where they are at 0 s.

    Raises:
        InputError: The law is not known.
        InputError: The law has no radial force, or ``aggregation: sum`` meets
            more bodies than the controller takes.
    """
    bodies = scenario.bodies()
    all_bodies = scenario.follower.collision_vector.aggregation == "sum"
    if all_bodies and len(bodies) > 3:
        raise InputError(
            "collision_vector.aggregation",
            "the sum over the nearest 3 of "
            f"{len(bodies)} bodies has no energy; use 'paper' or 'nearest', or fewer "
            "obstacles",
        )
    rectangles = np.array([body.rectangle(0.0) for body in bodies.values()])
    attraction, robot = scenario.follower.attraction, scenario.only.robot
    return PointMass(
        law=radial_law(scenario),
        rectangles=rectangles,
        p_WS=rectangles[-1, :2].copy(),
        p_WP=np.array(control_point(scenario.only.start.pose, robot.control_point_m)),
        stiffness_n_m=attraction.stiffness_n_m,
        damping_n_s_m=attraction.damping_n_s_m,
        follow_distance_m=attraction.follow_distance_m,
        mass_kg=robot.mass_kg,
        top_speed_m_s=robot.top_speed_m_s,
        all_bodies=all_bodies,
    )
