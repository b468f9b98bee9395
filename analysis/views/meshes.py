"""Makes flat meshes of triangles for a replay: bands, rectangles, arrows and stars."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Mesh(NamedTuple):
    """A surface of triangles."""

    vertices: NDArray[np.float64]
    """(3, n) points x, y, z, m."""
    faces: NDArray[np.int32]
    """(3, m) indices of the three points of each triangle."""


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


def _at_height(points: NDArray[np.float64], z: float) -> NDArray[np.float64]:
    return np.vstack([points, np.full(points.shape[1], z)])
