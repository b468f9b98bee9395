"""What range sensors see, for how long it stays known, and how far a stop takes."""

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

#: Rims are at rest where their lag leaves them no longer way, m.
REST_M = 2e-4
#: A robot turns in its place where its lag leaves it no longer way ahead, m.
IN_PLACE_M = 5e-5
#: Longest time between two places that the guard compares with cells, s.
_PART_S = 0.025


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


class PlaceError(NamedTuple):
    """What the error of a remembered cell's place depends on, seen from the robot."""

    wheel_error: float
    """To what share each wheel's way is known."""
    pulse_m: float
    """Way of the rim for a pulse of the encoder, m; 0: angles are not rounded."""
    wheel_separation_m: float
    allowed_m: float
    """A cell counts as free as long as its error is no larger, m."""

    @classmethod
    def of(
        cls,
        known: FreeSpaceParameters,
        robot: RobotParameters,
        odometry: OdometryParameters,
    ) -> PlaceError:
        """From the parameters.

        Args:
            known: Wheel error, and what is allowed.
            robot: Wheels.
            odometry: Pulses of the encoders.

        Returns:
            What it depends on.
        """
        pulse_m = 0.0
        if odometry.rounding:
            pulse = math.tau / odometry.pulses_per_revolution
            pulse_m = robot.wheel_radius_m * pulse
        return cls(
            known.wheel_error, pulse_m, robot.wheel_separation_m, known.place_error_m
        )


def place_error(distance: float, way: float, error: PlaceError) -> float:
    """Largest error of a cell's place relative to the robot, m.

    Args:
        distance: Of the cell from the axle when it was seen, m.
        way: Mean way of both rims since then, m.
        error: What it depends on.

    Returns:
        e s + 2 e s/L (d + s) by wheels known to a share e, and q (s + d)/L + q by
        pulses of q at the rim, L between the wheels (docs/guard.md).
    """
    e, pulse, separation = error.wheel_error, error.pulse_m, error.wheel_separation_m
    by_wheels = e * way + 2.0 * e * way / separation * (distance + way)
    return by_wheels + pulse * (way + distance) / separation + pulse


def lasting(distance: float, error: PlaceError) -> float:
    """Mean way of both rims for which a cell's place stays known well enough, m.

    Args:
        distance: Of the cell from the axle when it was seen, m, or more.
        error: What its error depends on.

    Returns:
        The way at which ``place_error`` is what is allowed, m; infinite where it does
        not grow, minus infinity where it is too large from the start.
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


def tick_parts(tick_s: float) -> int:
    """In how many parts of a tick the guard compares places with cells.

    Args:
        tick_s: Period of the command, s.

    Returns:
        The number; a part lasts 25 ms at most.
    """
    return math.ceil(tick_s / _PART_S - 1e-9)


def unseen_approach(
    robot: RobotParameters, plant: PlantParameters, tick_s: float
) -> float:
    """By how much the axle may come nearer to a cell than where the guard looks, m.

    The guard compares the axle's place with cells at the ends of a tick's parts, until
    braking leaves the rims ``REST_M`` of way. In between the axle may

    * pass a corner: both ends of a chord d are R from a point, its middle is not;
    * leave the chord, by a quarter of its length times the turn;
    * go on and come back, where the wheels are reversed within the part;
    * and coast after all that, also where it turns in its place.

    Args:
        robot: Body, wheels and top speed.
        plant: Lag of the motors.
        tick_s: Period of the command, s.

    Returns:
        The sum of the four, m: 1.6 mm with all defaults. ``least_margin_m`` has to hold
        it.
    """
    top, lag, part_s = (
        robot.top_speed_m_s,
        plant.motor_lag_s,
        tick_s / tick_parts(tick_s),
    )
    radius, half = body_radius(robot), min(0.5 * top * part_s, body_radius(robot))
    corner = radius - math.sqrt(radius * radius - half * half)
    # Of all ways to share the faster rim's speed between both.
    bow = 0.25 * (0.5 * top * part_s) * (top * part_s / robot.wheel_separation_m)
    # The speed with which it comes back to where it was, reversed to full speed.
    lagged_s = -lag * math.expm1(-part_s / lag)
    begin = min(top * (part_s / lagged_s - 1.0), top)
    turns_s = lag * math.log1p(begin / top)
    beyond = begin * lag - top * turns_s
    return corner + bow + beyond + REST_M + IN_PLACE_M
