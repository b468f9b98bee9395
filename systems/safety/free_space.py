"""The map of free space: cells of the floor that range sensors have seen free."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.safety.outline import Outline, frame_at, in_body

#: Value of a cell that was never seen free.
NEVER = -1.0
_Values: TypeAlias = NDArray[np.float64]
_Window: TypeAlias = tuple[
    _Values, _Values, _Values, _Values, NDArray[np.int64], _Values
]
#: Number of fine cells along the side of a cell.
PARTS = 4
#: The window moves when its middle is farther from the robot than this number of cells.
MOST_SLACK = 20
#: In a small window, this limit is the side of the window divided by this number.
_SLACK_SHARE = 8


class FineSpace(NamedTuple):
    """Map with finer cells in a smaller window around the robot, for a long body.

    The fields are those of ``FreeSpace``. Each cell of a ``FreeSpace`` consists of
    ``PARTS`` x ``PARTS`` fine cells. A map for a short body has no fine cells.
    """

    free_until: NDArray[np.float64]
    hits: NDArray[np.float64]
    evidence: NDArray[np.float64]
    evident_until: NDArray[np.float64]
    first: NDArray[np.int64]
    rolled_m: NDArray[np.float64]
    cell_m: float


class FreeSpace(NamedTuple):
    """Map of a square window of n x n cells of the floor, which moves with the robot.

    Positions are in the frame of the odometry. Measured in cell sides, cell (i, j) of
    the floor covers x from i to i + 1 and y from j to j + 1. The arrays store its
    values at the index [i % n, j % n].

    The rolled distance is the mean distance that the rims of both wheels have rolled
    since the start.
    """

    free_until: NDArray[np.float64]
    """(n, n) rolled distance up to which a cell counts as free, m. After this distance,
    the position of the cell is too uncertain. The value is ``NEVER`` if the cell was
    not seen free.
    """
    hits: NDArray[np.float64]
    """(n, n) weighted number of echoes from each cell since the cell was last seen
    free.
    """
    evidence: NDArray[np.float64]
    """(n, n) logarithm of the evidence that no surface is in a cell or nearer, at least
    0. The evidence is a test martingale over the readings since it was last 0.
    """
    evident_until: NDArray[np.float64]
    """(n, n) rolled distance up to which all readings in ``evidence`` are valid, m."""
    first: NDArray[np.int64]
    """(2,) i and j of the first cell of the window."""
    rolled_m: NDArray[np.float64]
    """(1,) rolled distance, m."""
    ends: NDArray[np.float64]
    """(sensors, 6) the end of the view of each sensor, which is an arc, after its last
    reading: position (x, y) of the sensor, m, direction of its axis, rad, half of the
    aperture, rad, radius of the arc, m, and time of the reading, s, or ``NEVER``.
    """
    arc_points: int
    """Number of points by which the guard replaces an arc."""
    cell_m: float
    """Side of a cell, m."""
    fine: FineSpace


def make_free_space(
    cells: int, cell_m: float, sensors: int, arc_points: int, fine_cells: int = 0
) -> FreeSpace:
    """Makes a map without any free cells, around the origin of the floor.

    Args:
        cells: Number of cells along each side.
        cell_m: Side of a cell, m.
        sensors: Number of sensors.
        arc_points: Number of points of the arc at which the view of a sensor ends.
        fine_cells: Number of fine cells along each side of their window.

    Returns:
        The map.
    """
    return FreeSpace(
        *_window(cells),
        np.tile((0.0, 0.0, 0.0, 0.0, 0.0, NEVER), (sensors, 1)),
        arc_points,
        cell_m,
        FineSpace(*_window(fine_cells), cell_m / PARTS),
    )


def _window(cells: int) -> _Window:
    """Makes the first six fields of a map."""
    return (
        np.full((cells, cells), NEVER),
        np.zeros((cells, cells)),
        np.zeros((cells, cells)),
        np.full((cells, cells), np.inf),
        np.full(2, -(cells // 2)),
        np.zeros(1),
    )


@njit(cache=True)
def cell_is_free(
    space: FreeSpace, i: int, j: int, until: float
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether a cell still counts as free after the wheels have rolled.

    The position of a cell becomes uncertain as the wheels roll. Therefore a cell that
    was seen free counts as free only for some rolled distance.

    Args:
        space: Map of free space.
        i: Index of the cell on the floor along x.
        j: Index of the cell on the floor along y.
        until: Mean distance that both wheels have rolled since the start, m.

    Returns:
        True if the cell counts as free. Cells outside the window never do.
    """
    cells = space.free_until.shape[0]
    di, dj = i - space.first[0], j - space.first[1]
    if di < 0 or dj < 0 or di >= cells or dj >= cells:
        return False
    return space.free_until[i % cells, j % cells] >= until


