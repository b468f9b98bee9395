"""Entry of range readings into the map of free space."""

from __future__ import annotations

import math
from typing import Any

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


@njit(cache=True)
def see(
    space: FreeSpace,
    time: float,
    turn: int,
    pose: Any,
    sectors: Sectors,
    readings: Any,
    error: Any,
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
        time: Current time, s.
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
    row = np.empty((cells, 3))
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
        edges, views = _view_of(sectors, seen, begin, end, pose[2])
        sigma = np.max(seen[begin:end, 4])
        for i in range(low_i + (turn - low_i) % _ROWS, high_i + 1, _ROWS):
            dx = (i + 0.5) * cell - sx
            # The cells of the row that are not too far away.
            reach = math.sqrt(max((farthest + cell) ** 2 - dx * dx, 0.0))
            first = max(low_j, math.floor((sy - reach) / cell))
            count = min(high_j, math.floor((sy + reach) / cell)) - first + 1
            if count <= 0:
                continue
            begin_y = (first + 0.5) * cell - sy
            _look_along_row(dx, begin_y, cell, edges, views, row[:count])
            at_i, at_j = i % cells, first % cells - 1
            for k in range(count):
                at_j = at_j + 1 if at_j + 1 < cells else 0
                dy = (first + k + 0.5) * cell - sy
                squared = dx * dx + dy * dy
                if squared < 4.0 * half * half:
                    continue
                distance = math.sqrt(squared)
                free, far = row[k, 0] >= distance + half, distance + half
                at = at_i, at_j
                if free or row[k, 2] > -np.inf:
                    until = space.rolled_m[0] + lasting(distance + from_axle, error)
                    if not free:
                        until = _weigh(space, at, (row[k, 2] - far) / sigma, until)
                        free = space.evidence[at] >= _EVIDENCE
                    if free:
                        space.free_until[at] = max(space.free_until[at], until)
                        space.seen_s[at] = time
                        space.hits[at], space.evidence[at] = 0.0, 0.0
                if not free and abs(distance - row[k, 1]) <= half:
                    space.hits[at] += min(1.0, _FULL_HIT_M / distance)


@register_jitable
def _weigh(space: FreeSpace, at: Any, z: float, until: float) -> float:
    """Adds a reading to the evidence of a cell.

    The reading is valid until the rolled distance ``until``, m. The function returns
    the distance until which all readings in the evidence are valid, m.
    """
    if space.evidence[at] == 0.0:
        space.evident_until[at] = np.inf
    space.evidence[at] = max(space.evidence[at] + z - 0.5, 0.0)
    space.evident_until[at] = min(space.evident_until[at], until)
    return space.evident_until[at]


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
        free, echo, first = 0.0, np.inf, True
        seen[k, 3], seen[k, 4] = -np.inf, 1.0
        for sensor in range(len(readings)):
            if sectors.seen_by[k, sensor]:
                if first and readings[sensor, 3] > 0.0:
                    seen[k, 3], seen[k, 4] = readings[sensor, 2], readings[sensor, 3]
                first = False
                free = max(free, readings[sensor, 0])
                echo = min(echo, readings[sensor, 1])
        seen[k, 0], seen[k, 1] = free, echo
        # Cells behind the echo also lose evidence.
        behind = echo + _BEHIND * seen[k, 4] if seen[k, 3] > -np.inf else echo
        seen[k, 2] = max(free, behind) if echo < np.inf else free
    return seen


@njit(cache=True)
def _view_of(
    sectors: Sectors, seen: Any, begin: int, end: int, heading: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Returns the view of a group of sensors as sectors that fill the full circle.

    Returns:
        (n, 4) cosine, sine, tangent, and cotangent of the direction of the right edge
        of each sector in the frame of the odometry, from right to left; and (n, 3)
        distance seen free, distance of the echo, and reading less all errors but noise
        in each sector, m. If the group does not see all around, the last sector is out
        of view.
    """
    count = end - begin
    around = sectors.left[end - 1, 0] - sectors.right[begin, 0] > math.tau - 1e-9
    size = count if around else count + 1
    edges, views = np.empty((size, 4)), np.empty((size, 3))
    for k in range(size):
        angle = sectors.right[begin + k, 0] if k < count else sectors.left[end - 1, 0]
        cosine = _not_zero(math.cos(heading + angle))
        sine = _not_zero(math.sin(heading + angle))
        edges[k, 0], edges[k, 1] = cosine, sine
        edges[k, 2], edges[k, 3] = sine / cosine, cosine / sine
        views[k, 0] = seen[begin + k, 0] if k < count else _OUT_OF_VIEW
        views[k, 1] = seen[begin + k, 1] if k < count else np.inf
        views[k, 2] = seen[begin + k, 3] if k < count else -np.inf
    return edges, views


@register_jitable
def _not_zero(value: float) -> float:
    return math.copysign(max(abs(value), 1e-12), value)


@njit(cache=True, error_model="numpy")
def _look_along_row(
    dx: float,
    begin_y: float,
    cell: float,
    edges: Any,
    views: Any,
    row: Any,
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
        edges: (n, 4) edges of the sectors, see ``_view_of``.
        views: (n, 3) what each sector has seen, see ``_view_of``.
        row: (m, 3) array that the function fills with distance seen free, echo and
            reading for each cell, m.
    """
    size, count, half = len(edges), len(row), cell * math.sqrt(0.5)
    # Along the row, the direction turns to the left for dx > 0, and otherwise to the
    # right. ``slope`` grows.
    sense = 1.0 if dx >= 0.0 else -1.0
    slope = begin_y / max(abs(dx), 1e-12)
    slope -= 1e-9 * (1.0 + abs(slope))
    sector, k = _sector_at(dx, begin_y, edges), 0
    while k < count:
        next_edge, end = (sector + 1) % size if sense > 0.0 else sector, count
        cosine, tangent = edges[next_edge, 0], edges[next_edge, 2]
        if sense * cosine > 0.0 and sense * tangent > slope:
            slope = sense * tangent
            end = _index(math.ceil((dx * tangent - begin_y) / cell), k, count)
        way, back, reading = views[sector, 0], views[sector, 1], views[sector, 2]
        while k < end:
            row[k, 0], row[k, 1], row[k, 2] = way, back, reading
            k += 1
        sector = next_edge if sense > 0.0 else (sector - 1) % size
    # The cells whose circles meet an edge.
    for right in range(size):
        if abs(dx) > half and (edges[right, 0] > 0.0) != (dx > 0.0):
            continue
        middle, wide = dx * edges[right, 2], half / abs(edges[right, 0])
        low, high, behind = middle - wide, middle + wide, -dx * edges[right, 3]
        if edges[right, 1] > 0.0:
            low = max(low, behind)
        else:
            high = min(high, behind)
        k = _index(math.floor((low - begin_y) / cell) + 1.0, 0, count)
        end = _index(math.ceil((high - begin_y) / cell), 0, count)
        other = right - 1 if right > 0 else size - 1
        both = min(views[right, 0], views[other, 0])
        reading = min(views[right, 2], views[other, 2])
        while k < end:
            row[k, 0], row[k, 2] = min(row[k, 0], both), min(row[k, 2], reading)
            if both == _OUT_OF_VIEW:
                row[k, 1] = np.inf
            k += 1


@register_jitable
def _index(value: float, low: int, high: int) -> int:
    return int(min(max(value, float(low)), float(high)))


@njit(cache=True)
def _sector_at(dx: float, dy: float, edges: Any) -> int:  # pragma: no cover  (compiled)
    """Returns the index of the sector that contains the direction (dx, dy)."""
    found, least = 0, 4.0
    for k in range(len(edges)):
        # Angle from the right edge of the sector, in quarters of a turn.
        cosine, sine = edges[k, 0], edges[k, 1]
        ahead, aside = cosine * dx + sine * dy, cosine * dy - sine * dx
        angle = aside / (abs(ahead) + abs(aside))
        if ahead < 0.0:
            angle = 2.0 - angle
        elif aside < 0.0:
            angle += 4.0
        if angle < least:
            found, least = k, angle
    return found


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
    points = space.arcs.shape[1]
    for k in range(points):
        angle = pose[2] + axis + half_angle * (2.0 * k / (points - 1) - 1.0)
        space.arcs[sensor, k, 0] = x + reach * math.cos(angle)
        space.arcs[sensor, k, 1] = y + reach * math.sin(angle)
    space.arcs_s[sensor, 0] = time


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
