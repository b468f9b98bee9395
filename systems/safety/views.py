"""Views of range sensors, errors of remembered positions, and stopping distances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters, body_radius
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.parameters import MARGIN_M, GuardParameters

#: The rims of the wheels count as at rest if the lag of the motors will move them by
#: less than this distance, m.
REST_M = 2e-4
#: A robot turns on the spot if the lag of the motors will move its axle by less than
#: this distance, m.
IN_PLACE_M = 5e-5
# ``RANGE_MARGIN_M``: largest amount by which a range without noise is too long, m.
# ``_SIGMAS``: number of standard deviations that bounds the noise of a range.
RANGE_MARGIN_M, _SIGMAS = 0.002, 5.0
#: Longest time between two positions that the guard checks against cells, s.
_PART_S = 0.025


class Sectors(NamedTuple):
    """Sectors into which the edges of the apertures divide the view of range sensors.

    All sensors at the same position form a group. The sectors of a group are adjacent
    and in counterclockwise order. In a gap between two apertures, there is a sector
    that no sensor sees.
    """

    places: NDArray[np.float64]
    """(groups, 2) position relative to the axle in B, m."""
    first: NDArray[np.int64]
    """(groups + 1,) index of the first sector of each group. The last element is the
    number of all sectors.
    """
    right: NDArray[np.float64]
    """(sectors, 1) direction in B at which a sector begins, rad."""
    left: NDArray[np.float64]
    """(sectors, 1) direction in B at which a sector ends, rad."""
    seen_by: NDArray[np.bool_]
    """(sectors, sensors) whether a sensor sees a sector."""
    pairs: NDArray[np.int64]
    """(pairs, 2) sector and sensor, for each sensor that sees a sector, by sector."""


class PlaceError(NamedTuple):
    """Quantities that determine the position error of a remembered cell.

    The error is that of the position of the cell relative to the robot.
    """

    wheel_error: float
    """Relative error of each wheel's travel."""
    pulse_m: float
    """Distance that the rim rolls per pulse of the encoder, m; 0 if angles are not
    rounded.
    """
    wheel_separation_m: float
    allowed_m: float
    """Largest position error of a cell that counts as free, m."""

    @classmethod
    def of(
        cls,
        guard: GuardParameters,
        robot: RobotParameters,
        plant: PlantParameters,
    ) -> PlaceError:
        """Collects the quantities from the parameters.

        ``guard`` has the wheel error and the allowed position error. ``robot`` has the
        dimensions of the wheels. ``plant`` has the pulses of the encoders.
        """
        pulse_m = 0.0
        if plant.pulses_per_revolution is not None:
            pulse = math.tau / plant.pulses_per_revolution
            pulse_m = robot.wheel_radius_m * pulse
        return cls(
            guard.wheel_error, pulse_m, robot.wheel_separation_m, guard.place_error_m
        )


def place_error(distance: float, way: float, error: PlaceError) -> float:
    """Computes the largest position error of a remembered cell relative to the robot.

    The error is the sum of two parts (docs/guard.md):

    - Wheels with the relative error e cause the part e s + 2 e s/L (d + s).
    - Encoder pulses of the length q at the rim cause the part q (s + d)/L + q.

    L is the wheel separation.

    Args:
        distance: Distance d from the axle to the cell when a sensor saw the cell, m.
        way: Mean distance s that the rims of both wheels have rolled since then, m.
        error: Errors of wheels and encoders.

    Returns:
        Largest position error, m.
    """
    e, pulse, separation = error.wheel_error, error.pulse_m, error.wheel_separation_m
    by_wheels = e * way + 2.0 * e * way / separation * (distance + way)
    return by_wheels + pulse * (way + distance) / separation + pulse


