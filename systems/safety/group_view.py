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
        k, sensor = sectors.pairs[n, 0], sectors.pairs[n, 1]
        free, echo = readings[sensor, 0], readings[sensor, 1]
        reading, noise_m = readings[sensor, 2], readings[sensor, 3]
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
    around, one sector is out of view.

    A row of cells is parallel to the y-axis of the frame of the odometry. In the order
    of increasing y, it crosses the edges of sectors on its side of the group: on side
    0, where x is positive, counterclockwise, and on side 1 clockwise. The arrays may
    have room for more sectors.
    """

    sizes: NDArray[np.int64]
    """(2,) number of edges on each side."""
    seen: NDArray[np.float64]
    """(2, 3, n + 1) distance seen free, reading less all errors but noise, and distance
    of the echo in each sector on a side, m. The first sector contains the direction of
    -y. Each edge begins the next sector."""
    edges: NDArray[np.float64]
    """(2, 6, n) sine, tangent, and cotangent of the direction of each edge; half of the
    length of the part of a row within the radius of a cell's circle from the edge, m;
    and the smaller of the distances seen free and of the readings beside the edge, m.
    """
    cuts: NDArray[np.float64]
    """(3, n) scratch memory for the cells at the edges, see ``_cut_row``."""


class RowView(NamedTuple):
    """What a group of sensors has seen toward the cells of a row."""

    distance: NDArray[np.float64]
    """(m,) distance of the middle of the cell from the group, m."""
    way: NDArray[np.float64]
    """(m,) distance seen free, m."""
    reading: NDArray[np.float64]
    """(m,) reading less all errors but noise, m."""
    echo: NDArray[np.float64]
    """(m,) distance of the nearest echo, m."""
    doubt: NDArray[np.float64]
    """(m,) scratch memory for the cells that may change."""
    begins: NDArray[np.uint64]
    """(m + 1,) scratch memory for the number of sectors that begin at each cell."""


@register_jitable
def row_view(cells: int) -> RowView:
    """Makes the arrays of ``RowView`` for a number of cells."""
    return RowView(
        np.empty(cells),
        np.empty(cells),
        np.empty(cells),
        np.empty(cells),
        np.empty(cells),
        np.empty(cells + 1, np.uint64),
    )


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
    views, cosines, sines = np.empty((most, 3)), np.empty(most), np.empty(most)
    for k in range(begin, end + 1):
        angle, way, reading, echo = stop, _OUT_OF_VIEW, -np.inf, np.inf
        if k < end:
            angle, way = sectors.right[k, 0], seen[k, 0]
            reading, echo = seen[k, 3], seen[k, 1]
        elif stop - start > math.tau - 1e-9:
            break  # the group sees all around
        n = max(count - 1, 0)
        same = way == views[n, 0] and reading == views[n, 1] and echo == views[n, 2]
        if count > 0 and same:
            continue
        views[count, 0], views[count, 1], views[count, 2] = way, reading, echo
        cosines[count] = _not_zero(math.cos(heading + angle))
        sines[count] = _not_zero(math.sin(heading + angle))
        count += 1
    view = GroupView(
        np.zeros(2, np.int64),
        np.empty((2, 3, most + 1)),
        np.empty((2, 6, most)),
        np.empty((3, most)),
    )
    sector = _sector_of_minus_y(cosines, sines, count)
    for n in range(3):
        view.seen[0, n, 0] = view.seen[1, n, 0] = views[sector, n]
    for n in range(1, count + 1):
        # Edge k is between the sectors k - 1 and k.
        k = (sector + n) % count
        if cosines[k] < 0.0:
            break
        before = k - 1 if k > 0 else count - 1
        _add_edge(view, 0, cosines[k], sines[k], views, before, k, half)
    for n in range(count):
        k = (sector - n) % count
        if cosines[k] > 0.0:
            break
        behind = k - 1 if k > 0 else count - 1
        _add_edge(view, 1, cosines[k], sines[k], views, k, behind, half)
    return view


@register_jitable
def _not_zero(value: float) -> float:
    return math.copysign(max(abs(value), 1e-12), value)


@register_jitable
def _sector_of_minus_y(cosines: Any, sines: Any, count: int) -> int:
    """Finds the sector that contains the direction of -y.

    From the right edge of this sector to the left, x becomes positive or the tangent of
    the direction decreases.
    """
    for k in range(count):
        left = k + 1 if k + 1 < count else 0
        falls = sines[left] / cosines[left] <= sines[k] / cosines[k]
        was_ahead, is_ahead = cosines[k] > 0.0, cosines[left] > 0.0
        if (is_ahead and not was_ahead) or (is_ahead == was_ahead and falls):
            return k
    return 0


@register_jitable
def _add_edge(
    view: GroupView,
    side: int,
    cosine: float,
    sine: float,
    views: Any,
    before: int,
    behind: int,
    half: float,
) -> None:
    """Adds an edge to a side of a view, and the sector behind it.

    ``before`` and ``behind`` are the indices of the sectors beside the edge, in the
    order of a row.
    """
    n, edges = view.sizes[side], view.edges
    edges[side, 0, n], edges[side, 1, n] = sine, sine / cosine
    edges[side, 2, n], edges[side, 3, n] = cosine / sine, half / abs(cosine)
    for m in range(2):
        edges[side, 4 + m, n] = min(views[before, m], views[behind, m])
    for m in range(3):
        view.seen[side, m, n + 1] = views[behind, m]
    view.sizes[side] = n + 1


@njit(cache=True, error_model="numpy")
def look_along_row(
    dx: float, begin_y: float, cell: float, count: int, view: GroupView, row: RowView
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
        count: Number of cells.
        view: What the group has seen.
        row: Arrays that the function fills for each cell.
    """
    half, edges = cell * math.sqrt(0.5), view.edges
    own = 0 if dx >= 0.0 else 1
    for side in (own, 1 - own):
        # A circle that contains a part of the y-axis can meet edges on both sides.
        if side != own and abs(dx) > half:
            break
        # numba would count the references to all arrays at each call of a function that
        # is not inlined.
        size = view.sizes[side]
        _cut_row(dx, begin_y, cell, float(count), side, size, edges, view.cuts)
        if side == own:
            _fill_row(view, side, row, count)
        _meet_edges(view, side, row)


