"""Shapes of bodies: boxes, discs, polygons, and walls along a line of points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.signals import read_only
from systems.world.plane import rotate

Floats = NDArray[np.float64]
Points = Sequence[tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Shape:
    """The region of the floor that a body covers, in the axes of the body.

    The region consists of rectangles, see ``systems.world.plane``. The edges of a
    polygon are rectangles without width. The inside of a polygon belongs to the region,
    too. Nothing gets there from outside without crossing an edge.
    """

    rectangles: Floats
    """(n, 6) x, y, theta, length, width, radius, in m and rad; read-only."""
    polygon: Floats | None = None
    """(k, 2) corners of a polygon, m. None: the rectangles are the whole region."""

    def __post_init__(self) -> None:
        read_only(self.rectangles)

    @cached_property
    def centered(self) -> bool:
        """Whether the shape is one rectangle with the pose of the body."""
        return len(self.rectangles) == 1 and not self.rectangles[0, :3].any()

    def at(self, poses: ArrayLike) -> Floats:
        """Returns the rectangles of the shape at one or more poses of the body.

        Args:
            poses: (3,) or (m, 3) poses x, y, theta of the body in any frame, m and rad.

        Returns:
            (n, 6) or (n, m, 6) rectangles in this frame, m and rad.
        """
        poses = np.asarray(poses, dtype=float)
        own = self.rectangles.reshape(-1, *[1] * (poses.ndim - 1), 6)
        found = np.empty((len(own), *poses.shape[:-1], 6))
        found[..., :3], found[..., 3:] = poses, own[..., 3:]
        if not self.centered:
            c, s = np.cos(poses[..., 2]), np.sin(poses[..., 2])
            found[..., 0] += c * own[..., 0] - s * own[..., 1]
            found[..., 1] += s * own[..., 0] + c * own[..., 1]
            found[..., 2] += own[..., 2]
        return found

    def fills(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Returns whether points are inside the polygon of the shape.

        Args:
            points: (..., 2) points in the axes of the body, m.

        Returns:
            (...) booleans, all false for a shape without a polygon.
        """
        x, y = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        inside = np.zeros(x.shape, dtype=bool)
        if self.polygon is None:
            return inside
        # Count the edges that a ray from the point along the x axis crosses.
        for (ax, ay), (bx, by) in zip(
            self.polygon, np.roll(self.polygon, -1, axis=0), strict=True
        ):
            if ay != by:
                crosses = (ay > y) != (by > y)
                inside ^= crosses & (x < ax + (y - ay) / (by - ay) * (bx - ax))
        return inside

    @cached_property
    def outlines(self) -> list[Floats]:
        """Closed outlines (k, 2) that together enclose the region, m.

        A round corner is a polygon with 12 sides per quarter of a turn.
        """
        if self.polygon is not None:
            return [self.polygon]
        return [rectangle_outline(row) for row in self.rectangles]

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least x, greatest x, least y and greatest y of the region, m."""
        points = np.concatenate(self.outlines)
        low, high = points.min(axis=0), points.max(axis=0)
        return float(low[0]), float(high[0]), float(low[1]), float(high[1])

    @property
    def middle(self) -> tuple[float, float]:
        """Place of a label: the middle of a polygon, or of the longest rectangle, m."""
        if self.polygon is not None:
            low_x, high_x, low_y, high_y = self.bounds
            return 0.5 * (low_x + high_x), 0.5 * (low_y + high_y)
        x, y = self.rectangles[np.argmax(self.rectangles[:, 3]), :2].tolist()
        return x, y


def rectangle_outline(rectangle: ArrayLike) -> Floats:
    """Returns the outline of a rectangle, counterclockwise from front left.

    Args:
        rectangle: (6,) x, y, theta, length, width, radius, in m and rad.

    Returns:
        (k, 2) points of the outline, m: the 4 corners, or 13 points per round corner.
    """
    x, y, theta, length, width, radius = np.asarray(rectangle, dtype=float)
    turns = np.linspace(0.0, 0.5 * math.pi, 13) if radius > 0.0 else np.zeros(1)
    u, v = [], []
    for k, (ahead, left) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angles = 0.5 * math.pi * k + turns
        u.append(0.5 * length * ahead + radius * np.cos(angles))
        v.append(0.5 * width * left + radius * np.sin(angles))
    along, across = rotate(theta, np.concatenate(u), np.concatenate(v))
    return np.column_stack([x + along, y + across])


def box(size: tuple[float, float]) -> Shape:
    """Returns a box of ``size`` (length, width), m, around the origin of the body."""
    return Shape(np.array([[0.0, 0.0, 0.0, *size, 0.0]]))


def disc(radius: float) -> Shape:
    """Returns a disc with a radius, m, around the origin of the body."""
    return Shape(np.array([[0.0, 0.0, 0.0, 0.0, 0.0, radius]]))


def wall(points: Points, thickness: float) -> Shape:
    """Returns a wall of a thickness, m, along a line through points of the body, m.

    The wall has round corners and ends: it covers all points within half of the
    thickness of the line.
    """
    line = np.array(points, dtype=float)
    return Shape(_edges(line[:-1], line[1:], 0.5 * thickness))


def polygon(points: Points) -> Shape:
    """Returns a filled polygon with corners at points of the body, m."""
    corners = np.array(points, dtype=float)
    return Shape(_edges(corners, np.roll(corners, -1, axis=0), 0.0), corners)


def _edges(begins: Floats, ends: Floats, radius: float) -> Floats:
    x, y = (0.5 * (begins + ends)).T
    dx, dy = (ends - begins).T
    nothing = np.zeros(len(x))
    thick = np.full(len(x), radius)
    along = np.hypot(dx, dy)
    return np.column_stack([x, y, np.arctan2(dy, dx), along, nothing, thick])


def repeated_point(points: Points) -> int | None:
    """Returns the index of the first point that equals the point before it, or None."""
    for k in range(1, len(points)):
        if math.dist(points[k - 1], points[k]) < 1e-9:
            return k
    return None


def crossing_edges(points: Points) -> tuple[int, int] | None:
    """Finds two edges of a polygon that touch, and do not just share a corner.

    Args:
        points: Corners of the polygon; no two consecutive ones are equal.

    Returns:
        Indices of the first corners of both edges, or None.
    """
    a = np.array(points, dtype=float)
    b, count = np.roll(a, -1, axis=0), len(points)

    def side(p: Any, q: Any, r: Any) -> Any:
        """1, 0, -1: the point r is to the left of, on, or right of the line p-q."""
        u, v = q - p, r - p
        return np.sign(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])

    for k in range(count):
        c, d, others = a[k + 1 :], b[k + 1 :], np.arange(k + 1, count)
        first, second = side(a[k], b[k], c), side(a[k], b[k], d)
        third, fourth = side(c, d, a[k]), side(c, d, b[k])
        low, high = np.minimum(a[k], b[k]), np.maximum(a[k], b[k])
        boxes = np.all((np.minimum(c, d) <= high) & (np.maximum(c, d) >= low), axis=1)
        meets = boxes & (first * second <= 0) & (third * fourth <= 0)
        # Neighbors share a corner. They overlap only if one folds back on the other.
        neighbors = (others == k + 1) | ((k == 0) & (others == count - 1))
        folds = (first == 0) & (second == 0) & (np.sum((b[k] - a[k]) * (d - c), 1) < 0)
        meets &= ~neighbors | folds
        if meets.any():
            return k, int(others[np.argmax(meets)])
    return None
