"""Search for all equilibria of the closed loop at rest in a workspace.

``analysis.loops.equilibrium_search`` divides the workspace into cells, and excludes
cells without a place of rest. This module finds the equilibria in the remaining cells.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.loops.equilibrium_search import (
    CONTACT_M,
    CellSearch,
    Leftover,
    SearchArea,
    SwitchingPoint,
)
from analysis.loops.force_field import ForceField
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.ideal_scenarios import (
    frozen_scenario,
    ideal_scenario,
    moving_bodies,
)
from analysis.loops.operating_points import (
    FLAT,
    NO_FORCE_N,
    OperatingPoint,
    resting_equilibrium,
)
from analysis.runs.shortest_path import shortest_path_length
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.world.geometry import control_point
from systems.world.shapes import rectangle_outline

#: Equilibria nearer to each other than this are the same, m.
_SAME_M = 1e-6
#: Number of cells of a group from which Newton's method starts: those with the weakest
#: forces.
_MOST_STARTS = 6
#: First: approximate number of other cells from which Newton's method starts: those
#: around which the direction of the force makes full turns.
#: Second: largest number of groups that are examined in each round after the first.
_MOST_TURNED, _MOST_GROUPS = 12, 12
#: Newton's method gives up at this distance from its start, m.
_NEWTON_REACH_M = 0.5
#: Edge of the smallest cells of the first round, m.
_SMALLEST_M = 0.002
#: Remaining cells within this distance of a found place of rest count as explained. The
#: unit of the distance is the edge of the smallest cells of the first round. Other
#: remaining cells are divided in further rounds.
_KNOWN_CELLS = 3
#: First: largest number of rounds, including the first.
#: Second: number of cells above which the division stops.
_ROUNDS, _MOST_CELLS = 10, 60_000
#: Half width of the path in the test for a free line of sight, m.
_LINE_M = 1e-3
#: Offsets from the follow distance that differ by less than this are equal, m.
_SAME_OFFSET_M = 1e-6


@dataclass(frozen=True)
class EquilibriumSearch:
    """All equilibria found in a workspace, and how complete the search was.

    A place of rest is a position of P at which the robot can rest: an equilibrium or a
    switching point.
    """

    scenario: Scenario = field(repr=False)
    """Scenario with exact sensors and bodies at rest."""
    points: tuple[OperatingPoint, ...]
    """Equilibria, the nearest to the source first."""
    switching: tuple[SwitchingPoint, ...]
    """Switching points: places of rest where several bodies are equally near."""
    area_m: SearchArea
    """Searched area of P in W: smallest x, largest x, smallest y, largest y."""
    cell_m: float
    """Edge of the smallest cells, m, before cells without a found place of rest were
    divided further."""
    cells: int
    """Number of cells of all sizes that were examined."""
    unresolved: tuple[tuple[float, float], ...]
    """One point in W, m, of each group of cells that the search could neither exclude
    nor explain by a listed place of rest."""
    empty_outside: bool
    """Whether the attraction exceeds every push outside the area, so that P cannot rest
    there."""

    moving: tuple[str, ...]
    """Names of the bodies that move in the given scenario."""

    @property
    def complete(self) -> bool:
        """Whether all places of rest lie within ``3 * cell_m`` of a listed one."""
        return not self.unresolved and self.empty_outside

    def way_m(self, point: OperatingPoint) -> float:
        """Returns the length of the shortest free path from the start to a point, m.

        The path is that of the control point P. It keeps a distance of half the robot's
        width from every body, or the clearance of the point if this is smaller. If the
        start is even nearer to a body, the path keeps only the start's distance from
        this body. Without a path, the length is infinite.
        """
        return self._way(point, self.scenario.only.robot.width_m / 2.0)

    def _way(self, point: OperatingPoint, radius: float) -> float:
        bodies = self.scenario.bodies().values()
        boxes = [row for body in bodies for row in body.rectangles(0.0)]
        radius = min(radius, 0.99 * point.clearance_m)
        return shortest_path_length(self._start, point.p_WP, 0.0, boxes, radius)

    @property
    def _start(self) -> NDArray[np.float64]:
        """(2,) position of P at the start in W, m."""
        epsilon = self.scenario.only.robot.control_point_m
        return np.array(control_point(self.scenario.only.start.pose, epsilon))

    def follow_point(self) -> OperatingPoint:
        """Returns the stable equilibrium at which the robot should follow the source.

        The candidates are the stable equilibria with a free path from the start. If
        none has a free path, all stable equilibria are candidates. The method returns
        the candidate whose distance from the source is nearest to the follow distance.
        If several candidates are equal in this respect, it returns the one nearest to
        the start. Raises InputError if there is no stable equilibrium.
        """
        sinks = [point for point in self.points if point.stable]
        if not sinks:
            kinds = ", ".join(point.kind for point in self.points) or "none at all"
            raise InputError(
                "attraction",
                f"the loop has no stable equilibrium (found: {kinds}), so that "
                "there is no point to linearize about; raise "
                "attraction.damping_n_s_m or lower the law's stiffness",
            )
        reached = [point for point in sinks if np.isfinite(self.way_m(point))]
        return min(
            reached or sinks,
            key=lambda point: (
                round(abs(point.offset_m) / _SAME_OFFSET_M),
                float(np.linalg.norm(point.p_WP - self._start)),
            ),
        )

    @property
    def statement(self) -> str:
        """Sentences for people: what was searched, and how completely."""
        x0, x1, y0, y1 = self.area_m
        where = f"[{x0:g}, {x1:g}] m x [{y0:g}, {y1:g}] m"
        text = (
            f"{len(self.points)} equilibria and {len(self.switching)} switching "
            f"points with P in {where}, {CONTACT_M * 1e3:.0f} mm or more from every "
            f"body. {self.cells} cells down to {self.cell_m * 1e3:.1f} mm were looked "
            "at; in those left out no mean of the forces is zero"
        )
        if self.unresolved:
            text += f"; {len(self.unresolved)} groups of cells stay open"
        beyond = "exceeds" if self.empty_outside else "need not exceed"
        return f"{text}. Beyond the area the attraction {beyond} every repulsion."

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the search and about the equilibrium ``follow_point()``.

        Raises InputError if there is no stable equilibrium.
        """
        found = []
        at = self.follow_point()
        x, y = at.p_WP
        if not self.complete:
            places = [f"({u:.2f}, {v:.2f})" for u, v in self.unresolved[:3]]
            found.append(
                "The search for places of rest is incomplete: "
                + (
                    f"{len(self.unresolved)} groups of cells stay open, about "
                    f"{', '.join(places)} m. "
                    if places
                    else "P may also rest beyond the area that was searched. "
                )
                + "There may be places of rest that are not listed."
            )
        if self.moving:
            found.append(
                f"Bodies move ({', '.join(self.moving)}): the report assumes "
                "that they rest at their places at 0 s."
            )
        way, straight = self.way_m(at), float(np.linalg.norm(at.p_WP - self._start))
        place = f"The operating point, P at ({x:.3f}, {y:.3f}) m,"
        if not np.isfinite(way):
            found.append(
                f"{place} is not reachable: no path as wide as the robot leads "
                "there from the start."
            )
        elif self._way(at, _LINE_M) > straight + _LINE_M:
            found.append(
                f"{place} lies behind a body as seen from the start: the "
                f"shortest path around it is {way:.2f} m long, the straight line "
                f"{straight:.2f} m."
            )
        traps = [point.p_WP for point in self.switching if point.attractive]
        if traps:
            places = [f"({u:.3f}, {v:.3f})" for u, v in traps[:3]]
            found.append(
                f"P can also come to stay, chattering, at {len(traps)} attractive "
                f"switching points: {', '.join(places)} m"
                f"{' and others' if len(traps) > 3 else ''}. No linear model holds "
                "there."
            )
        return tuple(found)


