"""Looks: readings of range sensors, with the position and direction of the sensor."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.turning import wrapped
from systems.safety.free_space import FreeSpace, cell_is_free

#: Number of looks per sensor that are kept.
_LOOKS = 3
# ``_ARC_STEP``: spacing of the points at which an arc is checked, cells.
# ``_BEHIND``: distance behind the arc up to which the points reach, cells.
_ARC_STEP, _BEHIND = 0.3, 0.6
# ``_FASTEST_M_S``: a range that changes faster than this belongs to another body, m/s.
# ``_OLDEST_TICKS``: a look that is older than this is not compared with the next look,
#   ticks.
_FASTEST_M_S, _OLDEST_TICKS = 2.0, 4.5


class HazardSensors(NamedTuple):
    """Properties of the sensors on which looks and tracks depend."""

    places: NDArray[np.float64]
    """(sensors, 2) position relative to the axle in B, m."""
    directions: NDArray[np.float64]
    """(sensors, 2) direction of the axis in B and half of the aperture, rad."""
    farthest_m: NDArray[np.float64]
    """(sensors,) greatest range, m."""
    margin_m: NDArray[np.float64]
    """(sensors,) largest error of a range, m."""
    noise_m: NDArray[np.float64]
    """(sensors,) standard deviation of a range, m."""
    tick_s: float


class Look(NamedTuple):
    """One reading of one range sensor, with the position and direction of the sensor.

    The fields of a single look are numbers. In the memory of all sensors, the fields
    are arrays of the shape (3, sensors), most recent look first.
    """

    range_m: Any
    heard: Any
    """1 if there was an echo, else 0."""
    time_s: Any
    """Time of the reading, s. Minus infinity means that there was no reading yet."""
    x: Any
    """Position of the sensor, x in the world frame W, m."""
    y: Any
    """Position of the sensor, y in W, m."""
    axis_rad: Any
    """Direction of the sensor's axis in W, rad."""


def make_looks(sensors: int) -> Look:
    """Makes an empty memory for the readings of ``sensors`` range sensors."""
    looks = Look(*(np.zeros((_LOOKS, sensors)) for _ in Look._fields))
    looks.time_s[:] = -np.inf
    return looks


@njit(cache=True)
def look_of(looks: Look, age: int, k: int) -> Look:  # pragma: no cover  (compiled)
    """Reads one look of sensor ``k`` from the memory; its fields are numbers.

    ``age`` is the index of the look: 0 is the newest look, 2 the oldest.
    """
    at = age, k
    return Look(
        looks.range_m[at],
        looks.heard[at],
        looks.time_s[at],
        looks.x[at],
        looks.y[at],
        looks.axis_rad[at],
    )


@njit(cache=True)
def remember_looks(
    looks: Look, time: float, pose: Any, readings: Any, sensors: HazardSensors
) -> None:  # pragma: no cover  (compiled)
    """Stores the readings of the sensors that have fired in this control period.

    Args:
        looks: Looks of all sensors. The function changes the arrays in place.
        time: Current time, s.
        pose: Pose (x, y, theta) of the robot, m and rad.
        readings: Three values per sensor: range, m; echo, 0 or 1; and age of the
            reading, s.
        sensors: Properties of the sensors.
    """
    ranges, echo, ages = readings
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(len(ranges)):
        if ages[k] > 0.5 * sensors.tick_s:
            continue
        for values in looks:
            for age in range(_LOOKS - 1, 0, -1):
                values[age, k] = values[age - 1, k]
        ahead, aside = sensors.places[k]
        looks.range_m[0, k], looks.heard[0, k] = ranges[k], echo[k]
        looks.time_s[0, k] = time
        looks.x[0, k] = pose[0] + c * ahead - s * aside
        looks.y[0, k] = pose[1] + s * ahead + c * aside
        looks.axis_rad[0, k] = pose[2] + sensors.directions[k, 0]


@njit(cache=True)
def seen_from(
    look: Look, x: float, y: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Returns the distance of a place, m, and its angle off the sensor's axis, rad."""
    dx, dy = x - look.x, y - look.y
    return math.hypot(dx, dy), abs(wrapped(math.atan2(dy, dx) - look.axis_rad))


@njit(cache=True)
def is_target(
    look: Look, half: float, target: Any
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether the echo of a look may come from the followed target.

    ``half`` is half of the sensor's aperture, rad. ``target`` is the position (x, y)
    and radius of the target, m.
    """
    distance, off = seen_from(look, target[0], target[1])
    beside = off - half < target[2] / max(distance, target[2])
    return beside and abs(distance - look.range_m) < target[2]


@njit(cache=True)
def goes_on(
    look: Look, then: Look, tick_s: float
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether an echo fits the previous look of the same sensor.

    The range rate is known only if the echo fits. ``look`` is the newest look, and
    ``then`` is the previous look.
    """
    since = look.time_s - then.time_s
    if then.heard < 0.5 or since > _OLDEST_TICKS * tick_s:
        return False
    return abs(look.range_m - then.range_m) < _FASTEST_M_S * since


@njit(cache=True)
def came_from_free(
    space: FreeSpace, look: Look, half: float, margin_m: float
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether the whole arc of an echo was seen free before.

    The arc contains all points from which the echo may come. It is as wide as the
    aperture. It extends from the range minus the largest range error to the range plus
    this error and a part of a cell. The cells of all these points must still count as
    free.

    Args:
        space: Cells that were seen free.
        look: Look with the echo.
        half: Half of the sensor's aperture, rad.
        margin_m: Largest range error, m.

    Returns:
        True if the whole arc was seen free.
    """
    cell = space.cell_m
    step_m = _ARC_STEP * cell
    across = max(8, math.ceil(2.0 * half * look.range_m / step_m))
    along = math.ceil((2.0 * margin_m + _BEHIND * cell) / step_m)
    for one in range(across + 1):
        angle = look.axis_rad + half * (2.0 * one / across - 1.0)
        for other in range(along + 1):
            at = look.range_m - margin_m + other * step_m
            i = math.floor((look.x + at * math.cos(angle)) / cell)
            j = math.floor((look.y + at * math.sin(angle)) / cell)
            # The position of a forgotten cell is no longer known.
            if not cell_is_free(space, i, j, space.rolled_m[0]):
                return False
    return True
