"""Entry of range readings into the map of free space."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

from systems.framework.compiling import njit
from systems.safety.free_space import FineSpace, FreeSpace, cells_within
from systems.safety.group_view import (
    RowView,
    group_view,
    look_along_row,
    row_view,
    seen_in_sectors,
)
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
    row = row_view(cells)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for group in range(len(sectors.places)):
        begin, end = sectors.first[group], sectors.first[group + 1]
        ahead, aside = sectors.places[group, 0], sectors.places[group, 1]
        # Position of the group in the frame of the odometry.
        sx, sy = pose[0] + c * ahead - s * aside, pose[1] + s * ahead + c * aside
        right, left = sectors.right[begin, 0], sectors.left[end - 1, 0]
        from_axle = math.hypot(ahead, aside)
        farthest, sigma = _greatest(seen, begin, end, 2), _greatest(seen, begin, end, 4)
        low_x, low_y, high_x, high_y = _sector_box(
            sx, sy, pose[2] + right, pose[2] + left, farthest + cell
        )
        low_i, low_j, high_i, high_j = cells_within(space, low_x, low_y, high_x, high_y)
        view = group_view(sectors, seen, begin, end, pose[2], half)
        for i in range(low_i + (turn - low_i) % rows, high_i + 1, rows):
            dx = (i + 0.5) * cell - sx
            # The cells of the row that are not too far away.
            reach = math.sqrt(max((farthest + cell) ** 2 - dx * dx, 0.0))
            first = max(low_j, math.floor((sy - reach) / cell))
            count = min(high_j, math.floor((sy + reach) / cell)) - first + 1
            if count <= 0:
                continue
            look_along_row(dx, (first + 0.5) * cell - sy, cell, count, view, row)
            place = dx, sy, first, from_axle, cell
            # The map stores the row in two pieces, because its indices wrap around.
            at = i % cells, first % cells
            stop = min(count, cells - at[1])
            for done, end, low in ((0, stop, at[1]), (stop, count, 0)):
                if done == end:
                    continue
                # To pass the whole map would copy many arrays.
                high = low + end - done
                piece = (
                    space.free_until[at[0], low:high],
                    space.hits[at[0], low:high],
                    space.evidence[at[0], low:high],
                    space.evident_until[at[0], low:high],
                )
                _enter_row(piece, row, done, place, space.rolled_m[0], sigma, error)


@register_jitable
def _greatest(seen: Any, begin: int, end: int, column: int) -> float:
    """Returns the largest number in some rows of a column."""
    greatest = seen[begin, column]
    for k in range(begin + 1, end):
        greatest = max(greatest, seen[k, column])
    return greatest


@njit(cache=True, error_model="numpy")
def _enter_row(
    piece: Any,
    row: RowView,
    begin: int,
    place: Any,
    rolled_m: float,
    sigma: float,
    error: Any,
) -> None:  # pragma: no cover  (compiled)
    """Enters what the sensors have seen into a piece of a row of the map.

    ``piece`` has this piece of four arrays of the map: ``free_until``, ``hits``,
    ``evidence``, and ``evident_until``. Its first cell has the index ``begin`` in
    ``row``. ``place`` has the position of the row relative to the group along x, m, the
    position of the group along y, m, the index on the floor of the first cell of
    ``row``, the distance of the group from the axle, m, and the side of a cell, m.
    ``rolled_m`` is the rolled distance, m, and ``sigma`` is the standard deviation of
    the noise, m.

    The first two loops have no branches, so that the processor computes several cells
    at once. They are separate, because numba would otherwise compute both cases of
    ``lasting`` for each cell.
    """
    free_until, hits, evidence, valid_until = piece
    (dx, sy, first, from_axle, cell), count = place, len(hits)
    half, end = cell * math.sqrt(0.5), begin + count
    ways, readings = row.way[begin:end], row.reading[begin:end]
    echoes, doubts = row.echo[begin:end], row.doubt[begin:end]
    distances = row.distance[begin:end]
    # Few cells have hits or evidence to change. The first loop finds them, and a few
    # more at the ends of echoes.
    for k in range(count):
        dy = (first + begin + k + 0.5) * cell - sy
        distance = math.sqrt(dx * dx + dy * dy)
        far, behind = distance + half, abs(distance - echoes[k])
        doubt = max(readings[k] - far, 1.001 * half - behind)
        doubts[k] = max(hits[k] if ways[k] >= far else doubt, evidence[k])
        distances[k] = distance
    # The cells that the newest readings alone have seen free.
    for k in range(count):
        distance = distances[k]
        free = (ways[k] >= distance + half) & (distance >= 2.0 * half)
        until = max(free_until[k], rolled_m + lasting(distance + from_axle, error))
        free_until[k] = until if free else free_until[k]
    for k in range(count):
        distance = distances[k]
        if doubts[k] <= 0.0 or distance < 2.0 * half:
            continue
        far, reading = distance + half, readings[k]
        free = ways[k] >= far
        # A reading that is too short leaves cells without evidence as they are.
        if not free and (reading > far or (evidence[k] > 0.0 and reading > -np.inf)):
            if evidence[k] == 0.0:
                valid_until[k] = np.inf
            z = (reading - far) / sigma
            evidence[k] = max(evidence[k] + z - 0.5, 0.0)
            until = rolled_m + lasting(distance + from_axle, error)
            valid_until[k] = until = min(valid_until[k], until)
            free = evidence[k] >= _EVIDENCE
            if free:
                free_until[k] = max(free_until[k], until)
        if free:
            hits[k], evidence[k] = 0.0, 0.0
        elif abs(distance - echoes[k]) <= half:
            hits[k] += min(1.0, _FULL_HIT_M / distance)


@register_jitable(inline="always")
def end_view(
    end: Any,
    time: float,
    pose: Any,
    place: Any,
    direction: Any,
    reach: float,
) -> None:  # pragma: no cover  (compiled)
    """Stores the arc at which the view of a sensor ends.

    Args:
        end: (6,) row of the sensor in ``FreeSpace.ends``, which the function fills.
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
