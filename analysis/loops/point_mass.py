"""Point-mass model of the robot, for energy bounds and safety certificates.

The control point P, ahead of the wheel axle, is a point mass in continuous time:

    M p'' = F_m + sum of f(c, s) u,   |p'| <= top speed

F_m is the force of the attraction. f(c, s) is the force of the law, with the distance c
of an obstacle and its relative speed s. The unit vector u points away from the
obstacle. The sum is over all bodies, or has only the term of the nearest body. The
model assumes that the nearest point of every body is known exactly, and that obstacles
rest. It has neither motor lag nor sampling. ``RadialLaw`` gives the force and the
energy of the law. ``systems.laws.impedance.attraction_force`` is the same attraction in
the simulation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.loops import point_mass_kernels as kernels
from analysis.loops.ideal_scenarios import require_single_rectangles
from analysis.loops.radial_law import RadialLaw, radial_law
from diagrams import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point, nearest_point_on_rectangle

VelocityTermModel = Literal["none", "printed", "closing"]
_TERMS = {"none": 0, "printed": 1, "closing": 2}
#: Step of the Runge-Kutta method of ``PointMass``, s. In one step, the fastest
#: oscillation against an obstacle that the stability margins allow advances by 1/20
#: rad.
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
    """Point-mass model of a scenario. All bodies rest where they are at 0 s."""

    law: RadialLaw
    """Force of the law away from a body, as tables."""
    rectangles: NDArray[np.float64]
    """(n, 6) rectangles (x, y, theta, length, width, radius) of the bodies in W, m and
    rad. The body of the source is the last row."""
    p_WS: NDArray[np.float64]
    """(2,) position of the source in W, m."""
    p_WP: NDArray[np.float64]
    """(2,) position of the control point P at the start in W, m."""
    stiffness_n_m: float
    """Stiffness K_r of the attraction, N/m."""
    damping_n_s_m: float
    """Damping D_r of the attraction, N s/m."""
    follow_distance_m: float
    """Follow distance d_f, m."""
    mass_kg: float
    """Virtual mass M, kg."""
    top_speed_m_s: float
    """Top speed of P, m/s."""
    all_bodies: bool
    """Whether all bodies push P. If false, only the nearest one pushes."""

    @property
    def top_kinetic_energy_j(self) -> float:
        """Kinetic energy M v^2 / 2 at the top speed, J."""
        return 0.5 * self.mass_kg * self.top_speed_m_s**2

    def distances(self, points: ArrayLike) -> NDArray[np.float64]:
        """(n, k) distances of points (n, 2) from k rectangles, m; 0 inside."""
        points = np.asarray(points, dtype=float)
        nearest = [nearest_point_on_rectangle(points.T, r) for r in self.rectangles]
        return np.array([np.hypot(x, y) for x, y in nearest]).T

    def clearances(self, points: ArrayLike) -> NDArray[np.float64]:
        """(n,) distances of points (n, 2) from the nearest body, m."""
        return self.distances(points).min(axis=1)

    def obstacle_energy(self, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) potential energies of the push, J, at (n, k) distances, m."""
        energies = self.law.energy(distances)
        return energies.sum(axis=1) if self.all_bodies else energies.max(axis=1)

    def attraction_energy(self, source_distance: ArrayLike) -> NDArray[np.float64]:
        """Energy K_r (r - d_f)^2 / 2, J, at distances r from the source, m."""
        stretch = np.asarray(source_distance) - self.follow_distance_m
        return 0.5 * self.stiffness_n_m * stretch**2

    def potential(self, points: ArrayLike) -> NDArray[np.float64]:
        """(n,) potential energies of attraction and push at points (n, 2) in W, J."""
        points = np.asarray(points, dtype=float)
        r = np.hypot(*(points - self.p_WS).T)
        return self.attraction_energy(r) + self.obstacle_energy(self.distances(points))

    def energy(self, states: ArrayLike) -> NDArray[np.float64]:
        """(n,) sums V of kinetic and potential energy of states (n, 4), J.

        The states are x, y, vx, vy in W, m and m/s.
        """
        states = np.asarray(states, dtype=float)
        kinetic = 0.5 * self.mass_kg * np.sum(states[:, 2:] ** 2, axis=1)
        return kinetic + self.potential(states[:, :2])

    def force(self, states: ArrayLike, term: VelocityTermModel) -> NDArray[np.float64]:
        """Returns the (n, 2) sum of all forces on the point mass in W, N.

        ``states`` are (n, 4) x, y, vx, vy in W, m and m/s. ``term`` selects the speed s
        in the force f(c, s) of the law: zero for ``none``, |dC/dt| for ``printed``, and
        the speed of approach for ``closing``. C is the vector to the nearest point of a
        body.
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
        """Simulates from each start until P touches a body or ``duration_s`` is over.

        The method is classical Runge-Kutta with fixed steps of STEP_S. After each step,
        |v| is limited to the top speed. As the step goes to zero, the motion converges
        to that of the model with its speed limit. ``starts`` are states as in
        ``force``, and ``term`` is that of ``force``. P touches a body at distances up
        to ``contact_m``.
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

        ``start`` is one state as in ``force``, and ``term`` is that of ``force``.
        Contact with a body does not end the run.
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
        """(n, 7) center, cosine and sine of heading, half extents, and radius."""
        x, y, theta, length, width, radius = self.rectangles.T
        half = 0.5 * np.array([length, width])
        return np.stack([x, y, np.cos(theta), np.sin(theta), *half, radius], axis=1)


def point_mass(scenario: Scenario) -> PointMass:
    """Builds the point-mass model of a scenario. All bodies rest as they are at 0 s.

    Raises InputError if the law is not known or has no radial force. Also raises it if
    the scenario adds the pushes of bodies (``aggregation: sum``), and has more than
    three bodies, or a wall or polygon.
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
    if all_bodies:
        require_single_rectangles(scenario)
    rectangles = np.concatenate([body.rectangles(0.0) for body in bodies.values()])
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
