"""Point-mass model of the robot, for energy bounds and safety certificates.

The control point P, ahead of the wheel axle, is a point mass in continuous time:

    M p'' = F_m + sum of f(c, s) u,   |p'| <= top speed

F_m is the attraction, c the distance from an obstacle, s the relative speed, and u the
direction of the push. The model takes the nearest point of every body as exactly known.
Obstacles rest, and there is neither motor lag nor sampling. Force and energy of the law
are those of ``RadialLaw``. The attraction is that of
``systems.laws.impedance.attraction_force``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.loops import point_mass_kernels as kernels
from analysis.loops.radial_law import RadialLaw, radial_law
from diagrams import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point, nearest_point_on_rectangle

VelocityTermModel = Literal["none", "printed", "closing"]
_TERMS = {"none": 0, "printed": 1, "closing": 2}
#: Runge-Kutta step of ``PointMass.run``, s. In this time the stiffest contact mode
#: that the margins allow advances by a twentieth of a radian.
STEP_S = 0.02


@dataclass(frozen=True, eq=False)
class PointMassRuns:
    """Results of n runs of the point-mass model."""

    starts: NDArray[np.float64]
    """(n, 4) initial states: x, y in m and vx, vy in m/s."""
    contact_times_s: NDArray[np.float64]
    """(n,) times of the first contact with a body, s. Without contact: infinity."""
    closest_m: NDArray[np.float64]
    """(n,) smallest distances between P and a body, m."""
    energy_rises_j: NDArray[np.float64]
    """(n,) largest rises of the energy V above its smallest earlier value, J."""

    @property
    def collided(self) -> NDArray[np.bool_]:
        """(n,) whether P touched a body."""
        return np.isfinite(self.contact_times_s)


@dataclass(frozen=True, eq=False)
class PointMass:
    """Point-mass model of a scenario's gains, with the bodies as they are at 0 s."""

    law: RadialLaw
    """Repulsion, tabulated by distance."""
    rectangles: NDArray[np.float64]
    """(n, 5) bodies in W: x, y, theta, length, width, in m and rad; the source last."""
    p_WS: NDArray[np.float64]
    """(2,) position of the source in W, m."""
    p_WP: NDArray[np.float64]
    """(2,) control point P at the start in W, m."""
    stiffness_n_m: float
    """K_r."""
    damping_n_s_m: float
    """D_r."""
    follow_distance_m: float
    """d_f."""
    mass_kg: float
    top_speed_m_s: float
    all_bodies: bool
    """Whether all bodies push P. If false, only the nearest one pushes."""

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
        """(n,) distances of points (n, 2) from the nearest body, m."""
        return self.distances(points).min(axis=1)

    def obstacle_energy(self, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) potential energies of the repulsion at (n, bodies) distances, J."""
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
        """(n,) energies V of states (n, 4), J: kinetic plus potential."""
        states = np.asarray(states, dtype=float)
        kinetic = 0.5 * self.mass_kg * np.sum(states[:, 2:] ** 2, axis=1)
        return kinetic + self.potential(states[:, :2])

    def force(self, states: ArrayLike, term: VelocityTermModel) -> NDArray[np.float64]:
        """Returns the (n, 2) sum of all forces on the point mass in W, N.

        ``states`` are (n, 4) x, y, vx, vy in W, m and m/s. The repulsion takes the
        speed as zero with ``term`` ``none``, |dC/dt| with ``printed``, and the speed of
        approach with ``closing``. C is the vector to the nearest point of a body.
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
        """Integrates from each start until contact or until the end of the time.

        The method is classical Runge-Kutta with fixed steps of STEP_S. After each step,
        |v| is limited to the top speed. In the limit of short steps this equals the
        speed limit of the model. ``starts`` and ``term`` are those of ``force``. The
        point mass touches a body at the distance ``contact_m``.
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
        """Returns the (steps + 1, 4) states from one start at intervals of STEP_S.

        ``start`` and ``term`` are those of ``force``. Contact with a body does not end
        the run.
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
        """(n, 6) bodies: center, cosine and sine of the heading, half extents."""
        x, y, theta, length, width = self.rectangles.T
        half = 0.5 * np.array([length, width])
        return np.stack([x, y, np.cos(theta), np.sin(theta), *half], axis=1)


def point_mass(scenario: Scenario) -> PointMass:
    """Builds the point-mass model of a scenario, with the bodies as they are at 0 s.

    Raises InputError if the law is not known or has no radial force, or if the pushes
    of more than three bodies are added (``aggregation: sum``).
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
