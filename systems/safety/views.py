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
from systems.safety.parameters import GuardParameters

#: The rims of the wheels count as at rest if they will move by less than this, m, due
#: to the lag.
REST_M = 2e-4
#: A robot turns on the spot if its axle will move by less than this, m, due to the lag.
IN_PLACE_M = 5e-5
#: Largest amount, m, by which a range without noise is too long, and number of standard
#: deviations that bounds the noise of a range.
RANGE_MARGIN_M, _SIGMAS = 0.002, 5.0
#: Longest time between two positions that the guard compares with cells, s.
_PART_S = 0.025


class Sectors(NamedTuple):
    """Apertures of range sensors, cut into sectors where they overlap.

    A group consists of all sensors at one place. Its sectors are adjacent and in
    counterclockwise order. No sensor sees a sector between two apertures.
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
    """Quantities that determine the position error of a remembered cell.

    The position of the cell is relative to the robot.
    """

    wheel_error: float
    """Relative error of each wheel's travel."""
    pulse_m: float
    """Way of the rim per pulse of the encoder, m. It is 0 if angles are not rounded."""
    wheel_separation_m: float
    allowed_m: float
    """Largest position error of a cell that counts as free, m."""

    @classmethod
    def of(
        cls,
        guard: GuardParameters,
        robot: RobotParameters,
        odometry: OdometryParameters,
    ) -> PlaceError:
        """Collects the values from the parameters.

        Args:
            guard: Wheel error, and allowed position error.
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
            guard.wheel_error, pulse_m, robot.wheel_separation_m, guard.place_error_m
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
        distance: Distance of the cell from the axle when it was seen, m, or an upper
            bound of this distance.
        error: Errors of wheels and encoders.

    Returns:
        The way at which ``place_error`` reaches the allowed error, m. The way is
        infinite if the error does not grow. It is minus infinity if the error is too
        large from the start.
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


def range_errors(sensors: UltrasonicParameters) -> NDArray[np.float64]:
    """(n,) largest amounts by which the ranges of each sensor are too long, m."""
    return RANGE_MARGIN_M + _SIGMAS * sensors.each("noise_m")


def sensor_sectors(sensors: UltrasonicParameters, control_point_m: float) -> Sectors:
    """Divides the view of range sensors into sectors.

    Args:
        sensors: The range sensors.
        control_point_m: Distance of P ahead of the axle, m.

    Returns:
        The sectors.
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
    """Computes the number of parts into which the guard divides a tick.

    Args:
        tick_s: Period of the command, s.

    Returns:
        Number of parts. A part lasts at most 25 ms. The guard checks the position at
        the end of each part.
    """
    return math.ceil(tick_s / _PART_S - 1e-9)


def unseen_approach(
    robot: RobotParameters, plant: PlantParameters, tick_s: float
) -> float:
    """Computes by how much the axle may come nearer to a cell than the guard sees, m.

    The guard compares the position of the axle with cells at the end of each part of a
    tick, until the rims will move by less than ``REST_M``. Between and after these
    checks, four effects may bring the axle nearer to a cell:

    * The axle passes a corner of a cell. Both ends of the chord of its path are at the
      radius of the body from the corner, but the middle of the chord is nearer.
    * The path deviates from the chord by a quarter of the chord's length times the
      turn.
    * The axle goes on and comes back if the wheels reverse within the part.
    * The axle coasts after the last check. It may also coast in a turn on the spot.

    Args:
        robot: Body, wheels and top speed.
        plant: Lag of the motors.
        tick_s: Period of the command, s.

    Returns:
        Sum of the four effects, m. It is 1.6 mm with all defaults. ``LEAST_MARGIN_M``
        has to be at least as large as this sum.
    """
    top, lag, part_s = (
        robot.top_speed_m_s,
        plant.motor_lag_s,
        tick_s / tick_parts(tick_s),
    )
    radius, half = body_radius(robot), min(0.5 * top * part_s, body_radius(robot))
    corner = radius - math.sqrt(radius * radius - half * half)
    # The largest deviation of the path from its chord. It occurs if half of the rim's
    # top speed drives the axle forward, and the other half turns the robot.
    bow = 0.25 * (0.5 * top * part_s) * (top * part_s / robot.wheel_separation_m)
    # Speed at the start of the part, if the command reverses to full speed and the axle
    # is back at its starting point at the end of the part.
    lagged_s = -lag * math.expm1(-part_s / lag)
    begin = min(top * (part_s / lagged_s - 1.0), top)
    turns_s = lag * math.log1p(begin / top)
    beyond = begin * lag - top * turns_s
    return corner + bow + beyond + REST_M + IN_PLACE_M