@njit(cache=True)
def cells_within(
    space: FreeSpace | FineSpace,
    low_x: float,
    low_y: float,
    high_x: float,
    high_y: float,
) -> tuple[int, int, int, int]:  # pragma: no cover  (compiled)
    """Finds the cells of the window that a rectangle meets.

    The corners of the rectangle are (``low_x``, ``low_y``) and (``high_x``, ``high_y``)
    in the frame of the odometry, m. The result is four indices of cells: least i, least
    j, greatest i, and greatest j. If a least index is larger than the greatest, the
    rectangle meets no cells.
    """
    cell, cells, (first_i, first_j) = space.cell_m, len(space.hits), space.first
    return (
        max(math.floor(low_x / cell), first_i),
        max(math.floor(low_y / cell), first_j),
        min(math.floor(high_x / cell), first_i + cells - 1),
        min(math.floor(high_y / cell), first_j + cells - 1),
    )


@njit(cache=True)
def move_window(
    space: FreeSpace | FineSpace, x: float, y: float
) -> None:  # pragma: no cover  (compiled)
    """Moves the window with the robot and forgets the cells that leave the window.

    Args:
        space: Map of free space. The function changes the map in place.
        x: Position of the robot, x in the frame of the odometry, m.
        y: Position of the robot, y in the frame of the odometry, m.
    """
    cells = space.free_until.shape[0]
    slack = min(MOST_SLACK, cells // _SLACK_SHARE)
    for axis in range(2):
        place = x if axis == 0 else y
        first = space.first[axis]
        wanted = math.floor(place / space.cell_m) - cells // 2
        if abs(wanted - first) <= slack:
            continue
        for k in range(min(first, wanted), max(first, wanted)):
            # Cells k leave on one side, and cells k + n enter on the other, or vice
            # versa. Both are stored at the same index, so clearing one row is enough.
            for other in range(cells):
                i, j = (k % cells, other) if axis == 0 else (other, k % cells)
                space.free_until[i, j] = NEVER
                space.hits[i, j] = 0.0
                space.evidence[i, j] = 0.0
        space.first[axis] = wanted


@njit(cache=True)
def clear_disc(
    space: FreeSpace, x: float, y: float, radius: float, until: float
) -> None:  # pragma: no cover  (compiled)
    """Marks the cells that lie entirely within a disc as free.

    Args:
        space: Map of free space. The function changes the map in place.
        x: Center of the disc, x in the frame of the odometry, m.
        y: Center of the disc, y in the frame of the odometry, m.
        radius: Radius of the disc, m.
        until: The cells count as free until the wheels have rolled this mean distance
            since the start, m.
    """
    cell, cells = space.cell_m, space.free_until.shape[0]
    low_i, low_j, high_i, high_j = cells_within(
        space, x - radius, y - radius, x + radius, y + radius
    )
    for i in range(low_i, high_i + 1):
        dx = max(x - i * cell, (i + 1) * cell - x)
        row, at = space.free_until[i % cells], low_j % cells - 1
        for j in range(low_j, high_j + 1):
            at = at + 1 if at + 1 < cells else 0
            dy = max(y - j * cell, (j + 1) * cell - y)
            if dx * dx + dy * dy <= radius * radius:
                row[at] = max(row[at], until)


@njit(cache=True)
def clear_outline(
    space: FreeSpace | FineSpace, pose: Any, outline: Outline, until: float
) -> None:  # pragma: no cover  (compiled)
    """Marks the cells that lie entirely within the outline of the body as free.

    The body occupies these cells, so no obstacle does.

    Args:
        space: Map of free space. The function changes the map in place.
        pose: Pose (x, y, theta) of the body, m and rad.
        outline: Outline of the body.
        until: The cells count as free until the wheels have rolled this mean distance
            since the start, m.
    """
    cell, cells = space.cell_m, space.free_until.shape[0]
    frame, radius = frame_at(pose, cell), outline.radius_m
    low_i, low_j, high_i, high_j = cells_within(
        space, pose[0] - radius, pose[1] - radius, pose[0] + radius, pose[1] + radius
    )
    length = outline.half_length_m - frame.half_cell_m
    width = outline.half_width_m - frame.half_cell_m
    for i in range(low_i, high_i + 1):
        row, at = space.free_until[i % cells], low_j % cells - 1
        for j in range(low_j, high_j + 1):
            at = at + 1 if at + 1 < cells else 0
            u, v = in_body((i * cell, j * cell), cell, frame)
            if abs(u) <= length and abs(v) <= width:
                row[at] = max(row[at], until)


@njit(cache=True)
def disc_is_free(
    space: FreeSpace, x: float, y: float, radius: float
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether all cells that a disc meets count as free.

    Args:
        space: Map of free space.
        x: Center of the disc, x in the frame of the odometry, m.
        y: Center of the disc, y in the frame of the odometry, m.
        radius: Radius of the disc, m.

    Returns:
        True if all these cells count as free.
    """
    cell = space.cell_m
    low_i, high_i = math.floor((x - radius) / cell), math.ceil((x + radius) / cell) - 1
    low_j, high_j = math.floor((y - radius) / cell), math.ceil((y + radius) / cell) - 1
    free = free_cells(space, low_i, low_j, high_i, high_j, space.rolled_m[0])
    for i in range(low_i, high_i + 1):
        dx = max(i * cell - x, 0.0, x - (i + 1) * cell)
        for j in range(low_j, high_j + 1):
            dy = max(j * cell - y, 0.0, y - (j + 1) * cell)
            if dx * dx + dy * dy < radius * radius and not free[i - low_i, j - low_j]:
                return False
    return True


@njit(cache=True)
def edge_cells(
    space: FreeSpace, x: float, y: float, reach: float, until: float, out: Any
) -> int:  # pragma: no cover  (compiled)
    """Lists the non-free cells of a square that are next to a free cell.

    These cells are the edge of the non-free space. The non-free cell nearest to a point
    in free space always belongs to this edge.

    Args:
        space: Map of free space.
        x: Middle of the square, x in the frame of the odometry, m.
        y: Middle of the square, y in the frame of the odometry, m.
        reach: Half of the side of the square, m.
        until: A cell is free if it counts as free until the wheels have rolled this
            mean distance since the start, m.
        out: (m, 2) array that the function fills with one corner of each cell: least x
            and least y, m.

    Returns:
        Number of cells on the edge. If it exceeds m, ``out`` contains only m of them.
    """
    cell, count = space.cell_m, 0
    low_i, low_j = math.floor((x - reach) / cell), math.floor((y - reach) / cell)
    high_i, high_j = math.floor((x + reach) / cell), math.floor((y + reach) / cell)
    # The square, enlarged by one cell on each side.
    free = free_cells(space, low_i - 1, low_j - 1, high_i + 1, high_j + 1, until)
    for a in range(1, free.shape[0] - 1):
        for b in range(1, free.shape[1] - 1):
            if not free[a, b] and (
                free[a - 1, b] or free[a + 1, b] or free[a, b - 1] or free[a, b + 1]
            ):
                if count < out.shape[0]:
                    out[count, 0] = (low_i - 1 + a) * cell
                    out[count, 1] = (low_j - 1 + b) * cell
                count += 1
    return count


@njit(cache=True)
def free_cells(
    space: FreeSpace | FineSpace,
    low_i: int,
    low_j: int,
    high_i: int,
    high_j: int,
    until: float,
) -> NDArray[np.bool_]:  # pragma: no cover  (compiled)
    """Returns ``cell_is_free`` for all cells of a rectangle."""
    cells = space.free_until.shape[0]
    first_i, first_j = space.first
    free = np.zeros((high_i - low_i + 1, high_j - low_j + 1), dtype=np.bool_)
    for i in range(max(low_i, first_i), min(high_i, first_i + cells - 1) + 1):
        row = space.free_until[i % cells]
        begin = max(low_j, first_j)
        at = begin % cells
        for j in range(begin, min(high_j, first_j + cells - 1) + 1):
            free[i - low_i, j - low_j] = row[at] >= until
            at += 1
            if at == cells:
                at = 0
    return free