def find_equilibria(
    scenario: Scenario,
    *,
    area_m: SearchArea | None = None,
    smallest_m: float = _SMALLEST_M,
) -> EquilibriumSearch:
    """Searches a workspace for all equilibria of the closed loop at rest.

    The search assumes exact sensors, and bodies that rest where they are at 0 s. Use
    ``frozen_scenario`` for another time. ``area_m`` bounds the positions of the control
    point P in W. By default, it contains all bodies and the start, with a margin of the
    follow distance plus 1 m. Cells are divided until their edge is at most
    ``smallest_m``, and further if they may contain a place of rest but none is found.
    Raises InputError if the area is empty or the law has no derivative.
    """
    if not smallest_m > 0.0:
        raise InputError("smallest_m", f"is {smallest_m}; give a positive length in m")
    moving = moving_bodies(scenario)
    scenario = frozen_scenario(ideal_scenario(scenario))
    area = area_m or _area(scenario)
    if not (area[0] < area[1] and area[2] < area[3]):
        raise InputError(
            "area_m", f"{area} is empty; give (x_min, x_max, y_min, y_max) in m"
        )
    loop = ideal_loop(scenario)
    field_ = ForceField(loop)
    search = CellSearch(field_)
    left, cells, edge = search.left_over(area, smallest_m)
    known = _KNOWN_CELLS * edge
    found = _Found([], [], [], np.asarray(scenario.only.start.position_m))
    finest = edge
    groups: list[Leftover] = []
    for round_ in range(_ROUNDS):
        groups = search.groups(left, finest)
        if round_:
            # Many groups may remain along a circle around the source on which the force
            # is nearly zero. Only the groups with the weakest forces are examined now.
            # The next round divides the others and examines them again.
            groups = sorted(groups, key=lambda group: group.strengths.min())
            groups = groups[:_MOST_GROUPS]
        for group in groups:
            found.add(search, field_, group, finest, first=round_ == 0)
        left = left[~found.explain(search, left, known)]
        if not len(left) or len(left) > _MOST_CELLS or round_ == _ROUNDS - 1:
            break
        cells += 4 * len(left)
        left, finest = search.quartered(left, finest)
    roots = found.roots + found.flat
    points = [resting_equilibrium(loop, root) for root in roots]
    points.sort(key=lambda point: point.source_distance_m)
    unresolved = [
        group.centers[group.strengths.argmin()] for group in search.groups(left, finest)
    ]
    return EquilibriumSearch(
        scenario=scenario,
        points=tuple(points),
        switching=tuple(found.switching),
        area_m=area,
        cell_m=edge,
        cells=cells,
        unresolved=tuple((float(x), float(y)) for x, y in unresolved),
        empty_outside=search.outside_is_empty(area),
        moving=moving,
    )


