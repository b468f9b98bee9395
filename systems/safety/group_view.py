"""What the range sensors at one position have seen toward the cells of the map."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.views import Sectors

#: A reading changes the evidence of cells up to this distance behind it, in standard
#: deviations. Farther behind, it would only decrease the evidence.
_BEHIND = 5.0
#: Distance seen free in a sector beyond the edges of the view of a group.
_OUT_OF_VIEW = -1.0


@njit(cache=True)
def seen_in_sectors(
    sectors: Sectors, readings: Any
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Combines the readings of the sensors that see each sector.

    Args:
        sectors: Directions that the sensors see.
        readings: (sensors, 4) four distances per sensor, see ``seen_cells.see``, m.

    Returns:
        (sectors, 5) five distances per sector, m: the distance seen free; the distance
        of the nearest echo, infinite without an echo; the distance up to which cells
        can change; and the reading and the noise of the first sensor, minus infinity
        and 1 without a new reading or without noise.
    """
    seen = np.empty((len(sectors.right), 5))
    for k in range(len(seen)):
        seen[k, 0], seen[k, 1], seen[k, 3], seen[k, 4] = 0.0, np.inf, -np.inf, 1.0
    last = -1
    for n in range(len(sectors.pairs)):
        k, sensor = sectors.pairs[n]
        free, echo, reading, noise_m = readings[sensor]
        if k != last and noise_m > 0.0:
            seen[k, 3], seen[k, 4] = reading, noise_m
        seen[k, 0], seen[k, 1] = max(seen[k, 0], free), min(seen[k, 1], echo)
        last = k
    for k in range(len(seen)):
        free, echo = seen[k, 0], seen[k, 1]
        # Cells behind the echo also lose evidence.
        behind = echo + _BEHIND * seen[k, 4] if seen[k, 3] > -np.inf else echo
        seen[k, 2] = max(free, behind) if echo < np.inf else free
    return seen


class GroupView(NamedTuple):
    """View of a group of sensors as sectors that fill the full circle.

    Neighboring sectors have seen different distances. If the group does not see all
    around, one sector is out of view. The arrays may have room for more sectors.
    """

    size: int
    """Number of sectors."""
    seen: NDArray[np.float64]
    """(n, 3) distance seen free, distance of the echo, and reading less all errors but
    noise in each sector, m."""
    begin: float
    """Direction of the right edge of the first sector in the frame of the odometry,
    rad."""
    turns: NDArray[np.float64]
    """(n,) angle from there to the right edge of each sector, counterclockwise, rad."""
    edges: NDArray[np.float64]
    """(7, n) right edge of each sector: cosine, sine, tangent, and cotangent of its
    direction in the frame of the odometry; half of the length of the part of a row
    within the radius of a cell's circle from the edge, m; and the smaller of the
    distances seen free and of the readings on both sides, m."""
    cuts: NDArray[np.float64]
    """(3, n) scratch memory for the cells at the edges, see ``_cut_row``."""


@njit(cache=True, error_model="numpy")
def group_view(
    sectors: Sectors, seen: Any, begin: int, end: int, heading: float, half: float
) -> GroupView:  # pragma: no cover  (compiled)
    """Makes the view of a group of sensors.

    Args:
        sectors: Directions that the sensors see.
        seen: (sectors, 5) distances from ``seen_in_sectors``, m.
        begin: First sector of the group.
        end: Last sector of the group, plus 1.
        heading: Heading of the robot, rad.
        half: Radius of the circle around a cell, m.

    Returns:
        The view.
    """
    start, stop = sectors.right[begin, 0], sectors.left[end - 1, 0]
    most, count = end - begin + 1, 0
    views, turns, edges = np.empty((most, 3)), np.empty(most), np.empty((7, most))
    for k in range(begin, end + 1):
        angle, way, echo, reading = stop, _OUT_OF_VIEW, np.inf, -np.inf
        if k < end:
            angle, reading = sectors.right[k, 0], seen[k, 3]
            way, echo = seen[k, 0], seen[k, 1]
        elif stop - start > math.tau - 1e-9:
            break  # the group sees all around
        if count > 0:
            last = views[count - 1]
            if way == last[0] and echo == last[1] and reading == last[2]:
                continue
        views[count, 0], views[count, 1], views[count, 2] = way, echo, reading
        cosine = _not_zero(math.cos(heading + angle))
        sine = _not_zero(math.sin(heading + angle))
        edges[0, count], edges[1, count] = cosine, sine
        edges[2, count], edges[3, count] = sine / cosine, cosine / sine
        edges[4, count], turns[count] = half / abs(cosine), angle - start
        count += 1
    for k in range(count):
        other = k - 1 if k > 0 else count - 1
        edges[5, k] = min(views[k, 0], views[other, 0])
        edges[6, k] = min(views[k, 2], views[other, 2])
    begin_at, cuts = heading + start, np.empty((3, most))
    return GroupView(count, views, begin_at, turns, edges, cuts)


