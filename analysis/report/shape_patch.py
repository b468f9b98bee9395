"""Draws the shape of a body in matplotlib."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Patch, PathPatch, Polygon
from matplotlib.path import Path
from numpy.typing import ArrayLike, NDArray

from systems.world.plane import rotate
from systems.world.shapes import Shape


def placed(outline: NDArray[np.float64], pose: ArrayLike) -> NDArray[np.float64]:
    """Returns the (k, 2) points of an outline (k, 2) at a pose (x, y, theta), m."""
    x, y, theta = np.asarray(pose, dtype=float).tolist()
    along, across = rotate(theta, *outline.T)
    return np.column_stack([x + along, y + across])


def shape_patch(shape: Shape, pose: ArrayLike, **style: Any) -> Patch:
    """Makes a patch of the region that a shape covers at a pose (x, y, theta), m, rad.

    ``style`` has the properties of the patch. The walls of one shape are one patch, so
    that a transparent color is equal where two of them meet.
    """
    outlines = [placed(outline, pose) for outline in shape.outlines]
    if len(outlines) == 1:
        return Polygon(outlines[0], **style)
    loops = [Path([*outline, outline[0]], closed=True) for outline in outlines]
    return PathPatch(Path.make_compound_path(*loops), **style)


def label_rectangle(shape: Shape, pose: ArrayLike) -> list[float]:
    """Returns x, y, theta, length, width of the box around a shape, for ``BodyLabel``.

    The sides of the box are parallel to the axes of the body at ``pose``, m and rad.
    """
    low_x, high_x, low_y, high_y = shape.bounds
    middle = np.array([[0.5 * (low_x + high_x), 0.5 * (low_y + high_y)]])
    x, y = placed(middle, pose)[0].tolist()
    theta = float(np.asarray(pose, dtype=float)[2])
    return [x, y, theta, high_x - low_x, high_y - low_y]
