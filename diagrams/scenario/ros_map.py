"""Reads maps in the format of the ROS package ``map_server``."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from diagrams.scenario.yaml_text import parse_yaml
from systems.framework.input_error import InputError
from systems.framework.input_files import require_file
from systems.framework.signals import read_only
from systems.world.plane import rotate
from systems.world.shapes import Shape

#: Largest number of cells of a map, and largest number of rectangles that cover its
#: occupied cells.
MOST_CELLS, MOST_RECTANGLES = 25_000_000, 100_000
_FIELDS = "image, resolution, origin, negate, occupied_thresh, free_thresh"


@dataclass(frozen=True, eq=False)
class RosMap:
    """Square cells of the floor that are occupied or not."""

    occupied: NDArray[np.bool_]
    """(n, m) whether each cell is occupied; read-only. The rows are along y of the map,
    and the columns are along x. Unknown cells are not occupied."""
    cell_m: float
    """Side of a cell, m."""
    origin: tuple[float, float, float]
    """Pose (x, y, theta) of the outer corner of cell (0, 0) in W, m and rad. The axes
    of the map are at this pose."""

    @cached_property
    def shape(self) -> Shape:
        """The occupied cells as rectangles in the axes of the map.

        Each row of cells along x is cut into runs. Equal runs of adjacent rows are one
        rectangle. The rectangles do not overlap.
        """
        begin, end, low, high = _merged_runs(self.occupied)
        rectangles = np.zeros((len(begin), 6))
        rectangles[:, 0], rectangles[:, 1] = begin + end, low + high
        rectangles[:, :2] *= 0.5 * self.cell_m
        rectangles[:, 3], rectangles[:, 4] = end - begin, high - low
        rectangles[:, 3:5] *= self.cell_m
        return Shape(rectangles)

    def covers(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Returns whether points are in occupied cells.

        Args:
            points: (k, 2) points in W, m.

        Returns:
            (k,) booleans. Outside of the map, nothing is occupied.
        """
        x, y, theta = self.origin
        away = np.asarray(points, dtype=float) - (x, y)
        u, v = rotate(-theta, *away.T)
        column, row = (np.floor(np.stack([u, v]) / self.cell_m)).astype(np.int64)
        rows, columns = self.occupied.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        found = np.zeros(len(inside), dtype=bool)
        found[inside] = self.occupied[row[inside], column[inside]]
        return found


class MapHeader(NamedTuple):
    """Contents of ``map.yaml``."""

    image: Path
    """Path of the image."""
    resolution: float
    """Side of a cell, m."""
    origin: tuple[float, float, float]
    """Pose of the lower left corner of the image in W, m and rad."""
    negate: bool
    """Whether light cells are occupied."""
    occupied_thresh: float
    """Occupancy above which a cell is occupied, 0 to 1."""
    free_thresh: float
    """Occupancy below which a cell is free, 0 to 1."""


def read_ros_map(path: str | Path, field: str = "map.file") -> RosMap:
    """Reads ``map.yaml`` and its image, as ``map_server`` reads them.

    The level v of a pixel is the mean of its channels, including the channel of an
    image with transparency, from 0 to 255. With ``negate: 0``, the occupancy is (255 -
    v) / 255. With ``negate: 1``, it is v / 255. A cell is occupied if its occupancy is
    above ``occupied_thresh``. The mode is ``trinary``, in which the other cells are
    free or unknown. The first row of the image is the one with the largest y.

    The function keeps the last maps, and reads files again if they have changed.

    Args:
        path: The YAML file. The path of the image is relative to this file.
        field: Name of the parameter with the path, for messages.

    Returns:
        The occupied cells.

    Raises:
        InputError: A file is missing or unreadable, or a value is out of its range.
        InputError: The map has more than 25 million cells, or its occupied cells make
            more than 100,000 rectangles.

    Reference: http://wiki.ros.org/map_server, section "Map format", and
        ``map_server/src/image_loader.cpp`` of ros-planning/navigation.
    """
    header = read_header(path, field)
    image = require_file(header.image, f"{field}: image", "PGM or PNG")
    state = image.stat()
    return _cells(header, field, (state.st_mtime_ns, state.st_size))


