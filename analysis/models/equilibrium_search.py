"""Where forces cancel: a search that leaves out no part of the workspace.

The workspace is cut into square cells. A cell in whose middle the force exceeds
what it can change by within the cell (a Lipschitz bound of attraction and law,
the law's taken from samples of the controller every millimetre) holds no
equilibrium; any other one is quartered, down to a smallest size. What is left
lies about the equilibria, and Newton's method with the blocks' own gradient
finds them from there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label, maximum_filter1d

from analysis.models.force_field import ForceField
from systems.world.geometry import nearest_point_on_rectangle, rotate

__all__ = ["CONTACT_CELLS", "CellSearch", "Leftover", "SearchArea"]

#: Spacing of the samples of the law, m.
_SAMPLE_M = 1e-3
#: Edge of the first cells, m.
_FIRST_CELL_M = 0.25

#: Nearer to a body than so many smallest cells is contact, and not searched: there
#: the direction to the nearest point turns within a cell.
CONTACT_CELLS = 2

#: Smallest x, largest x, smallest y, largest y, m.
SearchArea = tuple[float, float, float, float]


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    size = np.linalg.norm(vectors, axis=1)
    return vectors / np.maximum(size, 1e-300)[:, None]


@dataclass(frozen=True)
class Leftover:
    """Neighbouring smallest cells that may hold an equilibrium."""

    centres: NDArray[np.float64]
    """(n, 2) m."""
    strengths: NDArray[np.float64]
    """(n,) force in the middle, N."""
    change: NDArray[np.float64]
    """(n,) by how much it can vary within the cell at most, N."""
    winding: NDArray[np.int64]
    """(n,) turns of the force around each cell: the index of what it holds."""
    switches: NDArray[np.bool_]
    """(n,) whether the nearest body changes within the cell."""


class CellSearch:
    """Bounds of the force in cells, and the cells that they leave over.

    Args:
        field: The force.
    """

    def __init__(self, field: ForceField) -> None:
        scenario = field.loop.scenario
        self._p_WS = field.p_WS
        self._attraction = scenario.attraction
        self._all_bodies = scenario.collision_vector.aggregation == "sum"
        self._bodies = [body.rectangle(0.0) for body in scenario.bodies().values()]
        farthest = field.reach_m + 1.0
        self._c = np.arange(0.0, farthest, _SAMPLE_M)
        # At a distance of exactly zero a push has no direction.
        self._f = field.law(np.maximum(self._c, 1e-9))
        self._slope = np.abs(np.diff(self._f, append=self._f[-1])) / _SAMPLE_M
        self._bend = np.abs(self._f) / np.maximum(self._c, _SAMPLE_M)

    def left_over(
        self, area: SearchArea, smallest_m: float
    ) -> tuple[list[Leftover], int, float]:
        """Cells that cannot be left out, in groups of neighbours.

        Args:
            area: To search.
            smallest_m: Edge below which cells are not quartered any more, m.

        Returns:
            Groups, number of cells that were looked at, edge of the last cells.
        """
        edge = _FIRST_CELL_M
        x = np.arange(area[0] + edge / 2, area[1] + edge / 2, edge)
        y = np.arange(area[2] + edge / 2, area[3] + edge / 2, edge)
        cells = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        origin = cells[0] - edge / 2
        looked_at = 0
        while True:
            looked_at += len(cells)
            excluded, change = self._excluded(cells, edge)
            cells, change = cells[~excluded], change[~excluded]
            if edge <= smallest_m or not len(cells):
                break
            edge /= 2.0
            corners = edge / 2.0 * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
            cells = (cells[:, None, :] + corners).reshape(-1, 2)
        return self._groups(cells, change, origin, edge), looked_at, edge

    def outside_is_empty(self, area: SearchArea) -> bool:
        """Whether beyond the area the attraction exceeds every repulsion."""
        x, y = self._p_WS
        gap = min(x - area[0], area[1] - x, y - area[2], area[3] - y)
        d_f = self._attraction.follow_distance_m
        pull = self._attraction.stiffness_n_m * (gap - d_f)
        nearest = min(self._distance_to_edge(body, area) for body in self._bodies)
        if nearest <= 0.0:
            return False
        push = float(np.abs(self._f[self._c >= nearest - _SAMPLE_M]).max(initial=0.0))
        return pull > push * (len(self._bodies) if self._all_bodies else 1)

    @staticmethod
    def _distance_to_edge(body: NDArray[np.float64], area: SearchArea) -> float:
        """From the body's circumscribed circle to the area's edge, m."""
        x, y, _, length, width = body
        radius = np.hypot(length, width) / 2.0
        return float(min(x - area[0], area[1] - x, y - area[2], area[3] - y) - radius)

    def forces(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2) force at points (n, 2), from the law's samples, N."""
        vectors, distances = self._vectors(points)
        pushes = self._pushes(vectors, distances)
        if self._all_bodies:
            return self._pull(points) + pushes.sum(axis=0)
        nearest = distances.argmin(axis=0)
        return self._pull(points) + pushes[nearest, np.arange(len(points))]

    def opposed(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Of the two nearest bodies: forces (n, 2) each, directions (n, 2) each."""
        vectors, distances = self._vectors(points)
        pushes, pull = self._pushes(vectors, distances), self._pull(points)
        first, second = np.argsort(distances, axis=0)[:2]
        row = np.arange(len(points))
        away = -vectors / np.maximum(distances, 1e-12)[..., None]
        return (
            pull + pushes[first, row],
            pull + pushes[second, row],
            away[first, row],
            away[second, row],
        )

    def _pull(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        to_source = self._p_WS - points
        distance = np.maximum(np.linalg.norm(to_source, axis=1), 1e-12)[:, None]
        share = 1.0 - self._attraction.follow_distance_m / distance
        return self._attraction.stiffness_n_m * share * to_source

    def _vectors(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """To the nearest points of the bodies: (k, n, 2) and lengths (k, n), m."""
        vectors = (nearest_point_on_rectangle(points.T, body) for body in self._bodies)
        stacked = np.array([np.stack(vector, axis=-1) for vector in vectors])
        return stacked, np.linalg.norm(stacked, axis=-1)

    def _pushes(
        self, vectors: NDArray[np.float64], distances: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        force = np.interp(distances, self._c, self._f, right=0.0)
        return -vectors * (force / np.maximum(distances, 1e-12))[..., None]

    def _excluded(
        self, cells: NDArray[np.float64], edge: float
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Cells without an equilibrium, and by how much the force varies in each."""
        radius = edge * np.sqrt(0.5)
        reach = radius + _SAMPLE_M
        vectors, distances = self._vectors(cells)
        pull, pushes = self._pull(cells), self._pushes(vectors, distances)
        steep = self._in_cell(self._slope, distances, radius)
        bent = np.maximum(steep, self._in_cell(self._bend, distances, radius))
        own = self._pull_slope(cells, radius)
        inside = self._depth(cells) > radius
        if self._all_bodies:
            change = (own + bent.sum(axis=0)) * reach
            strength = np.linalg.norm(pull + pushes.sum(axis=0), axis=1)
            return (strength > change) | inside, change
        # A body that may be the nearest somewhere in the cell.
        counts = distances <= distances.min(axis=0) + 2.0 * radius
        change = (own + np.where(counts, bent, 0.0).max(axis=0)) * reach
        forces = pull + pushes
        sizes = np.abs(np.linalg.norm(pull, axis=1) - np.linalg.norm(pushes, axis=2))
        unequal = (sizes > (own + steep) * reach) | ~counts
        clear = np.zeros(len(cells), dtype=bool)
        for direction in self._directions(forces, distances, counts):
            along = np.einsum("knj,nj->kn", forces, direction)
            clear |= np.where(counts, along, np.inf).min(axis=0) > change
        return clear | unequal.all(axis=0) | inside, change

    @staticmethod
    def _directions(
        forces: NDArray[np.float64],
        distances: NDArray[np.float64],
        counts: NDArray[np.bool_],
    ) -> Iterator[NDArray[np.float64]]:
        """Unit vectors (n, 2) along which all forces of a cell may be positive."""
        yield _unit(np.where(counts[..., None], forces, 0.0).sum(axis=0))
        if len(forces) > 1:
            first, second = np.argsort(distances, axis=0)[:2]
            row = np.arange(forces.shape[1])
            a, b = forces[first, row], forces[second, row]
            step = b - a
            squared = np.maximum(np.einsum("nj,nj->n", step, step), 1e-300)
            share = np.clip(-np.einsum("nj,nj->n", a, step) / squared, 0.0, 1.0)
            yield _unit(a + share[:, None] * step)

    def _depth(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep points lie inside some body, m; negative outside."""
        depth = np.full(len(points), -np.inf)
        for x, y, theta, length, width in self._bodies:
            u, v = rotate(-theta, points[:, 0] - x, points[:, 1] - y)
            own = np.minimum(length / 2.0 - np.abs(u), width / 2.0 - np.abs(v))
            depth = np.maximum(depth, own)
        return depth

    def _pull_slope(
        self, cells: NDArray[np.float64], radius: float
    ) -> NDArray[np.float64]:
        """Largest slope of the attraction within each cell, N/m."""
        distance = np.linalg.norm(self._p_WS - cells, axis=1) - radius
        d_f = self._attraction.follow_distance_m
        bent = np.where(distance > 0.0, d_f / np.maximum(distance, 1e-12) - 1.0, np.inf)
        bent = bent if d_f > 0.0 else np.zeros_like(bent)
        return self._attraction.stiffness_n_m * np.maximum(1.0, np.abs(bent))

    @staticmethod
    def _in_cell(
        samples: NDArray[np.float64], distances: NDArray[np.float64], radius: float
    ) -> NDArray[np.float64]:
        """(k, n) largest of a function of distance within each cell."""
        window = 2 * int(np.ceil(radius / _SAMPLE_M)) + 3
        largest = maximum_filter1d(samples, window)
        index = np.clip((distances / _SAMPLE_M).astype(int), 0, len(largest) - 1)
        return np.asarray(largest[index])

    def _groups(
        self,
        cells: NDArray[np.float64],
        change: NDArray[np.float64],
        origin: NDArray[np.float64],
        edge: float,
    ) -> list[Leftover]:
        apart = self._vectors(cells)[1].min(axis=0) > CONTACT_CELLS * edge
        cells, change = cells[apart], change[apart]
        if not len(cells):
            return []
        index = np.floor((cells - origin) / edge).astype(int)
        grid = np.zeros(index.max(axis=0) + 1, dtype=bool)
        grid[index[:, 0], index[:, 1]] = True
        numbers, count = label(grid, structure=np.ones((3, 3)))
        group = numbers[index[:, 0], index[:, 1]]
        parts = [group == k + 1 for k in range(count)]
        return [self._group(cells[part], change[part], edge) for part in parts]

    def _group(
        self, centres: NDArray[np.float64], change: NDArray[np.float64], edge: float
    ) -> Leftover:
        offsets = edge / 2.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        corners = (centres[:, None, :] + offsets).reshape(-1, 2)
        forces = self.forces(corners).reshape(-1, 4, 2)
        angles = np.arctan2(forces[..., 1], forces[..., 0])
        steps = np.angle(np.exp(1j * (np.roll(angles, -1, axis=1) - angles)))
        nearest = self._vectors(corners)[1].argmin(axis=0).reshape(-1, 4)
        switches = (nearest != nearest[:, :1]).any(axis=1) & (not self._all_bodies)
        return Leftover(
            centres=centres,
            strengths=np.linalg.norm(self.forces(centres), axis=1),
            change=change,
            winding=np.rint(steps.sum(axis=1) / (2 * np.pi)).astype(np.int64),
            switches=switches,
        )
