"""Entry of range readings into the map of free space."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.free_space import FreeSpace, cells_within
from systems.safety.views import Sectors, lasting

register_jitable(lasting)

#: A reading updates only one row of cells out of this number of rows. Later readings
#: update the other rows.
_ROWS = 4
#: A cell becomes free if the logarithm of its evidence reaches this limit. By Ville's
#: inequality, noise alone does this with a probability of at most 2.9e-7, which is the
#: probability that normally distributed noise exceeds 5 standard deviations.
_EVIDENCE = 15.06
#: A reading changes the evidence of cells up to this distance behind it, in standard
#: deviations. Farther behind, it would only decrease the evidence.
_BEHIND = 5.0
#: Echoes within this distance count as a full hit, m. Farther echoes count less,
#: because their arcs are longer.
_FULL_HIT_M = 0.6
#: Distance seen free in a sector beyond the edges of the view of a group.
_OUT_OF_VIEW = -1.0


@njit(cache=True, error_model="numpy")
def see(
    space: FreeSpace, turn: int, pose: Any, sectors: Sectors, readings: Any, error: Any
) -> None:  # pragma: no cover  (compiled)
    """Enters the newest readings of the sensors into the map of free space.

    Sensors at the same position form a group. For each group, the function visits the
    cells in its view, up to the greatest distance that the group has seen. For each
    cell, it combines the readings in all directions that the circle around the cell
    covers:

    - If the group has seen free floor in all these directions, up to the far side of
      the circle, the cell becomes free and loses all hits.
    - Otherwise, the readings change the evidence of the cell. If the evidence is large
      enough, the cell becomes free.
    - If the cell does not become free, it gets a hit if an echo comes from the
      direction of its middle and from about its distance.

    Let z be the difference of the least reading and the distance of the far side, in
    standard deviations of the noise. If there were a surface in the cell or nearer, the
    mean of z would be at most 0, and exp(z - 1/2) would have a mean of at most 1. The
    evidence, the product of these factors, would be a supermartingale. When the product
    falls below 1, a new one begins. If the noise of the sensors in a group differs, the
    largest standard deviation counts for all of them, which keeps the mean below 1.

    Args:
        space: Map of free space. The function changes the map in place.
        turn: Number of the call. One call updates only every fourth row of cells. The
            next call updates other rows.
        pose: Pose (x, y, theta) of the robot by its odometry, m and rad.
        sectors: Directions that the sensors see.
        readings: (sensors, 4) array with four distances per sensor, m. The sensor has
            seen free floor up to the first distance, which is 0 without a new reading.
            The second is the distance of the echo, infinite without an echo. The third
            is the reading less all errors but noise, minus infinity without a reading.
            The fourth is the standard deviation of the noise.
        error: Errors that limit how long a cell stays free.
    """
    cell, cells = space.cell_m, space.free_until.shape[0]
    # Radius of the circle around a cell.
    half = cell * math.sqrt(0.5)
    seen = _of_sectors(sectors, readings)
    row, distances = np.empty((cells, 4)), np.empty(cells)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for group in range(len(sectors.places)):
        begin, end = sectors.first[group], sectors.first[group + 1]
        ahead, aside = sectors.places[group]
        # Position of the group in the frame of the odometry.
        sx, sy = pose[0] + c * ahead - s * aside, pose[1] + s * ahead + c * aside
        right, left = sectors.right[begin, 0], sectors.left[end - 1, 0]
        from_axle = math.hypot(ahead, aside)
        farthest = np.max(seen[begin:end, 2])
        low_x, low_y, high_x, high_y = _sector_box(
            sx, sy, pose[2] + right, pose[2] + left, farthest + cell
        )
        low_i, low_j, high_i, high_j = cells_within(space, low_x, low_y, high_x, high_y)
        view = _view_of(sectors, seen, begin, end, pose[2], half)
        sigma = np.max(seen[begin:end, 4])
        for i in range(low_i + (turn - low_i) % _ROWS, high_i + 1, _ROWS):
            dx = (i + 0.5) * cell - sx
            # The cells of the row that are not too far away.
            reach = math.sqrt(max((farthest + cell) ** 2 - dx * dx, 0.0))
            first = max(low_j, math.floor((sy - reach) / cell))
            count = min(high_j, math.floor((sy + reach) / cell)) - first + 1
            if count <= 0:
                continue
            for k in range(count):
                dy = (first + k + 0.5) * cell - sy
                distances[k] = math.sqrt(dx * dx + dy * dy)
            begin_y = (first + 0.5) * cell - sy
            _look_along_row(dx, begin_y, cell, view, row[:count])
            # The map stores the row in two pieces, because its indices wrap around.
            at = first % cells
            piece, turned = min(count, cells - at), i % cells
            of_row = row[:piece], distances[:piece]
            _enter_row(space, turned, at, of_row, sigma, from_axle, error)
            if piece < count:
                of_row = row[piece:count], distances[piece:count]
                _enter_row(space, turned, 0, of_row, sigma, from_axle, error)


@njit(cache=True, error_model="numpy")
def _enter_row(
    space: FreeSpace,
    i: int,
    first: int,
    of_row: Any,
    sigma: float,
    from_axle: float,
    error: Any,
) -> None:  # pragma: no cover  (compiled)
    """Changes the cells of a row of the map; see ``see``.

    ``i`` is the row of the arrays, and ``first`` the first cell in it. ``of_row`` has
    what the group has seen toward each cell (see ``_look_along_row``), and the
    distances of the middles of the cells from the group, m.
    """
    # Radius of the circle around a cell.
    half = space.cell_m * math.sqrt(0.5)
    (row, distances), rolled_m = of_row, space.rolled_m[0]
    count = len(row)
    free_until = space.free_until[i, first : first + count]
    hits = space.hits[i, first : first + count]
    evidence = space.evidence[i, first : first + count]
    evident_until = space.evident_until[i, first : first + count]
    for k in range(count):
        distance = distances[k]
        if distance < 2.0 * half:
            continue
        far = distance + half
        free, reading = row[k, 0] >= far, row[k, 1]
        # A reading that is too short leaves cells without evidence as they are.
        if free or reading > far or (evidence[k] > 0.0 and reading > -np.inf):
            until = rolled_m + lasting(distance + from_axle, error)
            if not free:
                if evidence[k] == 0.0:
                    evident_until[k] = np.inf
                z = (reading - far) / sigma
                evidence[k] = max(evidence[k] + z - 0.5, 0.0)
                evident_until[k] = until = min(evident_until[k], until)
                free = evidence[k] >= _EVIDENCE
            if free:
                free_until[k] = max(free_until[k], until)
                hits[k], evidence[k] = 0.0, 0.0
        if not free and abs(distance - row[k, 2]) <= half:
            hits[k] += min(1.0, _FULL_HIT_M / distance)


@njit(cache=True)
def _of_sectors(
    sectors: Sectors, readings: Any
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Combines the readings of the sensors that see each sector.

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


class _View(NamedTuple):
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
def _view_of(
    sectors: Sectors, seen: Any, begin: int, end: int, heading: float, half: float
) -> _View:  # pragma: no cover  (compiled)
    """Returns the view of the group of sensors with the sectors from begin to end.

    ``half`` is the radius of the circle around a cell, m.
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
    return _View(count, views, begin_at, turns, edges, cuts)