def lasting(distance: float, error: PlaceError) -> float:
    """Computes how far the wheels may roll before a remembered cell is forgotten.

    A cell is forgotten when ``place_error`` reaches the allowed error.

    Args:
        distance: Distance from the axle to the cell when a sensor saw the cell, or an
            upper bound of this distance, m.
        error: Errors of wheels and encoders.

    Returns:
        Mean distance that both wheel rims roll, m. It is infinite if the error does not
        grow, and minus infinity if the error is too large from the start.
    """
    e, pulse, separation = error.wheel_error, error.pulse_m, error.wheel_separation_m
    # The map computes this for many cells, and divides only by what differs.
    a, per_meter = 2.0 * e / separation, pulse / separation
    b = e + a * distance + per_meter
    left = error.allowed_m - pulse - per_meter * distance
    if left < 0.0:
        return -np.inf
    if b == 0.0:
        return np.inf
    if a == 0.0:
        return left / b
    return (math.sqrt(b * b + 4.0 * a * left) - b) / (2.0 * a)


def range_errors(sensors: UltrasonicParameters) -> NDArray[np.float64]:
    """Computes by how much the range of each sensor can be too long.

    The result has the shape (sensors,), m.
    """
    return RANGE_MARGIN_M + _SIGMAS * sensors.each("noise_m")


def sensor_sectors(sensors: UltrasonicParameters, control_point_m: float) -> Sectors:
    """Divides the view of range sensors into sectors.

    ``control_point_m`` is the distance of the control point P ahead of the axle, m.
    """
    axes, halves = sensors.axes, sensors.half_angles
    places: dict[tuple[float, float], list[int]] = {}
    for k, place in enumerate(sensors.places):
        places.setdefault(place, []).append(k)
    first, right, left, seen_by = [0], [], [], []
    for members in places.values():
        spans = [(axes[k] - halves[k], axes[k] + halves[k]) for k in members]
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
    pairs = np.argwhere(seen_by)
    return Sectors(ahead, np.array(first), *columns, np.array(seen_by), pairs)


def _between(
    spans: Sequence[tuple[float, float]],
) -> list[tuple[float, float]]:
    """Returns the sectors between neighboring edges of apertures, from right to left.

    If the edges span more than a full turn, the function first wraps the edges into one
    turn.
    """
    edges = sorted(edge for span in spans for edge in span)
    if edges[-1] - edges[0] >= math.tau - 1e-9:
        begin = edges[0]
        edges = sorted(begin + (edge - begin) % math.tau for edge in edges)
        edges.append(begin + math.tau)
    return [(a, b) for a, b in pairwise(edges) if b - a > 1e-9]


def stopping_way(
    own: GuardParameters, robot: RobotParameters, plant: PlantParameters, tick_s: float
) -> float:
    """Computes an upper bound of the stopping distance of the faster wheel.

    The wheel starts at top speed, and brakes after one control period.

    Args:
        own: Parameters of the guard, for the deceleration.
        robot: Parameters of the robot, for the top speed.
        plant: Lag of the motors.
        tick_s: Control period, s.

    Returns:
        Distance that the rim of the wheel covers until the wheel is at rest, m.
    """
    top = robot.top_speed_m_s
    delayed = plant.motor_lag_s + 2.0 * tick_s
    return top * top / (2.0 * own.braking_m_s2) + top * delayed


def checked_reach(
    own: GuardParameters, robot: RobotParameters, plant: PlantParameters, tick_s: float
) -> float:
    """Computes the distance from the axle within which the guard checks cells, m.

    The arguments are those of ``stopping_way``.
    """
    stopping = stopping_way(own, robot, plant, tick_s)
    keep = own.place_error_m + MARGIN_M
    return body_radius(robot) + keep + stopping + 2.0 * own.cell_m


def tick_parts(tick_s: float) -> int:
    """Computes the number of parts into which the guard divides a control period.

    The guard checks the position of the robot at the end of each part. A part lasts at
    most 25 ms. ``tick_s`` is the control period, s.
    """
    return math.ceil(tick_s / _PART_S - 1e-9)


def unseen_approach(robot: RobotParameters) -> float:
    """Computes how far the outline may move after the guard's last check, m.

    The guard makes no further check when the wheel rims will move by less than
    ``REST_M``. A point of the outline may be farther from the axle than a wheel, and
    then it moves more than the rims.

    Args:
        robot: Body and wheels.

    Returns:
        Largest distance, m; 0.44 mm with all defaults. ``LEAST_MARGIN_M`` has to be
        larger.
    """
    lever = 2.0 * body_radius(robot) / robot.wheel_separation_m
    return REST_M * max(1.0, lever)
