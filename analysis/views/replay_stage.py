"""Adds the floor and the light to the 3D scene of a replay or of a live view."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.textpath import TextPath
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Box, Meshcat, Rgba
from pydrake.math import RigidTransform

Rectangle = tuple[float, float, float, float]

#: Size of the numbers on the floor, divided by the width of the floor that the replay
#: shows first. With this size, the numbers are readable on a phone, too.
NUMBER_SHARE = 0.028


def add_floor(meshcat: Meshcat, floor: Rectangle, shown: Rectangle) -> None:
    """Adds a floor for the whole run, with one grid line per meter and labels of x.

    Args:
        meshcat: Drake's 3D viewer.
        floor: Edges of the floor in whole meters: least x, greatest x, least y and
            greatest y, m.
        shown: Edges of the part of the floor that the viewer shows first. The labels
            are at its edge that is nearest to the viewer.
    """
    x_low, x_high, y_low, y_high = floor
    x, y = (x_low + x_high) / 2.0, (y_low + y_high) / 2.0
    slab = Box(x_high - x_low, y_high - y_low, 0.02)
    meshcat.SetObject("floor/slab", slab, Rgba(1.0, 1.0, 0.99))
    place: Any = np.array([x, y, -0.011])  # Drake's type stubs reject arrays
    meshcat.SetTransform("floor/slab", RigidTransform(place))
    along = np.arange(x_low, x_high + 0.5)
    across = np.arange(y_low, y_high + 0.5)
    starts = [(x, y_low) for x in along] + [(x_low, y) for y in across]
    ends = [(x, y_high) for x in along] + [(x_high, y) for y in across]
    _segments(meshcat, "floor/grid", starts, ends, Rgba(0.55, 0.55, 0.55))
    left, right, near, _ = shown
    size = NUMBER_SHARE * (right - left)
    for x in along:
        text = f"{x:.0f} m".replace("-", "\u2212")
        outline = TextPath((x + 0.4 * size, near + 0.4 * size), text, size=size)
        if x >= left and outline.get_extents().x1 <= right:
            _write(meshcat, f"floor/x {x:.0f}", outline)


def set_stage(meshcat: Meshcat) -> None:
    """Sets even light and a plain background. Hides the grid and axes of Meshcat."""
    lamps = ("SpotLight", "PointLightNegativeX", "PointLightPositiveX")
    for path in ("/Grid", "/Axes", *(f"/Lights/{lamp}" for lamp in lamps)):
        meshcat.SetProperty(path, "visible", value=False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 2.6)
    meshcat.SetProperty("/Lights/FillLight/<object>", "intensity", 1.2)
    for end in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background/<object>", end, [0.86, 0.89, 0.92])


def _segments(
    meshcat: Meshcat, path: str, starts: ArrayLike, ends: ArrayLike, rgba: Rgba
) -> None:
    def lifted(points: ArrayLike) -> Any:
        flat = np.asarray(points, dtype=float).T
        return np.asfortranarray(np.vstack([flat, np.full(flat.shape[1], 0.004)]))

    meshcat.SetLineSegments(path, lifted(starts), lifted(ends), 1.0, rgba)


def _write(meshcat: Meshcat, path: str, text: TextPath) -> None:
    """Draws the outlines of letters on the floor, because Meshcat cannot draw text."""
    starts: list[NDArray[np.float64]] = []
    ends: list[NDArray[np.float64]] = []
    for polygon in text.to_polygons():
        outline = np.asarray(polygon)
        starts.extend(outline[:-1])
        ends.extend(outline[1:])
    _segments(meshcat, path, starts, ends, Rgba(0.25, 0.25, 0.25))