@register_jitable
def _not_zero(value: float) -> float:
    return math.copysign(max(abs(value), 1e-12), value)


@njit(cache=True, error_model="numpy")
def _look_along_row(
    dx: float, begin_y: float, cell: float, view: _View, row: Any
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
    sector, k = np.searchsorted(view.turns[:size], turn, side="right") - 1, 0
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
        if sense > 0.0:
            sector = next_edge
        else:
            sector = sector - 1 if sector > 0 else size - 1
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


@njit(cache=True)
def end_view(
    space: FreeSpace,
    sensor: int,
    time: float,
    pose: Any,
    place: Any,
    direction: Any,
    reach: float,
) -> None:  # pragma: no cover  (compiled)
    """Stores the arc at which the view of a sensor ends.

    Args:
        space: Map of free space. The function changes the map in place.
        sensor: Index of the sensor.
        time: Current time, s.
        pose: Pose (x, y, theta) of the robot by its odometry, m and rad.
        place: Position (x, y) of the sensor relative to the axle, in the axes of the
            body, m.
        direction: Direction of the sensor's axis in the axes of the body, and half of
            the aperture, rad.
        reach: Distance up to which the sensor has seen free floor, m.
    """
    axis, half_angle = direction
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = pose[0] + c * place[0] - s * place[1], pose[1] + s * place[0] + c * place[1]
    end = space.ends[sensor]
    end[0], end[1], end[2], end[3] = x, y, pose[2] + axis, half_angle
    end[4], end[5] = reach, time


@njit(cache=True)
def _sector_box(
    x: float, y: float, right: float, left: float, reach: float
) -> tuple[float, float, float, float]:  # pragma: no cover  (compiled)
    """Computes the rectangle, parallel to the axes, that encloses a sector of a disc.

    The extremes are at the center, at an end of the arc, or where the arc crosses the
    direction of a coordinate axis.

    Returns:
        Least x, least y, greatest x, and greatest y, m.
    """
    low_x, low_y, high_x, high_y = x, y, x, y
    quarter = math.ceil(right / (math.pi / 2.0))
    angle = right
    while True:
        px, py = x + reach * math.cos(angle), y + reach * math.sin(angle)
        low_x, high_x = min(low_x, px), max(high_x, px)
        low_y, high_y = min(low_y, py), max(high_y, py)
        if angle >= left:
            return low_x, low_y, high_x, high_y
        angle = min(left, quarter * math.pi / 2.0)
        quarter += 1