@dataclass
class _Found:
    """Places of rest that have been found so far."""

    roots: list[NDArray[np.float64]]
    """Isolated equilibria."""
    flat: list[NDArray[np.float64]]
    """One equilibrium of each continuum."""
    switching: list[SwitchingPoint]
    start: NDArray[np.float64]
    """(2,) start of the robot in W, m."""

    def add(
        self,
        search: CellSearch,
        field_: ForceField,
        group: Leftover,
        edge: float,
        *,
        first: bool,
    ) -> None:
        """Searches for places of rest in and near a group of cells.

        ``edge`` is the edge of the cells, m. If the equilibria form a continuum, only
        the one nearest to the robot's start is added.
        """
        near = np.linalg.norm(group.centers - self.start, axis=1).argmin()
        turned = np.flatnonzero(group.winding)
        turned = turned[:: max(1, len(turned) // _MOST_TURNED)]
        weakest = np.argsort(group.strengths)[: _MOST_STARTS if first else 1]
        starts = (near, *weakest, *turned) if first else (*weakest, *turned[:2])
        found: list[NDArray[np.float64]] = []
        flat: list[NDArray[np.float64]] = []
        for cell in starts:
            if len(flat) > _MOST_STARTS:
                break
            root = nearest_equilibrium(field_, group.centers[cell])
            if root is None:
                continue
            if np.abs(group.centers - root).max(axis=1).min() > 2.0 * edge:
                continue
            sizes = np.abs(np.linalg.eigvals(field_.gradient(root)[1]))
            isolated = sizes.min() > FLAT * max(sizes.max(), 1.0)
            kept = found if isolated else flat
            if not _near(root, kept):
                kept.append(root)
        self.roots += [root for root in found if not _near(root, self.roots)]
        if not found and flat:
            self._add_flat(search, flat[0])
        for point in search.switching_points(group, edge):
            if not _near(point.p_WP, [other.p_WP for other in self.switching]):
                self.switching.append(point)

    def _add_flat(self, search: CellSearch, root: NDArray[np.float64]) -> None:
        """Adds an equilibrium ``root`` of a continuum, a circle around the source.

        Of each circle, only the point nearest to the start is kept.
        """

        def radius(p: NDArray[np.float64]) -> float:
            return float(np.linalg.norm(p - search.p_WS))

        def away(p: NDArray[np.float64]) -> float:
            return float(np.linalg.norm(p - self.start))

        for k, other in enumerate(self.flat):
            if abs(radius(root) - radius(other)) < _SAME_M:
                self.flat[k] = min(other, root, key=away)
                return
        self.flat.append(root)

    def explain(
        self, search: CellSearch, cells: NDArray[np.float64], known_m: float
    ) -> NDArray[np.bool_]:
        """(n,) whether each cell lies within ``known_m`` of a found place of rest."""
        near = np.zeros(len(cells), dtype=bool)
        for place in (*self.roots, *(point.p_WP for point in self.switching)):
            near |= np.linalg.norm(cells - place, axis=1) <= known_m
        for place in self.flat:
            near |= np.linalg.norm(cells - place, axis=1) <= known_m
            # Where no body pushes, P can rest anywhere on a circle around the source.
            to = cells - search.p_WS
            radius = float(np.linalg.norm(place - search.p_WS))
            close = np.abs(np.linalg.norm(to, axis=1) - radius) <= 0.5 * known_m
            if radius == 0.0 or not close.any():
                continue
            angle = np.arctan2(to[close, 1], to[close, 0])
            for turn in np.linspace(-0.8, 0.8, 9) * known_m / radius:
                ring = radius * np.stack(
                    (np.cos(angle + turn), np.sin(angle + turn)), axis=-1
                )
                rests = np.linalg.norm(search.forces(search.p_WS + ring), axis=1)
                near[np.flatnonzero(close)[rests < NO_FORCE_N]] = True
        return near


def _area(scenario: Scenario) -> SearchArea:
    margin = scenario.follower.attraction.follow_distance_m + 1.0
    places = [np.array(scenario.only.start.position_m)[None]]
    bodies = scenario.bodies().values()
    places += [rectangle_outline(row) for b in bodies for row in b.rectangles(0.0)]
    everything = np.concatenate(places)
    low, high = everything.min(axis=0) - margin, everything.max(axis=0) + margin
    edges = [low[0], high[0], low[1], high[1]]
    return tuple(round(float(edge), 3) for edge in edges)  # type: ignore[return-value]


def _near(root: NDArray[np.float64], roots: list[NDArray[np.float64]]) -> bool:
    return any(np.linalg.norm(root - other) < _SAME_M for other in roots)


def nearest_equilibrium(
    field_: ForceField, begin: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Finds a point near ``begin`` at which no force acts on P, by Newton's method.

    ``begin`` and the result are (2,) positions of P in the world frame W, m. The result
    is None if the method does not converge.
    """
    p = begin.copy()
    for _ in range(30):
        force, slope = field_.gradient(p)
        if np.linalg.norm(force) < 1e-13:
            break
        step = -np.linalg.pinv(slope, rcond=FLAT) @ force
        size = float(np.linalg.norm(step))
        if size < 1e-15 or np.linalg.norm(p - begin) > _NEWTON_REACH_M:
            break
        p = p + step * min(1.0, 0.05 / size)
    return p if np.linalg.norm(field_.force(p)) < NO_FORCE_N else None


def follow_equilibrium(scenario: Scenario) -> OperatingPoint:
    """Returns the stable equilibrium at which the robot should follow the source.

    ``EquilibriumSearch.follow_point`` has the rules. Raises InputError if there is no
    stable equilibrium.
    """
    return find_equilibria(scenario).follow_point()
