"""Parts of the floor that appear and go again, as few rectangles as will do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.runs.known_space import KnownSpace


class FloorLayer(NamedTuple):
    """Cells that come and go together."""

    begin: int
    """Number of the time from which on they are there."""
    end: int
    """From which on they are not; the number of all times: they stay."""
    rectangles: NDArray[np.float64]
    """(m, 4) least and greatest x, least and greatest y, m."""


def floor_layers(
    known: KnownSpace, cells: NDArray[np.bool_], *, whole: bool = True
) -> list[FloorLayer]:
    """Cells by the times at which they come and go.

    A cell that stays is in one layer alone, so that all of them take little more than
    the last picture of the floor.

    Args:
        known: Times, and places of the cells.
        cells: (n, i, j) which of them are there at each time.
        whole: Whether neighbours are merged; else each cell has its own rectangle.

    Returns:
        Layers that do not overlap at any time, by the times at which they begin.
    """
    count = len(cells)
    # Of each cell that is there, from which time on it is not.
    ends = np.full(cells.shape, count)
    for k in range(count - 2, -1, -1):
        ends[k] = np.where(cells[k + 1], ends[k + 1], k + 1)
    corners, layers = np.repeat(known.corner_m, 2), []
    for begin in range(count):
        come = cells[begin] & ~cells[begin - 1] if begin else cells[0]
        for end in np.unique(ends[begin][come]).tolist():
            both = come & (ends[begin] == end)
            parts = merged_cells(both) if whole else _single_cells(both)
            layers.append(FloorLayer(begin, end, corners + parts * known.cell_m))
    return layers


def merged_cells(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Rectangles that cover some cells, each cell once.

    Args:
        cells: (i, j) which.

    Returns:
        (m, 4) of each first i, the i after its last, and the same of j.
    """
    wide = cells.shape[0]
    padded = np.pad(cells, ((0, 1), (1, 1))).astype(np.int8)
    growing: dict[tuple[int, int], int] = {}
    found: list[tuple[int, int, int, int]] = []
    # The last row is empty: there all rectangles that still grow end.
    for i in range(wide + 1):
        edges = np.flatnonzero(np.diff(padded[i]))
        runs = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
        over = set(growing).difference(runs)
        found += [(growing.pop(run), i, *run) for run in over]
        for run in runs:
            growing.setdefault(run, i)
    return np.array(sorted(found), dtype=np.int64).reshape(-1, 4)


def _single_cells(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    """As ``merged_cells``, a rectangle a cell."""
    i, j = np.nonzero(cells)
    return np.column_stack([i, i + 1, j, j + 1])


def clipped(
    rectangles: NDArray[np.float64], within: tuple[float, float, float, float]
) -> NDArray[np.float64]:
    """What of some rectangles lies within another one.

    Args:
        rectangles: (m, 4) least and greatest x, least and greatest y, m.
        within: The same of the other, m.

    Returns:
        (k, 4) as they are left; those outside are left out.
    """
    x_low, x_high, y_low, y_high = within
    low, high = [x_low, x_low, y_low, y_low], [x_high, x_high, y_high, y_high]
    cut = np.clip(rectangles, low, high)
    kept: NDArray[np.float64] = cut[(cut[:, 0] < cut[:, 1]) & (cut[:, 2] < cut[:, 3])]
    return kept
