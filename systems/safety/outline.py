"""Distances between the outline of a robot's body and the cells of the map.

The outline is a rectangle around the axle. It lies inside the disc around the axle that
contains its corners. The *lane* of the robot is the part of this disc that is not
farther to the side than the outline: the outline, and the two caps of the disc in front
of it and behind it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters, body_radius
from systems.framework.compiling import njit

# Least length of a long body, as a multiple of its width.
_LONG = 1.5
#: Outward speed of a point of the outline that counts as 0, m/s.
_STILL_M_S = 1e-6


class Outline(NamedTuple):
    """Outline of a body: a rectangle whose middle is the middle of the axle."""

    half_length_m: float
    half_width_m: float
    radius_m: float
    """Radius of the disc around the axle that contains the outline, m."""

    @classmethod
    def of(cls, robot: RobotParameters) -> Outline:
        """Returns the outline of a robot."""
        return cls(0.5 * robot.length_m, 0.5 * robot.width_m, body_radius(robot))


@register_jitable
def is_long(outline: Outline) -> bool:
    """Checks whether the disc around the body is much wider than the body."""
    return outline.half_length_m >= _LONG * outline.half_width_m


class Frame(NamedTuple):
    """A pose of the body with numbers that do not depend on the cell."""

    x: float
    y: float
    cosine: float
    sine: float
    half_cell_m: float
    """Half of the extent of a cell along the axes of the body, m."""


@register_jitable
def frame_at(pose: Any, cell_m: float) -> Frame:
    """Computes the ``Frame`` of a pose (x, y, theta), m and rad."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return Frame(pose[0], pose[1], c, s, 0.5 * cell_m * (abs(c) + abs(s)))


@register_jitable
def in_body(corner: Any, cell_m: float, frame: Frame) -> tuple[float, float]:
    """Computes the middle of a cell in the axes of the body, m.

    ``corner`` is the corner of the cell with least x and least y, m.
    """
    dx, dy = corner[0] + 0.5 * cell_m - frame.x, corner[1] + 0.5 * cell_m - frame.y
    return (
        frame.cosine * dx + frame.sine * dy,
        frame.cosine * dy - frame.sine * dx,
    )


@register_jitable
def gaps(
    corner: Any, cell_m: float, frame: Frame, outline: Outline
) -> tuple[float, float, float]:
    """Computes three distances, each of which separates a cell from the outline.

    The distance of the cell from the outline is at least the largest of the three. It
    is at least the larger of the first two from the lane.

    Args:
        corner: Corner of the cell with least x and least y, m.
        cell_m: Side of the cell, m.
        frame: Pose of the body.
        outline: Outline of the body.

    Returns:
        Distances from the disc, from the strip between the two sides of the outline,
        and from the strip between its two ends, m. A distance is negative if the cell
        reaches into the disc or the strip.
    """
    dx = max(corner[0] - frame.x, 0.0, frame.x - corner[0] - cell_m)
    dy = max(corner[1] - frame.y, 0.0, frame.y - corner[1] - cell_m)
    u, v = in_body(corner, cell_m, frame)
    return (
        math.sqrt(dx * dx + dy * dy) - outline.radius_m,
        abs(v) - frame.half_cell_m - outline.half_width_m,
        abs(u) - frame.half_cell_m - outline.half_length_m,
    )


@register_jitable
def least_between(begin: float, end: float, dip: float) -> float:
    """Computes a lower bound of a distance between two times.

    Args:
        begin: Distance at the first time, m.
        end: Distance at the second time, m.
        dip: Largest absolute second derivative of the distance, times the square of
            the time between, divided by 8, m.

    Returns:
        Least value of the parabola with this second derivative through both distances,
        m.
    """
    least, change = min(begin, end), abs(end - begin)
    if change < 4.0 * dip:
        least -= (4.0 * dip - change) ** 2 / (16.0 * dip)
    return least


@njit(cache=True)
def enters(
    corner: Any,
    cell_m: float,
    frame: Frame,
    twist: Any,
    outline: Outline,
    near: tuple[float, float],
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether a cell may enter the outline, or come nearer if it is near.

    A point of the cell comes nearer only if the nearest point of the outline moves
    outward. The function checks the parts of the four sides that are next to the cell.
    Points of the cell that are under the body are no obstacle and do not count.

    Args:
        corner: Corner of the cell with least x and least y, m.
        cell_m: Side of the cell, m.
        frame: Pose of the body.
        twist: Forward speed, m/s, and yaw rate, rad/s.
        outline: Outline of the body.
        near: The cell is near if it is within the first of these distances of the
            axle, along the body, and within the second across it, m.

    Returns:
        True if a part of a side next to the cell moves outward.
    """
    u, v = in_body(corner, cell_m, frame)
    half, (speed, turn) = frame.half_cell_m, twist
    length, width = outline.half_length_m, outline.half_width_m
    if abs(u) - half >= near[0] or abs(v) - half >= near[1]:
        return False
    # Part of the front and rear, from right to left, and of the sides, from rear to
    # front.
    right, left = _between(v - half, width), _between(v + half, width)
    rear, front = _between(u - half, length), _between(u + half, length)
    ahead = max(speed - turn * right, speed - turn * left)
    back = max(turn * right - speed, turn * left - speed)
    aside = max(turn * rear, turn * front)
    across = max(-turn * rear, -turn * front)
    return (
        (u + half > length and ahead > _STILL_M_S)
        or (u - half < -length and back > _STILL_M_S)
        or (v + half > width and aside > _STILL_M_S)
        or (v - half < -width and across > _STILL_M_S)
    )


@register_jitable
def _between(value: float, limit: float) -> float:
    """Limits a value to the range from -``limit`` to ``limit``."""
    return min(max(value, -limit), limit)
