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
    falls below 1, a new one begins.

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
        for i in range(low_i + (turn - low_i) % _ROWS, high_i + 1, _ROWS):
            dx = (i + 0.5) * cell - sx
            for j in range(low_j, high_j + 1):
                dy = (j + 0.5) * cell - sy
                squared = dx * dx + dy * dy
                if squared > (farthest + half) ** 2 or squared < 4.0 * half * half:
                    continue
                distance = math.sqrt(squared)
                # Bearing of the cell from the right edge of the group.
                bearing = (math.atan2(dy, dx) - pose[2] - right) % math.tau
                far = distance + half
                free, echo, z = _in_direction(
                    bearing, math.asin(half / distance), sectors, seen, begin, end, far
                )
                at = i % cells, j % cells
                until = space.rolled_m[0] + lasting(distance + from_axle, error)
                if free < far and z > -np.inf:
                    until = _weigh(space, at, z, until)
                    if space.evidence[at] >= _EVIDENCE:
                        free = far
                if free >= far:
                    space.free_until[at] = max(space.free_until[at], until)
                    space.seen_s[at] = time
                    space.hits[at], space.evidence[at] = 0.0, 0.0
                elif abs(distance - echo) <= half:
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
        can change; and the reading and the noise of the
        first sensor, minus infinity and 1 without a new reading or without noise.
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
def _in_direction(
    bearing: float,
    hides: float,
    sectors: Sectors,
    seen: Any,
    begin: int,
    end: int,
    far: float,
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Returns how far a group of sensors has seen toward a cell.

    ``bearing`` is the angle from the right edge of the group's view to the middle of
    the cell, rad. The circle around the cell covers ``bearing`` plus and minus
    ``hides``, rad.
    The distance seen free is the least distance of all sectors that overlap the circle.
    It is 0 if a part of the circle is out of view. The echo is that of the sector that
    contains the middle of the cell. ``far`` is the distance of the far side of the
    circle, m.

    Returns:
        Distance seen free, m; distance of the echo, m, infinite without an echo; and
        least difference of a reading and ``far``, in standard deviations, minus
        infinity if a sector has no new reading.
    """
    right = sectors.right[begin, 0]
    span = sectors.left[end - 1, 0] - right
    around = span > math.tau - 1e-9
    low, high = bearing - hides, bearing + hides
    if not around and (low < 0.0 or high > span):
        return 0.0, np.inf, -np.inf
    free, echo, z = np.inf, np.inf, np.inf
    for k in range(begin, end):
        a, b = sectors.right[k, 0] - right, sectors.left[k, 0] - right
        # In a full circle, the angle may overlap the sector across the right edge.
        beyond = around and (a < high - math.tau or b > low + math.tau)
        if beyond or (a < high and b > low):
            free = min(free, seen[k, 0])
            z = min(z, (seen[k, 3] - far) / seen[k, 4])
            if a <= bearing < b:
                echo = seen[k, 1]
    return free, echo, z


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