def read_header(path: str | Path, field: str = "map.file") -> MapHeader:
    """Reads ``map.yaml`` without its image; see ``read_ros_map``."""
    path = require_file(path, field, "YAML").resolve()
    state = path.stat()
    return _header(path, field, (state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=8)
def _header(path: Path, field: str, _state: tuple[int, int]) -> MapHeader:
    content = parse_yaml(path.read_bytes(), field)
    if not isinstance(content, dict) or "image" not in content:
        raise InputError(
            field, f"{str(path)!r} is no map of map_server; it needs {_FIELDS}"
        )
    cell_m = _number(content, "resolution", field)
    if not 0.001 <= cell_m <= 100.0:
        raise _fault(
            field, "resolution", cell_m, "give the side of a cell, 0.001 to 100 m"
        )
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
        raise _fault(field, "mode", mode, "only mode: trinary is read; write it there")
    negate = content.get("negate", 0)
    if negate not in (0, 1):
        raise _fault(field, "negate", negate, "give 0 or 1")
    return MapHeader(
        path.parent / str(content["image"]),
        cell_m,
        _origin(content, field),
        bool(negate),
        occupied_above,
        free_below,
    )


# A scenario reads its map many times.
@lru_cache(maxsize=4)
def _cells(header: MapHeader, field: str, _state: tuple[int, int]) -> RosMap:
    sums, channels = _pixel_sums(header.image, field)
    level = np.arange(255 * channels + 1) / channels
    occupancy = level / 255.0 if header.negate else (255.0 - level) / 255.0
    occupied = (occupancy > header.occupied_thresh)[sums[::-1]]
    read_only(occupied)
    found = RosMap(occupied, header.resolution, header.origin)
    count = len(found.shape.rectangles)
    if count > MOST_RECTANGLES:
        raise InputError(
            field,
            f"has an image whose occupied cells make {count} rectangles, more than "
            f"{MOST_RECTANGLES}; remove single cells, or use a larger resolution",
        )
    if count == 0:
        raise InputError(
            field,
            "has an image without occupied cells; check negate and occupied_thresh, "
            f"{header.occupied_thresh:g}",
        )
    return found


def _merged_runs(occupied: NDArray[np.bool_]) -> tuple[NDArray[np.int64], ...]:
    """Returns begin and end along x, and along y, of rectangles of occupied cells."""
    # Each row has a free cell at either end, so that runs never join.
    rows = np.zeros((occupied.shape[0], occupied.shape[1] + 2), dtype=np.int8)
    rows[:, 1:-1] = occupied
    steps = np.diff(rows, axis=1)
    row, begin = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    order = np.lexsort((row, end, begin))
    row, begin, end = row[order], begin[order], end[order]
    follows = (np.diff(row) == 1) & (np.diff(begin) == 0) & (np.diff(end) == 0)
    first = np.flatnonzero(np.append(True, ~follows)[: len(row)])
    last = np.append(first[1:], len(row))[: len(first)] - 1
    return begin[first], end[first], row[first], row[last] + 1


def _pixel_sums(path: Path, field: str) -> tuple[NDArray[Any], int]:
    """Reads the sum of the channels of each pixel, and the number of channels."""
    from PIL import Image  # loads its formats

    try:
        # The size is checked here, more strictly than by Pillow.
        with warnings.catch_warnings(action="ignore"), Image.open(path) as image:
            _check_image(image, field)
            clear = image.mode in ("LA", "PA") or "transparency" in image.info
            mode = {"1": "L", "L": "L", "RGB": "RGB", "RGBA": "RGBA"}.get(
                image.mode, "RGBA" if clear else "RGB"
            )
            pixels = np.asarray(image.convert(mode), dtype=np.uint8)
    except Image.DecompressionBombError:
        raise InputError(
            field, f"has more than {MOST_CELLS} cells; cut the map"
        ) from None
    except (OSError, SyntaxError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            field, f"cannot read the image {str(path)!r} ({error}); give a PGM or PNG"
        ) from None
    if pixels.ndim == 2:
        return pixels, 1
    return pixels.sum(axis=2, dtype=np.uint16), pixels.shape[2]


def _check_image(image: Any, field: str) -> None:
    if image.width * image.height > MOST_CELLS:
        raise InputError(
            field,
            f"has {image.width} x {image.height} cells, more than {MOST_CELLS}; cut "
            "the map, or use a larger resolution",
        )
    if image.mode.startswith(("I", "F")):
        raise InputError(
            field,
            f"has an image of the mode {image.mode}; give 8 bits per channel: convert "
            "map.png -depth 8 map.pgm",
        )


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
    value: Any = content.get(key)
    if not _is_number(value):
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
