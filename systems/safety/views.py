"""What range sensors see, for how long it stays known, and how far a stop takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.parameters import GuardParameters

__all__ = [
    "Sectors",
    "lasting",
    "sensor_sectors",
    "stopping_way",
]


class Sectors(NamedTuple):
    """Apertures of range sensors, cut where they overlap: directions from one place.

    A group is all sensors at one place. Its sectors are next to one another, counter-
    clockwise; where no sensor looks in between, one has none.
    """

    places: NDArray[np.float64]
    """(groups, 2) from the axle in B, m."""
    first: NDArray[np.int64]
    """(groups + 1,) first sector of each group, and the number of all."""
    right: NDArray[np.float64]
    """(sectors, 1) directions in B at which they begin, rad."""
    left: NDArray[np.float64]
    """(sectors, 1) where they end, rad."""
    seen_by: NDArray[np.bool_]
    """(sectors, sensors) which sensors see a sector."""


def lasting(distance: float, drift: Any) -> float:
    """Way for which a cell's place stays known well enough, m.

    If each wheel's way is known to a share e, then after a way s the place of a cell
    that was d away is off by e s + 2 e s/L (d + s) at most, L between the wheels: the
    error of the way, and that of the heading times the distance.

    Args:
        distance: Of the cell from the axle when it was seen, m, or more.
        drift: (wheel error e, allowed error of the place, m, wheel separation L, m).

    Returns:
        m; infinite without wheel errors.
    """
    error, allowed, separation = drift
    if error == 0.0:
        return np.inf
    a = 2.0 * error / separation
    b = error + a * distance
    return (math.sqrt(b * b + 4.0 * a * allowed) - b) / (2.0 * a)


def sensor_sectors(sensors: UltrasonicParameters, control_point_m: float) -> Sectors:
    """What a set of range sensors sees, as sectors of common places.

    Args:
        sensors: Any.
        control_point_m: Distance of P ahead of the axle, m.

    Returns:
        The sectors.
    """
    half = math.radians(sensors.beam_half_angle_deg)
    places: dict[tuple[float, float], list[int]] = {}
    for k, place in enumerate(sensors.places):
        places.setdefault(place, []).append(k)
    first, right, left, seen_by = [0], [], [], []
    for members in places.values():
        spans = [(sensors.axes[k] - half, sensors.axes[k] + half) for k in members]
        for a, b in _between(spans):
            middle = 0.5 * (a + b)
            right.append(a)
            left.append(b)
            seen = np.zeros(sensors.count, dtype=bool)
            for k, (low, high) in zip(members, spans, strict=True):
                seen[k] = any(low < middle + t < high for t in (-math.tau, 0, math.tau))
            seen_by.append(seen)
        first.append(len(right))
    ahead = np.array([[control_point_m + x, y] for x, y in places])
    columns = np.reshape(right, (-1, 1)), np.reshape(left, (-1, 1))
    return Sectors(ahead, np.array(first), *columns, np.array(seen_by))


def _between(
    spans: Sequence[tuple[float, float]],
) -> list[tuple[float, float]]:
    """Sectors between neighbouring edges, from right to left; at most a turn."""
    edges = sorted(edge for span in spans for edge in span)
    if edges[-1] - edges[0] >= math.tau - 1e-9:
        begin = edges[0]
        edges = sorted(begin + (edge - begin) % math.tau for edge in edges)
        edges.append(begin + math.tau)
    return [(a, b) for a, b in pairwise(edges) if b - a > 1e-9]


def stopping_way(
    own: GuardParameters, robot: RobotParameters, plant: PlantParameters, tick_s: float
) -> float:
    """Way of the faster wheel from top speed to rest, after a tick of it, or more.

    Args:
        own: Braking.
        robot: Top speed.
        plant: Lag of the motors.
        tick_s: Period of the command, s.

    Returns:
        m.
    """
    top = robot.top_speed_m_s
    delayed = plant.motor_lag_s + 2.0 * tick_s
    return top * top / (2.0 * own.braking_m_s2) + top * delayed
