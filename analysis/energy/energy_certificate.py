"""The energy certificate: initial states that provably never collide.

In the point-mass model (``analysis.loops.point_mass``), the robot is a mass M at the
control point p with velocity v. Its energy is

    V = M |v|^2 / 2 + K_r (|p_S - p| - d_f)^2 / 2 + U(c)

The second term is the energy of the attraction to the follow distance d_f from the
source at p_S. U(c) is the energy of the push at distance c from the bodies. The sum of
both terms is the potential energy W(p).

The damping D_r of the attraction removes energy. V cannot grow if it removes at least
the energy that the velocity term of the law adds
(``analysis.energy.velocity_passivity``). The limit of |v| to the top speed v_max only
removes energy.

Every path from p to contact with a body has a largest value of W. The escape energy
E(p) is the smallest of these largest values over all paths. Each of two conditions
excludes contact with the body:

- The energy at the start is too low: V < E(p).
- Every path from p to contact crosses a place q from which even a robot at top speed
  cannot reach contact: W(q) + M v_max^2 / 2 < E(q).

An initial state is certified if, for each body, one of the conditions is satisfied.

E is computed on a grid of cells, from bounds of W over whole cells. If p moves by some
distance, the distances from the source and from a body change by no more than that, and
U decreases with c. Therefore, the bounds are valid at all points of a cell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import binary_propagation

from analysis.energy.escape_levels import border_cells, cell_bounds, climb
from analysis.energy.velocity_passivity import (
    VelocityTermPassivity,
    velocity_term_passivity,
)
from analysis.loops.ideal_scenarios import moving_bodies
from analysis.loops.point_mass import PointMass, VelocityTermModel, point_mass
from diagrams import Scenario
from systems.framework.input_error import InputError

#: Width of the analyzed floor around the start and the centers of all bodies, m.
MARGIN_M = 1.5
#: Largest number of cells of the grid. A calculation with more cells takes minutes.
MOST_CELLS = 4_000_000


@dataclass(frozen=True, eq=False)
class EnergyCertificate:
    """Result of the energy certificate: escape energies and certified cells on a grid.

    The escape energy E of a cell and a body is the least energy with which a path from
    the cell to contact with the body is possible. P is the robot's control point.
    """

    scenario: Scenario
    """Scenario with the start, the world and the law."""
    model: PointMass
    """Point-mass model to which the certificate applies."""
    passivity: VelocityTermPassivity
    """Comparison of the power of the velocity term with that of the damping."""
    contact_m: float
    """Distance from a body up to which P is in contact with the body, m."""
    cell_m: float
    """Side of a cell, m."""
    x_m: NDArray[np.float64]
    """(nx,) x of the cell centers, m."""
    y_m: NDArray[np.float64]
    """(ny,) y of the cell centers, m."""
    potential_j: NDArray[np.float64]
    """(nx, ny) upper bound of the potential energy in each cell, J."""
    free: NDArray[np.bool_]
    """(nx, ny) whether a cell has points at which P is not in contact."""
    escape_j: NDArray[np.float64]
    """(bodies, nx, ny) lower bound of E, J. It has no meaning in cells that are not
    ``free``."""
    any_speed: NDArray[np.bool_]
    """(bodies, nx, ny) whether no motion from a cell leads to contact with the body, at
    any speed up to the top speed."""

    @property
    def term(self) -> VelocityTermModel:
        """Velocity term with which the certificate is valid.

        It is ``none`` if the damping does not remove the energy that the term of the
        scenario can add. The certificate is then valid only for a law without this
        term.
        """
        if not self.passivity.covered:
            return "none"
        return "printed" if self.passivity.velocity_term == "printed" else "closing"

    @property
    def contact_energy_j(self) -> float:
        """Least escape energy on the free floor, J. States with less never collide."""
        return float(self.escape_j[:, self.free].min())

    @property
    def rest_share(self) -> float:
        """Share of the free floor where a start at rest is certified, 0 to 1."""
        return float(np.mean(np.isfinite(self.largest_speed()[self.free])))

    @property
    def any_speed_share(self) -> float:
        """Share of the free floor where starts at all allowed speeds are certified."""
        return float(np.mean(np.all(self.any_speed[:, self.free], axis=0)))

    def largest_speed(self) -> NDArray[np.float64]:
        """Returns the (nx, ny) largest certified speed at a start in each cell, m/s.

        It is NaN in cells where not even a start at rest is certified.
        """
        top = self.model.top_speed_m_s
        spare = self.escape_j - self.potential_j
        speed = np.sqrt(2.0 * np.maximum(spare, 0.0) / self.model.mass_kg)
        speed = np.where(spare > 0.0, speed, -1.0)
        slowest = np.where(self.any_speed, top, speed).min(axis=0)
        slowest = np.where(self.free & (slowest >= 0.0), slowest, np.nan)
        return np.minimum(slowest, top)

    def certified(self, states: ArrayLike, *, clamp: bool = True) -> NDArray[np.bool_]:
        """Checks whether initial states are certified never to collide.

        States outside the grid, in contact, or above the top speed are not certified.

        Args:
            states: (n, 4) x, y, vx, vy of the robot's control point, m and m/s.
            clamp: Whether the proof may use the speed limit in addition to the energy.

        Returns:
            (n,) True for certified states.
        """
        states = np.asarray(states, dtype=float)
        i = np.floor((states[:, 0] - self.x_m[0]) / self.cell_m + 0.5).astype(int)
        j = np.floor((states[:, 1] - self.y_m[0]) / self.cell_m + 0.5).astype(int)
        shape = self.free.shape
        on_grid = (i >= 0) & (j >= 0) & (i < shape[0]) & (j < shape[1])
        i, j = np.where(on_grid, i, 0), np.where(on_grid, j, 0)
        free = self.model.clearances(states[:, :2]) > self.contact_m
        slow = np.hypot(*states[:, 2:].T) <= self.model.top_speed_m_s
        safe = self.model.energy(states) < self.escape_j[:, i, j]
        if clamp:
            safe |= self.any_speed[:, i, j]
        return on_grid & free & slow & safe.all(axis=0)

    @property
    def start_certified(self) -> bool | None:
        """Whether the start of the scenario is certified; None if bodies move."""
        if moving_bodies(self.scenario):
            return None
        return bool(self.certified([[*self.model.p_WP, 0.0, 0.0]])[0])

    def to_dict(self) -> dict[str, Any]:
        """Converts the result to an entry of ``certificates`` in the JSON document."""
        return {
            "kind": "energy",
            "law": self.model.law.name,
            "model": "point P, continuous time, exact nearest points, bodies at rest, "
            "speed clamp",
            "velocity_term": self.term,
            "contact_m": self.contact_m,
            "contact_energy_j": self.contact_energy_j,
            "top_kinetic_energy_j": self.model.top_kinetic_energy_j,
            "certified_at_rest_share": self.rest_share,
            "certified_at_any_speed_share": self.any_speed_share,
            "start_certified": self.start_certified,
            "cell_m": self.cell_m,
            "workspace_m": [*self.x_m[[0, -1]], *self.y_m[[0, -1]]],
            "passivity": self.passivity,
        }


def certify_energy(
    scenario: Scenario,
    *,
    cell_m: float = 0.01,
    contact_m: float | None = None,
    velocity_term: str | None = None,
) -> EnergyCertificate:
    """Computes the set of initial states that provably never collide.

    The proof applies to the point-mass model of the scenario.

    Args:
        scenario: Scenario. All bodies are assumed to rest where they are at 0 s.
        cell_m: Side of a grid cell, m. Finer cells certify more states.
        contact_m: Distance of the robot's control point from a body that counts as
            contact, m. None: the least range of the sensors.
        velocity_term: ``printed`` or ``closing``. None: that of the scenario.

    Returns:
        The certificate.

    Raises:
        InputError: The law is not known, has no radial force, or attracts at some
            distance; or an argument is wrong.
    """
    model = point_mass(scenario)
    if contact_m is None:
        contact_m = scenario.follower.ultrasonic.minimum_range_m
    _check(model, cell_m, contact_m)
    low, high = _workspace(model)
    x, y = (
        np.arange(a + 0.5 * cell_m, b + cell_m, cell_m)
        for a, b in zip(low, high, strict=True)
    )
    if len(x) * len(y) > MOST_CELLS:
        raise InputError(
            "cell_m",
            f"{cell_m} makes {len(x) * len(y)} cells; take at least "
            f"{math.sqrt((high - low).prod() / MOST_CELLS):.3f}",
        )
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    shape = (len(x), len(y))
    lower, upper, seeds, blocked = (
        values.reshape(*values.shape[:-1], *shape)
        for values in cell_bounds(model, points, cell_m, contact_m)
    )
    border = border_cells(blocked)
    lower[border] = 0.0
    # The 1e-6 J are a margin for the tables of the law and for rounding.
    escape = np.array([climb(lower, seed, blocked) for seed in seeds]) - 1e-6
    strong = (escape - upper > model.top_kinetic_energy_j) & ~border
    reached = [
        binary_propagation(np.isfinite(seed) & way, np.ones((3, 3)), mask=way)
        for seed, way in zip(seeds, ~(strong | blocked), strict=True)
    ]
    return EnergyCertificate(
        scenario=scenario,
        model=model,
        passivity=velocity_term_passivity(scenario, velocity_term),
        contact_m=contact_m,
        cell_m=cell_m,
        x_m=x,
        y_m=y,
        potential_j=upper,
        free=~blocked,
        escape_j=escape,
        any_speed=~np.array(reached) & ~blocked,
    )


def _check(model: PointMass, cell_m: float, contact_m: float) -> None:
    if not cell_m > 0.0:
        raise InputError("cell_m", f"{cell_m} must be above 0")
    if not 0.0 <= contact_m < model.law.range_m:
        raise InputError(
            "contact_m",
            f"{contact_m} must lie between 0 and the sensors' range "
            f"{model.law.range_m} m",
        )
    if model.law.forces_n.min() < -1e-9:
        raise InputError(
            "law",
            f"{model.law.name!r} pulls toward obstacles at some distances; the "
            "bounds of its energy need a force that is never negative at rest",
        )


def _workspace(model: PointMass) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower left and upper right corner of the analyzed floor, m."""
    points = np.concatenate([model.rectangles[:, :2], [model.p_WP]])
    return points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
