"""What range sensors see, how long it stays known, and how far a stop takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.base.parameters import OdometryParameters, PlantParameters
from systems.base.robot import RobotParameters, body_radius
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.parameters import FreeSpaceParameters, GuardParameters

#: Rims count as at rest if the lag leaves them no longer way than this, m.
REST_M = 2e-4
#: A robot turns on the spot if the lag leaves it no longer way forward than this, m.
IN_PLACE_M = 5e-5
#: Longest time between two positions that the guard compares with cells, s.
_PART_S = 0.025


class Sectors(NamedTuple):
    """Apertures of range sensors, cut into sectors where they overlap.

    A group consists of all sensors at one place. Its sectors are adjacent and in
    counterclockwise order. A sector between two apertures is seen by no sensor.
    """

    places: NDArray[np.float64]
    """(groups, 2) position relative to the axle in B, m."""
    first: NDArray[np.int64]
    """(groups + 1,) index of the first sector of each group, then the number of
    sectors."""
    right: NDArray[np.float64]
    """(sectors, 1) direction in B at which a sector begins, rad."""
    left: NDArray[np.float64]
    """(sectors, 1) direction in B at which a sector ends, rad."""
    seen_by: NDArray[np.bool_]
    """(sectors, sensors) whether a sensor sees a sector."""


class PlaceError(NamedTuple):
    """What the position error of a remembered cell depends on.

    The error is that of the position relative to the robot.
    """

    wheel_error: float
    """Relative error of each wheel's travel."""
    pulse_m: float
    """Way of the rim per pulse of the encoder, m; 0: angles are not rounded."""
    wheel_separation_m: float
    allowed_m: float
    """Largest position error of a cell that counts as free, m."""

    @classmethod
    def of(
        cls,
        known: FreeSpaceParameters,
        robot: RobotParameters,
        odometry: OdometryParameters,
    ) -> PlaceError:
        """Collects the values from the parameters.

        Args:
            known: Wheel error, and allowed position error.
            robot: Dimensions of the wheels.
            odometry: Pulses of the encoders.

        Returns:
            The collected values.
        """
        pulse_m = 0.0
        if odometry.rounding:
            pulse = math.tau / odometry.pulses_per_revolution
            pulse_m = robot.wheel_radius_m * pulse
        return cls(
            known.wheel_error, pulse_m, robot.wheel_separation_m, known.place_error_m
        )


def place_error(distance: float, way: float, error: PlaceError) -> float:
    """Computes the largest position error of a cell relative to the robot, m.

    Args:
        distance: Distance d of the cell from the axle when it was seen, m.
        way: Mean way s of both rims since then, m.
        error: Errors of wheels and encoders.

    Returns:
        The sum of two errors, m. Wheels with relative error e cause e s + 2 e s/L (d +
        s). Pulses of length q at the rim cause q (s + d)/L + q. L is the wheel
        separation (docs/guard.md).
    """
    e, pulse, separation = error.wheel_error, error.pulse_m, error.wheel_separation_m
    by_wheels = e * way + 2.0 * e * way / separation * (distance + way)
    return by_wheels + pulse * (way + distance) / separation + pulse


def lasting(distance: float, error: PlaceError) -> float:
    """Computes the mean way of both rims after which a cell is forgotten, m.

    Args:
        distance: Distance of the cell from the axle when it was seen, or more, m.
        error: Errors of wheels and encoders.

    Returns:
        The way at which ``place_error`` reaches the allowed error, m. It is infinite if
        the error does not grow, and minus infinity if it is too large from the start.
    """
    e, pulse, separation = error.wheel_error, error.pulse_m, error.wheel_separation_m
    a = 2.0 * e / separation
    b = e + a * distance + pulse / separation
    left = error.allowed_m - pulse * (1.0 + distance / separation)
    if left < 0.0:
        return -np.inf
    if b == 0.0:
        return np.inf
    if a == 0.0:
        return left / b
    return (math.sqrt(b * b + 4.0 * a * left) - b) / (2.0 * a)


def sensor_sectors(sensors: UltrasonicParameters, control_point_m: float) -> Sectors:
    """Divides the view of range sensors into sectors.

    Args:
        sensors: The range sensors.
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
    """Return the sectors between neighboring edges, from right to left.

    Edges that span more than a full turn are wrapped into one turn.
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
    """Computes an upper bound of the way of the faster wheel until it is at rest.

    The wheel begins at top speed, and brakes after one tick.

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


def tick_parts(tick_s: float) -> int:
    """Computes the number of parts of a tick after which positions are checked.

    Args:
        tick_s: Period of the command, s.

    Returns:
        The number. A part lasts at most 25 ms.
    """
    return math.ceil(tick_s / _PART_S - 1e-9)


def unseen_approach(
    robot: RobotParameters, plant: PlantParameters, tick_s: float
) -> float:
    """Computes how much nearer to a cell the axle may come than the guard checks, m.

    The guard compares the position of the axle with cells at the end of each part of a
    tick, until braking leaves the rims ``REST_M`` of way. Meanwhile the axle may

    * pass a corner: both ends of a chord d are at R from a point, but its middle is
      nearer;
    * deviate from the chord by a quarter of its length times the turn;
    * go on and come back, if the wheels are reversed within the part;
    * and coast after all that, also in a turn on the spot.

    Args:
        robot: Body, wheels and top speed.
        plant: Lag of the motors.
        tick_s: Period of the command, s.

    Returns:
        The sum of the four, m: 1.6 mm with all defaults. ``least_margin_m`` has to be
        at least as large.
    """
    top, lag, part_s = (
        robot.top_speed_m_s,
        plant.motor_lag_s,
        tick_s / tick_parts(tick_s),
    )
    radius, half = body_radius(robot), min(0.5 * top * part_s, body_radius(robot))
    corner = radius - math.sqrt(radius * radius - half * half)
    # The largest bow, for any distribution of the faster rim's speed between the
    # wheels.
    bow = 0.25 * (0.5 * top * part_s) * (top * part_s / robot.wheel_separation_m)
    # Speed at the start of the part from which the axle is back at its end, if the
    # command reverses to full speed.
    lagged_s = -lag * math.expm1(-part_s / lag)
    begin = min(top * (part_s / lagged_s - 1.0), top)
    turns_s = lag * math.log1p(begin / top)
    beyond = begin * lag - top * turns_s
    return corner + bow + beyond + REST_M + IN_PLACE_M
