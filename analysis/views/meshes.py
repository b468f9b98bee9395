"""Makes meshes of triangles for a replay: bands, arrows, stars and prisms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Mesh(NamedTuple):
    """A surface of triangles."""

    vertices: NDArray[np.float64]
    """(3, n) points x, y, z, m."""
    faces: NDArray[np.int32]
    """(3, m) indices of the three points of each triangle."""


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Joins meshes to one mesh."""
    begins = np.cumsum([0, *(mesh.vertices.shape[1] for mesh in meshes)])
    faces = [mesh.faces + begin for mesh, begin in zip(meshes, begins, strict=False)]
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes], axis=1),
        np.concatenate(faces, axis=1).astype(np.int32),
    )


def ribbon(points: ArrayLike, z: float, width: float) -> Mesh:
    """Makes a flat band along the (n, 2) ``points``, m.

    The band is at the height z, m, and has the given width, m. It replaces a line,
    because most browsers draw lines only one pixel wide.
    """
    middle = np.asarray(points, dtype=float)
    along = np.gradient(middle, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    aside = 0.5 * width * np.column_stack([-along[:, 1], along[:, 0]])
    edges = np.concatenate([middle + aside, middle - aside]).T
    n = len(middle)
    left, right = np.arange(n - 1), n + np.arange(n - 1)
    faces = np.hstack([[left, right, right + 1], [left, right + 1, left + 1]])
    return Mesh(_at_height(edges, z), faces.astype(np.int32))


def circle(radius: float, z: float, width: float) -> Mesh:
    """Makes a flat ring around the origin, at the height z. All sizes are in m."""
    turns = np.linspace(0.0, 2.0 * math.pi, 73)
    return ribbon(radius * np.column_stack([np.cos(turns), np.sin(turns)]), z, width)


def outline_band(half_length: float, half_width: float, z: float, width: float) -> Mesh:
    """Makes a flat rectangular band around the origin, at the height z.

    ``half_length`` and ``half_width`` are half of the sides along x and y. All sizes
    are in m.
    """
    x, y, half = half_length, half_width, 0.5 * width
    sides = [(x - half, x + half, -y - half, y + half)]
    sides += [(-x - half, -x + half, -y - half, y + half)]
    sides += [(-x + half, x - half, y - half, y + half)]
    sides += [(-x + half, x - half, -y - half, -y + half)]
    return rectangles(np.array(sides), z)


def star(radius: float, z: float, width: float) -> Mesh:
    """Makes the outline of a star around the origin, at the height z.

    ``radius`` is the distance of the five points of the star from the origin. All sizes
    are in m.
    """
    turns = np.pi * (0.5 + np.arange(11) / 5.0)
    reach = radius * np.where(np.arange(11) % 2, 0.45, 1.0)[:, None]
    return ribbon(reach * np.column_stack([np.cos(turns), np.sin(turns)]), z, width)


def rectangles(edges: NDArray[np.float64], z: float) -> Mesh:
    """Makes flat rectangles at the height z, m.

    ``edges`` has the shape (m, 4): least x, greatest x, least y and greatest y, m.
    """
    x_low, x_high, y_low, y_high = np.asarray(edges, dtype=float).T
    x = np.column_stack([x_low, x_high, x_high, x_low]).ravel()
    y = np.column_stack([y_low, y_low, y_high, y_high]).ravel()
    first = 4 * np.arange(len(x_low))
    faces = np.hstack([[first, first + 1, first + 2], [first, first + 2, first + 3]])
    return Mesh(_at_height(np.vstack([x, y]), z), faces.astype(np.int32))


def arrow() -> Mesh:
    """Makes a flat arrow of 1 m length along x."""
    # Half of the width of the shaft, half of the width of the head, and x at which the
    # head begins, m.
    shaft, head, neck = 0.02, 0.055, 0.75
    x = [0.0, neck, neck, 0.0, neck, 1.0, neck]
    y = [-shaft, -shaft, shaft, shaft, -head, 0.0, head]
    faces = np.array([[0, 0, 4], [1, 2, 5], [2, 3, 6]], dtype=np.int32)
    return Mesh(_at_height(np.vstack([x, y]), 0.0), faces)


def prism(outline: NDArray[np.float64], height: float) -> Mesh:
    """Makes an upright prism on the floor, without its bottom.

    ``outline`` has the (n, 2) corners of a polygon whose edges do not cross, m.
    ``height`` is in m.
    """
    x, y = outline.T
    if x @ np.roll(y, -1) < y @ np.roll(x, -1):  # clockwise
        outline = outline[::-1]
    count = len(outline)
    first = np.arange(count)
    after = np.roll(first, -1)
    sides = [[first, after, count + after], [first, count + after, count + first]]
    top = count + _triangles(outline).T
    faces = np.hstack([*map(np.array, sides), top]).astype(np.int32)
    points = [_at_height(outline.T, z) for z in (0.0, height)]
    return Mesh(np.hstack(points), faces)


def _triangles(outline: NDArray[np.float64]) -> NDArray[np.int64]:
    """Cuts a counterclockwise polygon into triangles, (n - 2, 3) indices of corners.

    The function cuts off ears: a corner is an ear if it is convex, and the triangle
    with its neighbors contains no other corner (Meisters, 1975).
    """
    left, found, k = list(range(len(outline))), [], 0
    tries = 0
    while len(left) > 3:
        i = k % len(left)
        ear = left[i - 1], left[i], left[(i + 1) % len(left)]
        others = [j for j in left if j not in ear]
        tries += 1
        # Rounding may hide all ears of a thin polygon. Then any corner will do.
        if _is_ear(outline[list(ear)], outline[others]) or tries > len(left):
            found.append(ear)
            del left[i]
            tries = 0
        else:
            k += 1
    return np.array([*found, left])


def _is_ear(corners: NDArray[np.float64], others: NDArray[np.float64]) -> bool:
    u, v = np.roll(corners, -1, axis=0) - corners, others[:, None] - corners
    convex = u[0, 0] * u[1, 1] - u[0, 1] * u[1, 0] > 0.0
    inside = u[:, 0] * v[..., 1] - u[:, 1] * v[..., 0] >= 0.0
    return bool(convex and not inside.all(axis=1).any())


def _at_height(points: NDArray[np.float64], z: float) -> NDArray[np.float64]:
    return np.vstack([points, np.full(points.shape[1], z)])
