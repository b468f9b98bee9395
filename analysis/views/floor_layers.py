"""Divides a map of the floor that changes over time into few rectangles.

The map consists of square cells. Drawing few rectangles takes less memory than drawing
every cell at every time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.runs.known_space import KnownSpace


class FloorLayer(NamedTuple):
    """A group of floor cells that appear together and disappear together."""

    begin: int
    """Index of the first time at which the cells are present."""
    end: int
    """Index of the first time at which the cells are absent again. If the cells stay,
    this index is the number of times."""
    rectangles: NDArray[np.float64]
    """(m, 4) rectangles that cover the cells: least x, greatest x, least y, greatest y,
    m."""


def floor_layers(
    known: KnownSpace, cells: NDArray[np.bool_], *, whole: bool = True
) -> list[FloorLayer]:
    """Groups floor cells by the times at which they appear and disappear.

    ``cells`` has the shape (n, i, j). It states whether cell (i, j) of the map
    ``known`` is present at each of the n times of this map. The layers are sorted by
    ``begin``. At any time, a cell is in at most one layer. A cell that stays is in only
    one layer, so all layers together need little more memory than the last state of the
    floor. If ``whole`` is true, neighboring cells are merged into larger rectangles.
    """
    count = len(cells)
    # Index of the first time at which a cell that is present now is absent again.
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
    """Finds rectangles that cover each true cell of an (i, j) mask exactly once.

    The result has the shape (m, 4). Each rectangle has four indices: the first i, the
    last i plus 1, the first j, and the last j plus 1.
    """
    wide = cells.shape[0]
    padded = np.pad(cells, ((0, 1), (1, 1))).astype(np.int8)
    growing: dict[tuple[int, int], int] = {}
    found: list[tuple[int, int, int, int]] = []
    # The last row of the padded mask is empty, so all rectangles end before it.
    for i in range(wide + 1):
        edges = np.flatnonzero(np.diff(padded[i]))
        runs = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
        over = set(growing).difference(runs)
        found += [(growing.pop(run), i, *run) for run in over]
        for run in runs:
            growing.setdefault(run, i)
    return np.array(sorted(found), dtype=np.int64).reshape(-1, 4)


def _single_cells(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Returns one rectangle per cell, in the format of ``merged_cells``."""
    i, j = np.nonzero(cells)
    return np.column_stack([i, i + 1, j, j + 1])


def clipped(
    rectangles: NDArray[np.float64], within: tuple[float, float, float, float]
) -> NDArray[np.float64]:
    """Cuts off the parts of (m, 4) rectangles that are outside of ``within``.

    The result leaves out rectangles without a part inside of ``within``. Each rectangle
    has the least x, greatest x, least y and greatest y, m.
    """
    x_low, x_high, y_low, y_high = within
    low, high = [x_low, x_low, y_low, y_low], [x_high, x_high, y_high, y_high]
    cut = np.clip(rectangles, low, high)
    kept: NDArray[np.float64] = cut[(cut[:, 0] < cut[:, 1]) & (cut[:, 2] < cut[:, 3])]
    return kept
