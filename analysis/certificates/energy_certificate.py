"""Starts that provably never collide: the energy certificate.

In the point-mass model (``analysis.models.point_mass``)

    V = M |v|^2 / 2 + K_r (|p_S - p| - d_f)^2 / 2 + U(c)

cannot grow while the velocity term is covered by D_r
(``analysis.nonlinear.velocity_passivity``); the clamp on |v| only takes energy. For
each body let E(p) be the lowest level over which any path from p to contact with it
must climb. A start with V < E(p) never touches it. Nor does one whose every
path to contact crosses places where even the top speed is too little, M
v_max^2 / 2 < E - W, W the potential energy there: the clamp keeps the kinetic
energy below that. A start is certified if this holds for every body.

E is found on a grid, from bounds of W over whole cells: distances from a
source and from a body change by no more than P moves, and U falls with c. So
the result holds between the grid's points as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import binary_propagation

from analysis.certificates.escape_levels import border_cells, cell_bounds, climb
from analysis.models.ideal_scenarios import moving_bodies
from analysis.models.point_mass import PointMass, VelocityTermModel, point_mass
from analysis.nonlinear.velocity_passivity import (
    VelocityTermPassivity,
    velocity_term_passivity,
)
from diagrams import Scenario
from systems.framework.input_error import InputError

#: Floor round start, source and obstacles that is looked at, m.
MARGIN_M = 1.5
#: Cells of the grid at most; more take minutes.
MOST_CELLS = 4_000_000


@dataclass(frozen=True, eq=False)
class EnergyCertificate:
    """Levels on a grid of cells, and what follows from them."""

    scenario: Scenario
    """Whose start, world and law are meant."""
    model: PointMass
    """What the certificate is about."""
    passivity: VelocityTermPassivity
    """Whether the velocity term is covered."""
    contact_m: float
    """P nearer than this to a body is contact, m."""
    cell_m: float
    """Side of a cell, m."""
    x_m: NDArray[np.float64]
    """(nx,) centres of the cells, m."""
    y_m: NDArray[np.float64]
    """(ny,) centres of the cells, m."""
    potential_j: NDArray[np.float64]
    """(nx, ny) upper bound of the potential energy in each cell, J."""
    free: NDArray[np.bool_]
    """(nx, ny) cells that are not wholly in contact."""
    escape_j: NDArray[np.float64]
    """(bodies, nx, ny) lower bound of E, J; what it is in contact means nothing."""
    any_speed: NDArray[np.bool_]
    """(bodies, nx, ny) cells from which no allowed speed leads to contact."""

    @property
    def term(self) -> VelocityTermModel:
        """The velocity term that the certificate covers."""
        if not self.passivity.covered:
            return "none"
        return "printed" if self.passivity.velocity_term == "printed" else "closing"

    @property
    def contact_energy_j(self) -> float:
        """Least energy at contact, J: below it no start collides."""
        return float(self.escape_j[:, self.free].min())

    @property
    def rest_share(self) -> float:
        """Share of the free floor from which rest is certified."""
        return float(np.mean(np.isfinite(self.largest_speed()[self.free])))

    @property
    def any_speed_share(self) -> float:
        """Share of the free floor certified up to the top speed."""
        return float(np.mean(np.all(self.any_speed[:, self.free], axis=0)))

    def largest_speed(self) -> NDArray[np.float64]:
        """(nx, ny) largest certified speed, m/s; NaN: not even rest."""
        top = self.model.top_speed_m_s
        spare = self.escape_j - self.potential_j
        speed = np.sqrt(2.0 * np.maximum(spare, 0.0) / self.model.mass_kg)
        speed = np.where(spare > 0.0, speed, -1.0)
        slowest = np.where(self.any_speed, top, speed).min(axis=0)
        slowest = np.where(self.free & (slowest >= 0.0), slowest, np.nan)
        return np.minimum(slowest, top)

    def certified(self, states: ArrayLike, *, clamp: bool = True) -> NDArray[np.bool_]:
        """Whether starts never collide, on the grid or not at all.

        Args:
            states: (n, 4) x, y, vx, vy, m and m/s.
            clamp: Whether the limit on |v| may be used as well as the energy.

        Returns:
            (n,) False off the grid, in contact, and above the top speed.
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
        """Whether the scenario's own start is; None where bodies move."""
        if moving_bodies(self.scenario):
            return None
        return bool(self.certified([[*self.model.p_WP, 0.0, 0.0]])[0])

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``certificates`` in the JSON document."""
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
    """Finds the certified set of a scenario's point-mass model.

    Args:
        scenario: Bodies are taken to rest where they are at 0 s.
        cell_m: Side of a cell, m; finer cells certify more.
        contact_m: Contact distance of P, m; none: the sensors' least range.
        velocity_term: Another term than the scenario's.

    Returns:
        Levels on a grid of cells, J, and the cells from which no speed leads to
        contact.

    Raises:
        InputError: The law is not known.
        InputError: The law has no radial force, it pulls somewhere, or an
            argument is wrong.
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
    # A margin for the tables of the law and for rounding.
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
    """Lower left and upper right corner of the floor that is looked at, m."""
    points = np.concatenate([model.rectangles[:, :2], [model.p_WP]])
    return points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
