"""Entry of range readings into the map of free space."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

from systems.framework.compiling import njit
from systems.safety.free_space import FineSpace, FreeSpace, cells_within
from systems.safety.group_view import group_view, look_along_row, seen_in_sectors
from systems.safety.views import Sectors, lasting

register_jitable(lasting)

#: A reading updates only one row of cells out of this number of rows. Later readings
#: update the other rows. A reading updates all rows of fine cells.
_ROWS = 4
#: A cell becomes free if the logarithm of its evidence reaches this limit. By Ville's
#: inequality, noise alone does this with a probability of at most 2.9e-7, which is the
#: probability that normally distributed noise exceeds 5 standard deviations.
_EVIDENCE = 15.06
#: Echoes within this distance count as a full hit, m. Farther echoes count less,
#: because their arcs are longer.
_FULL_HIT_M = 0.6


@njit(cache=True, error_model="numpy")
def see(
    space: FreeSpace | FineSpace,
    turn: int,
    pose: Any,
    sectors: Sectors,
    readings: Any,
    error: Any,
    rows: int = _ROWS,
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
        turn: Number of the call.
        pose: Pose (x, y, theta) of the robot by its odometry, m and rad.
        sectors: Directions that the sensors see.
        readings: (sensors, 4) array with four distances per sensor, m. The sensor has
            seen free floor up to the first distance, which is 0 without a new reading.
            The second is the distance of the echo, infinite without an echo. The third
            is the reading less all errors but noise, minus infinity without a reading.
            The fourth is the standard deviation of the noise.
        error: Errors that limit how long a cell stays free.
        rows: One call updates one row of cells out of this number of rows. The next
            call updates other rows.
    """
    cell, cells = space.cell_m, space.free_until.shape[0]
    # Radius of the circle around a cell.
    half = cell * math.sqrt(0.5)
    seen = seen_in_sectors(sectors, readings)
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
        view = group_view(sectors, seen, begin, end, pose[2], half)
        sigma = np.max(seen[begin:end, 4])
        for i in range(low_i + (turn - low_i) % rows, high_i + 1, rows):
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
            look_along_row(dx, begin_y, cell, view, row[:count])
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
    space: FreeSpace | FineSpace,
    i: int,
    first: int,
    of_row: Any,
    sigma: float,
    from_axle: float,
    error: Any,
) -> None:  # pragma: no cover  (compiled)
    """Changes the cells of a row of the map; see ``see``.

    ``i`` is the row of the arrays, and ``first`` the first cell in it. ``of_row`` has
    what the group has seen toward each cell (see ``look_along_row``), and the
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