@register_jitable(inline="always")
def _fill_row(
    view: GroupView, side: int, row: RowView, count: int
) -> None:  # pragma: no cover  (compiled)
    """Enters the sector that contains the middle of each cell.

    The loops have no branches, which the processor would have to predict.
    """
    begins, seen, cuts = row.begins, view.seen, view.cuts
    ways, readings, echoes = row.way, row.reading, row.echo
    begins[: count + 1] = 0
    for k in range(view.sizes[side]):
        begins[int(cuts[0, k])] += np.uint64(1)
    # numba checks the sign of every index that may be negative.
    sector = np.uint64(0)
    for n in range(count):
        sector += begins[n]
        ways[n], readings[n] = seen[side, 0, sector], seen[side, 1, sector]
        echoes[n] = seen[side, 2, sector]


@register_jitable(inline="always")
def _meet_edges(
    view: GroupView, side: int, row: RowView
) -> None:  # pragma: no cover  (compiled)
    """Enters the sectors on both sides of an edge that the circle of a cell meets."""
    edges, cuts = view.edges, view.cuts
    ways, readings, echoes = row.way, row.reading, row.echo
    for k in range(view.sizes[side]):
        way, reading = edges[side, 4, k], edges[side, 5, k]
        begin, end = np.uint64(int(cuts[1, k])), np.uint64(int(cuts[2, k]))
        for n in range(begin, end):
            ways[n] = min(ways[n], way)
            readings[n] = min(readings[n], reading)
            if way == _OUT_OF_VIEW:
                echoes[n] = np.inf


@register_jitable(inline="always")
def _cut_row(
    dx: float,
    begin_y: float,
    cell: float,
    count: float,
    side: int,
    size: int,
    edges: Any,
    cuts: Any,
) -> None:  # pragma: no cover  (compiled)
    """Computes at which cells of a row the edges of a side are.

    The results are numbers from 0 to ``count``: the first cell whose middle is behind
    the edge, and the first and the last cell, plus 1, whose circles meet it. This loop
    has no branches, which the loops over cells would have to wait for.
    """
    for k in range(size):
        middle, behind = dx * edges[side, 1, k], -dx * edges[side, 2, k]
        wide = edges[side, 3, k]
        low, high, ahead = middle - wide, middle + wide, edges[side, 0, k] > 0.0
        low = max(low, behind) if ahead else low
        high = high if ahead else min(high, behind)
        first = np.ceil((middle - begin_y) / cell)
        begin = np.floor((low - begin_y) / cell) + 1.0
        end = np.ceil((high - begin_y) / cell)
        cuts[0, k] = min(max(first, 0.0), count)
        cuts[1, k] = min(max(begin, 0.0), count)
        cuts[2, k] = min(max(end, 0.0), count)
