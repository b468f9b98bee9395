"""All equilibria of the closed loop at rest, in a whole workspace."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.models.equilibrium_search import (
    CONTACT_CELLS,
    CellSearch,
    Leftover,
    SearchArea,
)
from analysis.models.force_field import ForceField
from analysis.models.ideal_loop import frozen_scenario, ideal_loop, ideal_scenario
from analysis.models.operating_points import (
    FLAT,
    NO_FORCE_N,
    OperatingPoint,
    resting_equilibrium,
)
from diagrams.scenario import Scenario
from systems.framework.input_error import InputError

__all__ = [
    "EquilibriumSearch",
    "SwitchingPoint",
    "find_equilibria",
    "follow_equilibrium",
    "nearest_equilibrium",
]

#: Roots nearer to each other than this are one, m.
_SAME_M = 1e-6
#: Starts of Newton's method in a group of cells, beside those round which the
#: force turns.
_MOST_STARTS = 6
#: Newton's method gives up so far from its start, m.
_NEWTON_REACH_M = 0.5
#: Edge of the smallest cells, m.
_SMALLEST_M = 0.002


@dataclass(frozen=True)
class SwitchingPoint:
    """Where the nearest body changes and the forces before and behind oppose."""

    p_WP: NDArray[np.float64]
    """(2,) m, to the size of a cell."""
    attractive: bool
    """Both forces drive P to the line on which the body changes: P stays there,
    chattering."""


@dataclass(frozen=True)
class EquilibriumSearch:
    """All equilibria in a workspace, and what the search vouches for."""

    scenario: Scenario = field(repr=False)
    """All ideal, with bodies at rest."""
    points: tuple[OperatingPoint, ...]
    """Nearest to the source first."""
    switching: tuple[SwitchingPoint, ...]
    """See ``SwitchingPoint``."""
    area_m: SearchArea
    """Smallest x, largest x, smallest y, largest y of P."""
    cell_m: float
    """Edge of the smallest cells, m."""
    cells: int
    """Cells looked at, of all sizes."""
    unresolved: tuple[tuple[float, float], ...]
    """Centres of groups of cells that could neither be left out nor be traced
    to an equilibrium, m."""
    empty_outside: bool
    """Whether attraction exceeds every repulsion beyond the area."""

    @property
    def complete(self) -> bool:
        """Whether no equilibrium can have been missed."""
        return not self.unresolved and self.empty_outside

    def follow_point(self) -> OperatingPoint:
        """The stable equilibrium that is nearest to the follow distance.

        Raises:
            InputError: There is no stable equilibrium.
        """
        sinks = [point for point in self.points if point.stable]
        if not sinks:
            kinds = ", ".join(point.kind for point in self.points) or "none at all"
            raise InputError(
                "attraction",
                f"the loop has no stable equilibrium (found: {kinds}), so that there "
                "is nothing to linearise about; raise attraction.damping_n_s_m or "
                "lower the law's stiffness",
            )
        return min(sinks, key=lambda point: abs(point.offset_m))

    @property
    def statement(self) -> str:
        """What was searched, and how completely, in a sentence or two."""
        x0, x1, y0, y1 = self.area_m
        where = f"[{x0:g}, {x1:g}] m x [{y0:g}, {y1:g}] m"
        contact = CONTACT_CELLS * self.cell_m * 1e3
        text = (
            f"{len(self.points)} equilibria and {len(self.switching)} switching "
            f"points with P in {where}, {contact:.0f} mm or more from every body. "
            f"{self.cells} cells down to {self.cell_m * 1e3:.1f} mm were looked at; "
            "in those left out the force exceeds its largest change within the cell"
        )
        if self.unresolved:
            text += f"; {len(self.unresolved)} groups of cells stay open"
        beyond = "exceeds" if self.empty_outside else "need not exceed"
        return f"{text}. Beyond the area the attraction {beyond} every repulsion."


def find_equilibria(
    scenario: Scenario,
    *,
    area_m: SearchArea | None = None,
    smallest_m: float = _SMALLEST_M,
) -> EquilibriumSearch:
    """Searches a workspace for all equilibria of the closed loop at rest.

    Args:
        scenario: Its sensors are taken to be ideal; bodies rest where they are
            at time zero (``frozen_scenario`` for another moment).
        area_m: Of P; by default all bodies and the start with 2 m around.
        smallest_m: Edge below which cells are not quartered, m.

    Returns:
        All points of rest that were found, and what is left unresolved.

    Raises:
        InputError: The area is empty, or the law has no derivative.
    """
    if not smallest_m > 0.0:
        raise InputError("smallest_m", f"is {smallest_m}; give a positive length in m")
    scenario = frozen_scenario(ideal_scenario(scenario))
    area = area_m or _area(scenario)
    if not (area[0] < area[1] and area[2] < area[3]):
        raise InputError(
            "area_m", f"{area} is empty; give (x_min, x_max, y_min, y_max) in m"
        )
    loop = ideal_loop(scenario)
    field_ = ForceField(loop)
    search = CellSearch(field_)
    groups, cells, edge = search.left_over(area, smallest_m)
    roots: list[NDArray[np.float64]] = []
    switching: list[SwitchingPoint] = []
    unresolved: list[tuple[float, float]] = []
    for group in groups:
        found = _roots(field_, group, edge, scenario.start.position_m)
        switches = _switching_points(search, group)
        if not found and not switches:
            weakest = group.centres[group.strengths.argmin()]
            unresolved.append((float(weakest[0]), float(weakest[1])))
        roots += [r for r in found if not _near(r, roots)]
        switching += switches
    points = [resting_equilibrium(loop, root) for root in roots]
    points.sort(key=lambda point: point.source_distance_m)
    return EquilibriumSearch(
        scenario=scenario,
        points=tuple(points),
        switching=tuple(switching),
        area_m=area,
        cell_m=edge,
        cells=cells,
        unresolved=tuple(unresolved),
        empty_outside=search.outside_is_empty(area),
    )


def _area(scenario: Scenario) -> SearchArea:
    margin = scenario.attraction.follow_distance_m + 1.0
    places = [scenario.start.position_m]
    places += [tuple(b.rectangle(0.0)[:2]) for b in scenario.bodies().values()]
    low, high = np.min(places, axis=0) - margin, np.max(places, axis=0) + margin
    edges = [low[0], high[0], low[1], high[1]]
    return tuple(round(float(edge), 3) for edge in edges)  # type: ignore[return-value]


def _near(root: NDArray[np.float64], roots: list[NDArray[np.float64]]) -> bool:
    return any(np.linalg.norm(root - other) < _SAME_M for other in roots)


def _roots(
    field_: ForceField, group: Leftover, edge: float, start: tuple[float, float]
) -> list[NDArray[np.float64]]:
    """Zeros of the force in and about a group of cells.

    Of a continuum the point nearest to the robot's start stands for all.
    """
    near = np.linalg.norm(group.centres - np.asarray(start), axis=1).argmin()
    turned = np.flatnonzero(group.winding)
    weakest = np.argsort(group.strengths)[:_MOST_STARTS]
    found: list[NDArray[np.float64]] = []
    flat: list[NDArray[np.float64]] = []
    for cell in (near, *weakest, *turned):
        if len(flat) > _MOST_STARTS:
            break
        root = nearest_equilibrium(field_, group.centres[cell])
        if root is None or np.abs(group.centres - root).max(axis=1).min() > 2.0 * edge:
            continue
        sizes = np.abs(np.linalg.eigvals(field_.gradient(root)[1]))
        isolated = sizes.min() > FLAT * max(sizes.max(), 1.0)
        kept = found if isolated else flat
        if not _near(root, kept):
            kept.append(root)
    return found or flat[:1]


def nearest_equilibrium(
    field_: ForceField, begin: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Where no force acts on P, by Newton's method.

    Args:
        field_: The force on P at rest.
        begin: (2,) where to begin, in W, m.

    Returns:
        (2,) in W, m, or None where none was found.
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


def _switching_points(search: CellSearch, group: Leftover) -> list[SwitchingPoint]:
    """At most one a group: where the two forces come nearest to cancelling."""
    if not group.switches.any():
        return []
    centres = group.centres[group.switches]
    first, second, away_1, away_2 = search.opposed(centres)
    normal = away_1 - away_2
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    across_1 = np.einsum("nj,nj->n", first, normal)
    across_2 = np.einsum("nj,nj->n", second, normal)
    total = across_1 - across_2
    share = np.divide(-across_2, total, out=np.full_like(total, -1.0), where=total != 0)
    sliding = first * share[:, None] + second * (1.0 - share[:, None])
    opposed = (share >= 0.0) & (share <= 1.0)
    left = np.where(opposed, np.linalg.norm(sliding, axis=1), np.inf)
    best = int(left.argmin())
    if left[best] > group.change[group.switches][best]:
        return []
    return [SwitchingPoint(centres[best], bool(across_1[best] > 0.0))]


def follow_equilibrium(scenario: Scenario) -> OperatingPoint:
    """The stable equilibrium at rest that is nearest to the follow distance.

    Raises:
        InputError: There is no stable equilibrium.
    """
    return find_equilibria(scenario).follow_point()
