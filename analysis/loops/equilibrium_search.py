"""Exhaustive search for the places in a workspace where the control point P can rest.

P lies ahead of the wheel axle. The source pulls P, and only the nearest body pushes P.
If body k is the nearest, the force on P at a point p is F_k(p) = pull(p) + push_k(p).
The force jumps where the nearest body changes. According to Filippov's convex
definition of such motions, P can rest at p in two cases:

- Only body k is nearest at p, and F_k(p) = 0.
- Several bodies are equally near to p, and the convex hull of their forces F_k(p)
  contains the origin.

The search divides the workspace into square cells. It excludes a cell if it can prove
that the cell contains no place of rest. It divides every other cell into quarters.

The proof for one cell uses the center c of the cell, half the diagonal r of the cell,
and the distances d_k(p) of a point p from the bodies:

- Distances change by at most r between c and any other point of the cell. If body k is
  the nearest body of some point of the cell, then d_k(c) <= min d(c) + 2 r. Every body
  that satisfies this condition *counts*.
- F_k changes by at most ``change`` between c and any other point of the cell. This
  bound is r times a Lipschitz constant of pull and push, plus the error of the samples
  of the law.
- Suppose that a unit vector u satisfies F_k(c) . u > change for every body that counts.
  Then F_k(p) . u > 0 for all these bodies at every point p of the cell. Hence no convex
  hull of these forces contains the origin, and the cell is excluded.
- If only one body k counts, F_k(p) = 0 also requires |pull(p)| = |push_k(p)|. The cell
  is excluded if these magnitudes differ at c by more than they can change within the
  cell. If several bodies count, this test does not apply, because two pushes can cancel
  each other, for example in the middle of a corridor.

With ``aggregation: sum``, the nearest three bodies push. The same proof then applies to
the sums of their pushes.

Only whole cells are excluded, and the quarters of a cell cover the cell. By induction,
every place of rest lies in one of the remaining cells.

The law is sampled every 1 mm. The proof assumes that the law is convex or concave
between two samples. Its deviation from the chord between these samples is then at most
twice its deviation at the middle. ``change`` contains the slope of the chord and this
deviation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from analysis.loops.force_field import ForceField
from analysis.loops.ideal_scenarios import require_single_rectangles
from systems.world.geometry import nearest_point_on_rectangle, rotate
from systems.world.shapes import rectangle_outline

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Spacing of the samples of the law, m.
_SAMPLE_M = 1e-3
#: Edge of the first cells, m.
_FIRST_CELL_M = 0.25

#: Points nearer to a body than this count as contact and are not searched, m. So near
#: to a body, the direction to its nearest point turns too much within a cell.
CONTACT_M = 4e-3
#: Largest number of bodies whose pushes are added with ``aggregation: sum``.
_SLOTS = 3
#: Number of steps toward the point of a convex hull that is nearest to the origin.
_HULL_STEPS = 6
#: Number of steps of Newton's method to a switching point.
_NEWTON_STEPS = 25
#: Largest number of starts of Newton's method in a group of cells.
_MOST_STARTS = 200
#: Distances that differ by less than this are equal, m.
_SAME_M = 1e-9

#: Smallest x, largest x, smallest y, largest y, m.
SearchArea = tuple[float, float, float, float]


def _unit(vectors: Floats) -> Floats:
    size = np.linalg.norm(vectors, axis=1)
    return vectors / np.maximum(size, 1e-300)[:, None]


def _sampled(field: ForceField, farthest: float) -> tuple[Floats, ...]:
    """Samples of the law: (n,) distances, m, forces, N, and deviations, N.

    Each deviation is a bound on the difference between the law and its chord in the
    interval after the distance. If the law has a corner inside an interval, one end of
    the interval is moved to the corner.
    """

    def law(c: Floats) -> Floats:
        # At a distance of exactly zero a push has no direction.
        return field.law(np.maximum(c, 1e-9))

    c = np.arange(0.0, farthest, _SAMPLE_M)
    f = law(c)
    off = law(c[:-1] + 0.5 * _SAMPLE_M) - 0.5 * (f[:-1] + f[1:])
    size = np.abs(off)
    around = maximum_filter1d(size, 3)
    others = np.sort(np.stack((np.roll(size, 1), np.roll(size, -1))), axis=0)[1]
    corners = np.flatnonzero((size == around) & (size > 4.0 * others + 1e-9))
    moved = False
    for k in corners[(corners > 0) & (corners < len(c) - 2)]:
        before, after = (np.diff(f[j : j + 2])[0] / _SAMPLE_M for j in (k - 1, k + 1))
        if before == after:
            continue
        at = (f[k + 1] - after * c[k + 1] - f[k] + before * c[k]) / (before - after)
        if c[k] < at < c[k + 1]:
            c[k if at - c[k] < 0.5 * _SAMPLE_M else k + 1], moved = at, True
    if moved:
        f = law(c)
        off = law(0.5 * (c[:-1] + c[1:])) - 0.5 * (f[:-1] + f[1:])
    # If a function is convex or concave between two samples, its deviation from the
    # chord is at most twice the deviation at the middle.
    return c, f, np.append(2.0 * np.abs(off), 0.0)


@dataclass(frozen=True)
class SwitchingPoint:
    """Place of rest where several bodies are equally near.

    Each of these bodies, if it alone were the nearest, would cause a different force on
    P. A weighted mean of these forces is zero.
    """

    p_WP: Floats
    """(2,) position of P in W, m."""
    attractive: bool
    """Whether the forces drive P back to this point, so that P chatters near it."""


@dataclass(frozen=True)
class Leftover:
    """Group of neighboring cells that may contain an equilibrium.

    The search has divided these cells as far as it divides any cell.
    """

    centers: Floats
    """(n, 2) centers of the cells in W, m."""
    strengths: Floats
    """(n,) magnitude of the force at each center, N."""
    winding: NDArray[np.int64]
    """(n,) number of full turns of the force on the way around each cell. Around an
    isolated equilibrium, this number is not zero."""
    switches: Flags
    """(n,) whether the nearest body changes within the cell."""


class CellSearch:
    """Excludes cells that provably contain no place of rest.

    The module docstring has the proof.
    """

    def __init__(self, field: ForceField) -> None:
        scenario = field.loop.scenario
        self.p_WS = field.p_WS
        self._attraction = scenario.follower.attraction
        bodies = [*scenario.bodies().values()]
        self._bodies = [row for body in bodies for row in body.rectangles(0.0)]
        self._filled = [body for body in bodies if body.shape.polygon is not None]
        adds = scenario.follower.collision_vector.aggregation == "sum"
        if adds:
            require_single_rectangles(scenario)
        self._slots = min(_SLOTS if adds else 1, len(self._bodies))
        farthest = field.reach_m + 1.0
        self._c, self._f, self._error = _sampled(field, farthest)
        self._slope = np.abs(np.diff(self._f)) / np.diff(self._c)
        self._slope = np.append(self._slope, 0.0)
        self._bend = np.abs(self._f) / np.maximum(self._c, _SAMPLE_M)

    def left_over(
        self, area: SearchArea, smallest_m: float
    ) -> tuple[Floats, int, float]:
        """Returns the smallest cells of an area that may contain an equilibrium.

        Cells with an edge of at most ``smallest_m`` are not divided any more. Three
        values are returned:

        - (n, 2) centers of the cells that were not excluded, m
        - number of cells of all sizes that were examined
        - edge of the cells that were not excluded, m
        """
        edge = _FIRST_CELL_M
        x = np.arange(area[0] + edge / 2, area[1] + edge / 2, edge)
        y = np.arange(area[2] + edge / 2, area[3] + edge / 2, edge)
        cells = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        looked_at = len(cells)
        cells = cells[~self._excluded(cells, edge)]
        while edge > smallest_m and len(cells):
            looked_at += 4 * len(cells)
            cells, edge = self.quartered(cells, edge)
        return cells, looked_at, edge

    def quartered(self, cells: Floats, edge: float) -> tuple[Floats, float]:
        """Divides cells into quarters, and returns those that are not excluded.

        ``cells`` are (n, 2) centers, m, and ``edge`` is the edge of the cells, m. The
        result has the (k, 2) centers of the remaining quarters, m, and their edge, m.
        """
        edge /= 2.0
        corners = edge / 2.0 * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        cells = (cells[:, None, :] + corners).reshape(-1, 2)
        return cells[~self._excluded(cells, edge)], edge

    def outside_is_empty(self, area: SearchArea) -> bool:
        """Returns whether the attraction exceeds every push outside the area.

        If it does, P cannot rest outside the area.
        """
        x, y = self.p_WS
        gap = min(x - area[0], area[1] - x, y - area[2], area[3] - y)
        d_f = self._attraction.follow_distance_m
        pull = self._attraction.stiffness_n_m * (gap - d_f)
        corners = np.concatenate([rectangle_outline(body) for body in self._bodies])
        (x, y), (x0, x1, y0, y1) = corners.T, area
        nearest = float(np.min([x - x0, x1 - x, y - y0, y1 - y]))
        if nearest <= 0.0:
            return False
        push = float(np.abs(self._f[self._c >= nearest - _SAMPLE_M]).max(initial=0.0))
        return pull > push * self._slots

    def forces(self, points: Floats) -> Floats:
        """Returns the (n, 2) forces on P in W at points (n, 2), m, in N.

        The pushes are interpolated between the samples of the law.
        """
        vectors, distances = self._vectors(points)
        pushes = self._pushes(vectors, distances)
        rank = distances.argsort(axis=0).argsort(axis=0)
        counted = np.where((rank < self._slots)[..., None], pushes, 0.0)
        return np.asarray(self._pull(points) + counted.sum(axis=0))

    def _pull(self, points: Floats) -> Floats:
        to_source = self.p_WS - points
        distance = np.maximum(np.linalg.norm(to_source, axis=1), 1e-12)[:, None]
        share = 1.0 - self._attraction.follow_distance_m / distance
        return self._attraction.stiffness_n_m * share * to_source

    def _vectors(self, points: Floats) -> tuple[Floats, Floats]:
        """Vectors (k, n, 2) from n points to k bodies, and their lengths (k, n), m."""
        vectors = (nearest_point_on_rectangle(points.T, body) for body in self._bodies)
        stacked = np.array([np.stack(vector, axis=-1) for vector in vectors])
        return stacked, np.linalg.norm(stacked, axis=-1)

    def _pushes(self, vectors: Floats, distances: Floats) -> Floats:
        force = np.interp(distances, self._c, self._f, right=0.0)
        return -vectors * (force / np.maximum(distances, 1e-12))[..., None]

    def _excluded(self, cells: Floats, edge: float) -> Flags:
        """(n,) whether the proof in the module docstring excludes each cell."""
        radius = edge * np.sqrt(0.5)
        vectors, distances = self._vectors(cells)
        pull, pushes = self._pull(cells), self._pushes(vectors, distances)
        steep = self._in_cell(self._slope, distances, radius)
        bent = np.maximum(steep, self._in_cell(self._bend, distances, radius))
        error = self._in_cell(self._error, distances, radius)
        own = self._pull_slope(cells, radius)
        # The pushing bodies are the ``_slots`` nearest ones.
        # counts: bodies that may push somewhere in the cell.
        # surely: bodies that push everywhere in the cell.
        ordered = np.sort(distances, axis=0)
        counts = distances <= ordered[self._slots - 1] + 2.0 * radius
        if self._slots < len(ordered):
            surely = distances + 2.0 * radius < ordered[self._slots]
        else:
            surely = counts
        varied = np.where(counts, bent * radius + error, 0.0)
        most = varied.max(axis=0) if self._slots == 1 else varied.sum(axis=0)
        change = own * radius + most
        # A margin for rounding.
        change = change + 1e-12 * (1.0 + np.abs(pull).sum(axis=1))
        sizes = np.abs(np.linalg.norm(pull, axis=1) - np.linalg.norm(pushes, axis=2))
        unequal = sizes > own * radius + steep * radius + error
        unequal = (unequal | ~counts).all(axis=0)
        alone = (counts.sum(axis=0) == 1) & (self._slots == 1)
        clear = self._one_sided(pull, pushes, counts & ~surely, surely, change)
        contact = distances.min(axis=0) + radius <= CONTACT_M
        inside = self._depth(cells) > radius
        return np.asarray(clear | (alone & unequal) | contact | inside)

    def _one_sided(
        self,
        pull: Floats,
        pushes: Floats,
        maybe: Flags,
        surely: Flags,
        change: Floats,
    ) -> Flags:
        """(n,) whether all possible forces of each cell point to one side.

        This is the case if the component of every possible force along one direction is
        larger than ``change`` (n,), N. The bodies ``surely`` (k, n) push, and the
        bodies ``maybe`` (k, n) may push. Gilbert's method finds directions to try: a
        point in the convex hull of the possible forces moves nearer to the origin at
        each step, and its direction from the origin is tried.
        """
        fixed = pull + np.where(surely[..., None], pushes, 0.0).sum(axis=0)
        missing = self._slots - surely.sum(axis=0)
        if not missing.any():
            return np.asarray(np.linalg.norm(fixed, axis=1) > change)

        def least(direction: Floats) -> Floats:
            """(n, 2) possible forces with the smallest components along directions."""
            along = np.einsum("knj,nj->kn", pushes, direction)
            rank = np.where(maybe, along, np.inf).argsort(axis=0).argsort(axis=0)
            chosen = maybe & (rank < missing)
            return np.asarray(
                fixed + np.where(chosen[..., None], pushes, 0.0).sum(axis=0)
            )

        share = missing / np.maximum(maybe.sum(axis=0), 1)
        mean = np.where(maybe[..., None], pushes, 0.0).sum(axis=0) * share[:, None]
        point = fixed + mean
        clear = np.zeros(len(pull), dtype=bool)
        for _ in range(_HULL_STEPS):
            direction = _unit(point)
            vertex = least(direction)
            clear |= np.einsum("nj,nj->n", vertex, direction) > change
            step = vertex - point
            squared = np.maximum(np.einsum("nj,nj->n", step, step), 1e-300)
            way = np.clip(-np.einsum("nj,nj->n", point, step) / squared, 0.0, 1.0)
            point = point + way[:, None] * step
        return clear

    def _depth(self, points: Floats) -> Floats:
        """(n,) distances of points inside a body from its outline, m; outside: < 0."""
        depth = np.full(len(points), -np.inf)
        for x, y, theta, length, width, radius in self._bodies:
            u, v = rotate(-theta, points[:, 0] - x, points[:, 1] - y)
            u, v = np.abs(u) - length / 2.0, np.abs(v) - width / 2.0
            # The distance from the rectangle without its radius, negative inside.
            out = np.hypot(np.maximum(u, 0.0), np.maximum(v, 0.0))
            out += np.minimum(np.maximum(u, v), 0.0)
            depth = np.maximum(depth, radius - out)
        for body in self._filled:
            x, y, theta = body.path.pose(0.0)
            own = np.stack(rotate(-theta, points[:, 0] - x, points[:, 1] - y), axis=-1)
            rows = body.rectangles(0.0)
            away = [np.hypot(*nearest_point_on_rectangle(points.T, r)) for r in rows]
            deep = np.where(body.shape.fills(own), np.min(away, axis=0), -np.inf)
            depth = np.maximum(depth, deep)
        return depth

    def _pull_slope(self, cells: Floats, radius: float) -> Floats:
        """(n,) largest slope of the attraction within each cell, N/m."""
        distance = np.linalg.norm(self.p_WS - cells, axis=1) - radius
        d_f = self._attraction.follow_distance_m
        bent = np.where(distance > 0.0, d_f / np.maximum(distance, 1e-12) - 1.0, np.inf)
        bent = bent if d_f > 0.0 else np.zeros_like(bent)
        return self._attraction.stiffness_n_m * np.maximum(1.0, np.abs(bent))

    @staticmethod
    def _in_cell(samples: Floats, distances: Floats, radius: float) -> Floats:
        """(k, n) largest of the samples that lie within a cell.

        ``samples`` are values at the distances of the samples of the law. ``distances``
        (k, n) are those from the cell centers to the bodies, m.
        """
        # ``_sampled`` may have moved samples by up to half their spacing.
        window = 2 * int(np.ceil(radius / _SAMPLE_M)) + 5
        largest = maximum_filter1d(samples, window)
        index = np.clip((distances / _SAMPLE_M).astype(int), 0, len(largest) - 1)
        return np.asarray(largest[index])

    def groups(self, cells: Floats, edge: float) -> list[Leftover]:
        """Divides cells, given by (n, 2) centers, m, into groups of neighbors."""
        if not len(cells):
            return []
        index = np.rint((cells - cells.min(axis=0)) / edge).astype(int)
        # The cells are few and scattered: a tree finds neighbors faster than a grid.
        tree = cKDTree(index)
        pairs = tree.query_pairs(1.5, p=np.inf, output_type="ndarray")
        joined = coo_array(
            (np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])),
            shape=(len(cells), len(cells)),
        )
        count, group = connected_components(joined, directed=False)
        order = np.argsort(group, kind="stable")
        ends = np.cumsum(np.bincount(group, minlength=count))[:-1]
        return [self._group(cells[part], edge) for part in np.split(order, ends)]

    def _group(self, centers: Floats, edge: float) -> Leftover:
        offsets = edge / 2.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        corners = (centers[:, None, :] + offsets).reshape(-1, 2)
        forces = self.forces(corners).reshape(-1, 4, 2)
        angles = np.arctan2(forces[..., 1], forces[..., 0])
        steps = np.angle(np.exp(1j * (np.roll(angles, -1, axis=1) - angles)))
        ordered = np.sort(self._vectors(centers)[1], axis=0)
        switches = np.zeros(len(centers), dtype=bool)
        if self._slots < len(ordered):
            apart = ordered[self._slots] - ordered[self._slots - 1]
            switches = apart <= np.sqrt(2.0) * edge
        return Leftover(
            centers=centers,
            strengths=np.linalg.norm(self.forces(centers), axis=1),
            winding=np.rint(steps.sum(axis=1) / (2 * np.pi)).astype(np.int64),
            switches=switches,
        )

    def switching_points(self, group: Leftover, edge: float) -> list[SwitchingPoint]:
        """Finds places of rest near a group where two or three bodies are equally near.

        With ``aggregation: sum``, the list is empty, because the force then jumps
        between sums of pushes. ``edge`` is the edge of the cells, m.
        """
        starts = group.centers[group.switches]
        if not len(starts) or self._slots > 1:
            return []
        starts = starts[:: -(-len(starts) // _MOST_STARTS)]
        nearest = np.argsort(self._vectors(starts)[1], axis=0)
        found: list[SwitchingPoint] = []
        for size in (2, 3)[: len(self._bodies) - 1]:
            ends = self._newton(starts, nearest[:size])
            for begin, end, bodies in zip(starts, ends, nearest[:size].T, strict=True):
                near = np.abs(end - begin).max() <= 2.0 * edge
                known = any(np.linalg.norm(end - s.p_WP) < 1e-6 for s in found)
                if near and not known and self._cancels(end, bodies):
                    found.append(SwitchingPoint(end, self._attracts(end, bodies)))
        return found

    def _each(self, points: Floats, bodies: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Distances (size, n), m, and forces F_k (size, n, 2), N, of some bodies.

        ``bodies`` (size, n) are the indices of the bodies for each of n points.
        """
        vectors, distances = self._vectors(points)
        row = np.arange(points.shape[0])
        forces = self._pull(points) + self._pushes(vectors, distances)
        return distances[bodies, row], forces[bodies, row]

    def _newton(self, starts: Floats, bodies: NDArray[np.int64]) -> Floats:
        """(n, 2) points in W to which Newton's method leads from the starts, m.

        At a solution, two or three bodies are equally near. If there are two bodies,
        their forces F_k are also parallel.
        """

        def residual(points: Floats) -> Floats:
            distances, forces = self._each(points, bodies)
            first = distances[0] - distances[1]
            if len(bodies) == 3:
                return np.stack((first, distances[0] - distances[2]), axis=-1)
            (ax, ay), (bx, by) = forces[0].T, forces[1].T
            scale = np.maximum(np.linalg.norm(forces, axis=2).max(axis=0), 1e-12)
            return np.stack((first, (ax * by - ay * bx) / scale), axis=-1)

        p, step = starts.copy(), 1e-7
        for _ in range(_NEWTON_STEPS):
            value = residual(p)
            slopes = np.stack(
                [
                    (residual(p + step * e) - residual(p - step * e)) / (2.0 * step)
                    for e in np.eye(2)
                ],
                axis=-1,
            )
            move = -np.einsum("nij,nj->ni", np.linalg.pinv(slopes, rcond=1e-9), value)
            size = np.linalg.norm(move, axis=1, keepdims=True)
            p = p + move * np.minimum(1.0, 0.01 / np.maximum(size, 1e-300))
        return p

    def _cancels(self, p: Floats, bodies: NDArray[np.int64]) -> bool:
        """Whether P can rest at p between the bodies.

        The bodies must be the nearest ones of p and equally near, and the convex hull
        of their forces F_k must contain the origin.
        """
        distances, forces = self._each(p[None], bodies[:, None])
        least = self._vectors(p[None])[1].min()
        if np.ptp(distances) > _SAME_M or abs(distances[0, 0] - least) > _SAME_M:
            return False
        F = forces[:, 0]
        tiny = 1e-6 * np.linalg.norm(F, axis=1).max()
        if least <= CONTACT_M or tiny == 0.0:
            return False
        if len(F) == 2:
            across = abs(F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])
            return bool(F[0] @ F[1] < 0.0 and across <= tiny * np.linalg.norm(F[0]))
        turns = [np.linalg.det(np.array([F[k], F[(k + 1) % 3]])) for k in range(3)]
        return bool(min(turns) > 0.0 or max(turns) < 0.0)

    def _attracts(self, p: Floats, bodies: NDArray[np.int64]) -> bool:
        """Whether the forces drive the control point P to a switching point.

        The force has a potential: that of the pull plus that of the push, which is a
        function of the smallest distance from a body. If the bodies push and do not
        pull, the slope of the potential at p in the direction u is the largest of the
        values -F_k . u. No such slope is negative, because the convex hull of the
        forces contains the origin. The slope can be zero only along the line on which
        two bodies stay equally near. Along this line, the force must lead back to p.
        """
        distances, _ = self._each(p[None], bodies[:, None])
        if np.interp(distances[0, 0], self._c, self._f, right=0.0) <= 0.0:
            return False
        if len(bodies) == 3:
            return True
        away = -self._vectors(p[None])[0][bodies, 0]
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        normal = _unit((away[0] - away[1])[None])[0]
        along = np.array([-normal[1], normal[0]])
        ahead, behind = (
            self._sliding(p + sign * 1e-4 * along, bodies) @ along for sign in (1, -1)
        )
        return bool(ahead - behind < 1e-9)

    def _sliding(self, p: Floats, bodies: NDArray[np.int64]) -> Floats:
        """(2,) weighted mean of the forces of two bodies, N.

        It keeps P equally near to both bodies.
        """
        vectors, distances = (x[bodies, 0] for x in self._vectors(p[None]))
        away = -vectors / distances[:, None]
        normal = away[0] - away[1]
        # Move p back to the line on which the distances are equal.
        p = p - normal * (distances[0] - distances[1]) / (normal @ normal)
        forces = self._each(p[None], bodies[:, None])[1][:, 0]
        across = forces @ normal
        share = across[1] / (across[1] - across[0])
        return np.asarray(share * forces[0] + (1.0 - share) * forces[1])