@register_jitable
def _not_zero(value: float) -> float:
    return math.copysign(max(abs(value), 1e-12), value)


@njit(cache=True, error_model="numpy")
def look_along_row(
    dx: float, begin_y: float, cell: float, view: GroupView, row: Any
) -> None:  # pragma: no cover  (compiled)
    """Computes how far a group of sensors has seen toward the cells of a row.

    The distance seen free toward a cell, and the reading, are the least of all sectors
    that overlap the circle around the cell. The echo is that of the sector that
    contains the middle of the cell. There is no echo and no reading if a part of the
    circle is out of view.

    Args:
        dx: Position of the row relative to the group, m.
        begin_y: Position of the middle of the first cell relative to the group, m.
        cell: Side of a cell, m.
        view: What the group has seen.
        row: (m, 4) array whose first three columns the function fills with distance
            seen free, reading, and echo for each cell, m.
    """
    seen, edges, cuts, count = view.seen, view.edges, view.cuts, len(row)
    size, half = view.size, cell * math.sqrt(0.5)
    _cut_row(dx, begin_y, cell, float(count), size, edges, cuts)
    # Along the row, the direction turns to the left for dx > 0, and otherwise to the
    # right. ``slope`` grows.
    sense = 1.0 if dx >= 0.0 else -1.0
    slope = begin_y / max(abs(dx), 1e-12)
    slope -= 1e-9 * (1.0 + abs(slope))
    turn = math.atan2(begin_y, dx) - view.begin
    turn -= math.tau * math.floor(turn / math.tau)
    sector, k = int(np.searchsorted(view.turns[:size], turn, side="right")) - 1, 0
    while k < count:
        next_edge, end = sector, count
        if sense > 0.0:
            next_edge = sector + 1 if sector + 1 < size else 0
        cosine, tangent = edges[0, next_edge], edges[2, next_edge]
        if sense * cosine > 0.0 and sense * tangent > slope:
            slope = sense * tangent
            end = max(int(cuts[0, next_edge]), k)
        way, echo, reading = seen[sector, 0], seen[sector, 1], seen[sector, 2]
        for n in range(k, end):
            row[n, 0], row[n, 1], row[n, 2], row[n, 3] = way, reading, echo, 0.0
        k = end
        sector = next_edge if sense > 0.0 else (sector or size) - 1
    # The cells whose circles meet an edge.
    for k in range(size):
        if abs(dx) > half and (edges[0, k] > 0.0) != (dx > 0.0):
            continue
        both, reading = edges[5, k], edges[6, k]
        for n in range(int(cuts[1, k]), int(cuts[2, k])):
            row[n, 0], row[n, 1] = min(row[n, 0], both), min(row[n, 1], reading)
            if both == _OUT_OF_VIEW:
                row[n, 2] = np.inf


@njit(cache=True, error_model="numpy")
def _cut_row(
    dx: float,
    begin_y: float,
    cell: float,
    count: float,
    size: int,
    edges: Any,
    cuts: Any,
) -> None:  # pragma: no cover  (compiled)
    """Computes at which cells of a row the edges of the sectors are.

    The results are whole numbers from 0 to ``count``: the first cell whose middle is
    behind the edge, and the first and the last cell, plus 1, whose circles meet it.
    This loop has no branches, which the loops over cells would have to wait for.
    """
    for k in range(size):
        middle, behind, wide = dx * edges[2, k], -dx * edges[3, k], edges[4, k]
        low, high, ahead = middle - wide, middle + wide, edges[1, k] > 0.0
        low = max(low, behind) if ahead else low
        high = high if ahead else min(high, behind)
        first = np.ceil((middle - begin_y) / cell)
        begin = np.floor((low - begin_y) / cell) + 1.0
        end = np.ceil((high - begin_y) / cell)
        cuts[0, k] = min(max(first, 0.0), count)
        cuts[1, k] = min(max(begin, 0.0), count)
        cuts[2, k] = min(max(end, 0.0), count)
