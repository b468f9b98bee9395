"""Reads maps in the format of the ROS package ``map_server``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario.yaml_text import parse_yaml
from systems.framework.input_error import InputError
from systems.framework.input_files import require_file

#: Largest number of cells of a map.
MOST_CELLS = 25_000_000
# Names of the modes in which ``map_server`` reads an image.
_MODES = ("trinary", "scale", "raw")
_FIELDS = "image, resolution, origin, negate, occupied_thresh, free_thresh"


class RosMap(NamedTuple):
    """Square cells of the floor that are occupied or not."""

    occupied: NDArray[np.bool_]
    """(n, m) whether each cell is occupied. The first axis is x of the map, and the
    second is y. Unknown cells are not occupied."""
    cell_m: float
    """Side of a cell, m."""
    origin: tuple[float, float, float]
    """Pose (x, y, theta) of the outer corner of cell (0, 0) in W, m and rad."""

    def rectangles(self) -> NDArray[np.float64]:
        """Covers the occupied cells with rectangles that do not overlap.

        Each row of cells along x is cut into runs. Equal runs of adjacent rows make one
        rectangle.

        Returns:
            (k, 5) rectangles (x, y, theta, length, width) in W, m and rad. The length
            is along x of the map.
        """
        begin, end, low, high = _merged_runs(self.occupied)
        u = 0.5 * self.cell_m * (begin + end)
        v = 0.5 * self.cell_m * (low + high)
        x, y, theta = self.origin
        c, s = math.cos(theta), math.sin(theta)
        return np.column_stack(
            [
                x + c * u - s * v,
                y + s * u + c * v,
                np.full(len(u), theta),
                self.cell_m * (end - begin),
                self.cell_m * (high - low),
            ]
        )


def _merged_runs(occupied: NDArray[np.bool_]) -> tuple[NDArray[np.int64], ...]:
    """Returns begin and end along x, and along y, of rectangles of occupied cells."""
    # Each row has a free cell at either end, so that runs never join.
    rows = np.zeros((occupied.shape[1], occupied.shape[0] + 2), dtype=np.int8)
    rows[:, 1:-1] = occupied.T
    steps = np.diff(rows, axis=1)
    row, begin = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    order = np.lexsort((row, end, begin))
    row, begin, end = row[order], begin[order], end[order]
    follows = (np.diff(row) == 1) & (np.diff(begin) == 0) & (np.diff(end) == 0)
    first = np.flatnonzero(np.append(True, ~follows)[: len(row)])
    last = np.append(first[1:], len(row))[: len(first)] - 1
    return begin[first], end[first], row[first], row[last] + 1


def read_ros_map(path: str | Path, field: str = "map.file") -> RosMap:
    """Reads ``map.yaml`` and its image, as ``map_server`` reads them.

    With ``negate: 0``, a pixel of the value v has the occupancy (255 - v) / 255. With
    ``negate: 1``, it is v / 255. A cell is occupied if its occupancy is above
    ``occupied_thresh``. The mode is ``trinary``, in which the other cells are free or
    unknown. The first row of the image is the one with the largest y.

    Args:
        path: The YAML file. The path of the image is relative to this file.
        field: Name of the parameter with the path, for messages.

    Returns:
        The occupied cells.

    Raises:
        InputError: A file is missing or unreadable, a value is out of its range, or the
            map has more than 25 million cells.

    Reference: http://wiki.ros.org/map_server, section "Map format".
    """
    path = require_file(path, field, "YAML")
    content = parse_yaml(path.read_bytes(), field)
    if not isinstance(content, dict) or "image" not in content:
        raise InputError(
            field, f"{str(path)!r} is no map of map_server; it needs {_FIELDS}"
        )
    cell_m = _number(content, "resolution", field)
    if not 0.001 <= cell_m <= 100.0:
        raise _fault(field, "resolution", cell_m, "give the side of a cell in m, > 0")
    occupied_above = _number(content, "occupied_thresh", field)
    free_below = _number(content, "free_thresh", field)
    if not 0.0 <= free_below < occupied_above <= 1.0:
        raise InputError(
            field,
            f"has free_thresh {free_below:g} and occupied_thresh {occupied_above:g}; "
            "give 0 <= free_thresh < occupied_thresh <= 1, for example 0.196 and 0.65",
        )
    mode = content.get("mode", "trinary")
    if mode != "trinary":
        known = "is known, but not read" if mode in _MODES else "is not known"
        raise _fault(field, "mode", mode, f"this mode {known}; give mode: trinary")
    negate = content.get("negate", 0)
    if negate not in (0, 1):
        raise _fault(field, "negate", negate, "give 0 or 1")
    shade = _shades(path.parent / str(content["image"]), field)
    occupancy = shade if negate else 255.0 - shade
    # In trinary mode, ``map_server`` compares with the threshold before it rounds.
    occupied = occupancy > 255.0 * occupied_above
    return RosMap(
        np.ascontiguousarray(occupied[::-1].T), cell_m, _origin(content, field)
    )


def _shades(path: Path, field: str) -> NDArray[np.float32]:
    """Reads the mean of the color channels of each pixel, 0 to 255."""
    from PIL import Image, UnidentifiedImageError  # loads its formats

    path = require_file(path, f"{field}: image", "PGM or PNG")
    try:
        with Image.open(path) as image:
            if image.width * image.height > MOST_CELLS:
                raise InputError(
                    field,
                    f"has {image.width} x {image.height} cells, more than "
                    f"{MOST_CELLS}; cut the map, or use a larger resolution",
                )
            if image.mode.startswith(("I", "F")):
                raise InputError(
                    field,
                    f"has an image of the mode {image.mode}; give 8 bits per channel: "
                    "convert map.png -depth 8 map.pgm",
                )
            if image.mode not in {"L", "RGB"}:
                alpha = image.mode in {"LA", "RGBA", "PA"} or "transparency" in (
                    image.info
                )
                colors = _on_white(image) if alpha else image.convert("RGB")
                pixels = np.asarray(colors, dtype=np.uint8)
            else:
                pixels = np.asarray(image, dtype=np.uint8)
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            field, f"cannot read the image {str(path)!r} ({error}); give a PGM or PNG"
        ) from None
    if pixels.ndim == 2:
        return pixels.astype(np.float32)
    return np.asarray(pixels.mean(axis=2, dtype=np.float32))


def _on_white(image: Any) -> Any:
    """Lays a transparent image on white, so that what is transparent is free."""
    from PIL import Image

    colors = image.convert("RGBA")
    return Image.alpha_composite(
        Image.new("RGBA", colors.size, "white"), colors
    ).convert("RGB")


def _origin(content: Mapping[str, Any], field: str) -> tuple[float, float, float]:
    origin = content.get("origin")
    if not isinstance(origin, list) or len(origin) not in (2, 3):
        raise _fault(field, "origin", origin, "give [x, y, theta] in m and rad")
    numbers = [*origin, 0.0][:3]
    if not all(_is_number(value) and abs(value) <= 1e6 for value in numbers):
        raise _fault(field, "origin", origin, "give [x, y, theta] in m and rad")
    x, y, theta = (float(value) for value in numbers)
    return x, y, theta


def _number(content: Mapping[str, Any], key: str, field: str) -> float:
    if not _is_number(value := content.get(key)):
        raise _fault(field, key, value, "give a number")
    return float(value)


def _is_number(value: Any) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
    )


def _fault(field: str, key: str, value: Any, remedy: str) -> InputError:
    found = f"has {key}: {value!r}" if value is not None else f"has no {key}"
    return InputError(field, f"{found}; {remedy}")
