"""Phase plane of the head-on approach, with basin of contact and certified region."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.point_mass import PointMass, VelocityTermModel
from diagrams import Scenario
from studies.nonlinear.head_on import HeadOn, head_on

#: First: half width of the obstacle's face, m. Second: depth of the obstacle, m.
_FACE_M = (4.0, 0.1)


@dataclass(frozen=True, eq=False)
class PhasePortrait:
    """Phase plane of clearance c and its rate c', over a grid of starts."""

    contact: HeadOn
    """The head-on approach."""
    velocity_term: str
    """``none``, ``printed`` or ``closing``."""
    contact_m: float
    """Distance from the face at which P touches the face, m."""
    clearances_m: NDArray[np.float64]
    """(n,) clearances c of the starts, m."""
    rates_m_s: NDArray[np.float64]
    """(m,) rates c' of the starts, m/s."""
    accelerations_m_s2: NDArray[np.float64]
    """(n, m) accelerations c'' at the starts, m/s^2."""
    collides: NDArray[np.bool_]
    """(n, m) whether the simulation from the start leads to contact."""
    certified_speed_m_s: NDArray[np.float64]
    """(n,) speeds below which a start is certified, m/s; NaN: not even rest is."""
    trajectories: tuple[NDArray[np.float64], ...]
    """(k, 2) c, m, and c', m/s, of some runs."""

    @property
    def certified(self) -> NDArray[np.bool_]:
        """(n, m) whether the energy certifies that the start leads to no contact."""
        limit = np.nan_to_num(self.certified_speed_m_s, nan=-1.0)
        return np.abs(self.rates_m_s)[None, :] < limit[:, None]

    @property
    def ratio(self) -> float:
        """Number of certified starts over the number of starts without contact."""
        return float(self.certified.sum() / np.count_nonzero(~self.collides))

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
        return {
            "law": self.contact.law.name,
            "velocity_term": self.velocity_term,
            "to_go_m": self.contact.to_go_m,
            "contact_m": self.contact_m,
            "equilibria_m": self.contact.equilibria_m,
            "starts": int(self.collides.size),
            "collisions": int(self.collides.sum()),
            "certified": int(self.certified.sum()),
            "certified_collisions": int((self.certified & self.collides).sum()),
            "certified_by_safe": self.ratio,
        }


def head_on_model(contact: HeadOn) -> PointMass:
    """Returns the point-mass model of a head-on approach to an obstacle.

    The obstacle has a wide face at x = 0. The goal lies ``to_go_m`` behind the face.
    The point mass is at x = -c, y = 0, with the clearance c.

    Args:
        contact: Head-on approach with law and gains.

    Returns:
        The model.
    """
    scenario = contact.scenario
    follow = max(scenario.follower.attraction.follow_distance_m, 1.0)
    p_WS = np.array([contact.to_go_m + follow, 0.0])
    depth = _FACE_M[1]
    return PointMass(
        law=contact.law,
        rectangles=np.array([[0.5 * depth, 0.0, 0.0, depth, 2.0 * _FACE_M[0], 0.0]]),
        p_WS=p_WS,
        p_WP=np.array([-1.0, 0.0]),
        stiffness_n_m=scenario.follower.attraction.stiffness_n_m,
        damping_n_s_m=scenario.follower.attraction.damping_n_s_m,
        follow_distance_m=follow,
        mass_kg=scenario.only.robot.mass_kg,
        top_speed_m_s=scenario.only.robot.top_speed_m_s,
        all_bodies=False,
    )


def phase_portrait(
    scenario: Scenario,
    *,
    to_go_m: float | None = None,
    velocity_term: VelocityTermModel | None = None,
    points: int = 41,
) -> PhasePortrait:
    """Computes the phase plane of a head-on approach to an obstacle.

    The clearances reach to 1.5 m, and the speeds to the top speed.

    Args:
        scenario: Scenario with law and gains.
        to_go_m: Distance from the obstacle's face to the goal, m, see ``head_on``.
        velocity_term: Velocity term to use instead of the scenario's: ``none``,
            ``printed`` or ``closing``.
        points: Number of starts along each axis.

    Returns:
        Accelerations, contacts and certified speeds over the grid of starts.

    Raises:
        InputError: The law is not known.
        ValueError: The law has no radial force.
    """
    contact = head_on(scenario, to_go_m=to_go_m)
    term = velocity_term or scenario.follower.collision_vector.velocity_term
    model = head_on_model(contact)
    least = scenario.follower.ultrasonic.minimum_range_m
    c = np.linspace(least + 0.005, 1.5, points)
    rate = np.linspace(-model.top_speed_m_s, model.top_speed_m_s, points)
    grid_c, grid_rate = np.meshgrid(c, rate, indexing="ij")
    states = np.zeros((c.size * rate.size, 4))
    states[:, 0], states[:, 2] = -grid_c.ravel(), -grid_rate.ravel()
    runs = model.run(states, contact_m=least, duration_s=10.0, term=term)
    force = model.force(states, term)[:, 0]
    shape = grid_c.shape
    return PhasePortrait(
        contact=contact,
        velocity_term=term,
        contact_m=least,
        clearances_m=c,
        rates_m_s=rate,
        accelerations_m_s2=-force.reshape(shape) / model.mass_kg,
        collides=runs.collided.reshape(shape),
        certified_speed_m_s=certified_speeds(model, c, least),
        trajectories=_trajectories(model, term, least),
    )


def certified_speeds(
    model: PointMass, clearances: NDArray[np.float64], least: float
) -> NDArray[np.float64]:
    """Returns the speed below which a robot cannot reach an obstacle, from its energy.

    On the way to contact, the point mass must pass the largest potential between its
    clearance and contact. The kinetic energy at the certified speed is the difference
    between this largest potential and the potential at the clearance. Two cases are
    special:

    - If the potential at the clearance itself is the largest, not even rest is
      certified.
    - If even the top speed does not suffice to pass, every speed is certified.

    Args:
        model: Head-on approach along x: the point mass is at -c, the obstacle's face at
            0.
        clearances: (n,) ascending clearances c, m.
        least: Clearance at which the point mass touches the face, m.

    Returns:
        (n,) speeds, m/s; NaN where not even rest is certified.
    """
    fine = np.arange(least, clearances[-1] + 1e-3, 1e-3)
    points = np.column_stack([-fine, np.zeros_like(fine)])
    potential = model.potential(points)
    spare = np.maximum.accumulate(potential) - potential
    walled = np.maximum.accumulate(spare) > model.top_kinetic_energy_j
    speed = np.sqrt(2.0 * spare / model.mass_kg)
    speed = np.where(spare > 0.0, speed, np.nan)
    # Behind such a barrier the top speed itself is certified too.
    speed[walled] = np.nextafter(model.top_speed_m_s, np.inf)
    below = np.searchsorted(fine, clearances, side="right") - 1
    above = np.minimum(below + 1, len(fine) - 1)
    return np.minimum(speed[below], speed[above])


def _trajectories(
    model: PointMass, term: VelocityTermModel, least: float
) -> tuple[NDArray[np.float64], ...]:
    top = model.top_speed_m_s
    starts = [(1.45, -top), (0.8, -top), (0.25, -0.9 * top)]
    tracks = []
    for c, rate in (*starts, (0.1, 0.0)):
        states = model.trajectory([-c, 0.0, -rate, 0.0], duration_s=12.0, term=term)
        track = np.column_stack([-states[:, 0], -states[:, 2]])
        hit = np.flatnonzero(track[:, 0] <= least)
        tracks.append(track[: hit[0] + 1] if len(hit) else track)
    return tuple(tracks)
