"""Makes the worlds that come with the package: ``python -m tools.worlds``.

As in the BARN challenge (Perille et al. 2020), a cellular automaton makes a random
field of cylinders between two walls. A world is kept if a disc can pass through it. Its
reference path is the shortest one for this disc on the grid.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve, distance_transform_edt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

import diagrams
from diagrams.scenario.worlds.cylinder_tables import CYLINDERS, PATHS
from diagrams.scenario.worlds.world import GOAL_M, RADIUS_M, START_M

FOLDER = Path(diagrams.__file__).parent / "worlds"
SEED, WORLDS = 2026, 12
#: Side of a cell, m. Cylinders in neighboring cells touch each other.
CELL_M = 2.0 * RADIUS_M
#: Cells across and along the corridor, and the first row of the random field. The field
#: ends 3 m before the goal. Center of the first cell in W, m.
COLUMNS, ROWS, FIRST_ROW = 30, 64, 34
ORIGIN_M = (-4.425, 0.075)
#: Shares of cells that are occupied before the automaton runs, and numbers of its
#: steps. Each world has one pair of them.
FILLED, STEPS = (0.15, 0.2, 0.25, 0.3), (2, 3, 4)
#: An empty cell with at least this number of occupied neighbors becomes occupied. An
#: occupied cell with at most this number of them becomes empty.
_FILL_FROM, _CLEAR_TO = 5, 1
#: Radius of the disc that can pass, m. The narrowest passages are twice as wide.
DISC_M = 0.375
_AROUND = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]])

Cells = NDArray[np.bool_]


def draw_cells(generator: np.random.Generator, filled: float, steps: int) -> Cells:
    """Draws a corridor with a random field of occupied cells.

    Args:
        generator: Source of the random numbers.
        filled: Share of the cells that are occupied at first.
        steps: Number of steps of the automaton.

    Returns:
        (64, 30) whether each cell is occupied; y grows with the row, x with the column.
    """
    cells = np.zeros((ROWS, COLUMNS), dtype=bool)
    cells[FIRST_ROW:] = generator.random((ROWS - FIRST_ROW, COLUMNS)) < filled
    cells[0], cells[:, [0, -1]] = True, True
    for _ in range(steps):
        neighbors = convolve(cells.astype(int), _AROUND, mode="nearest")
        cells = np.where(cells, neighbors > _CLEAR_TO, neighbors >= _FILL_FROM)
        cells[0], cells[:, [0, -1]] = True, True
    return cells


def reference_length(cells: Cells) -> float | None:
    """Returns the length of the shortest path of the disc from start to goal, m.

    The path leads through centers of neighboring cells, also diagonally. The result is
    None if no path exists.
    """
    (first, leg), (last, other) = map(_nearest_cell, (START_M, GOAL_M))
    whole = np.zeros((last[0] + 1, COLUMNS), dtype=bool)
    whole[:ROWS] = cells
    away = distance_transform_edt(~whole) * CELL_M - RADIUS_M
    free = away >= DISC_M
    number = np.arange(whole.size).reshape(whole.shape)
    starts, ends, lengths = [], [], []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        height, width = whole.shape
        here = np.s_[: height - down, max(-right, 0) : width - max(right, 0)]
        there = np.s_[down:, max(right, 0) : width + min(right, 0)]
        both = free[here] & free[there]
        starts.append(number[here][both])
        ends.append(number[there][both])
        lengths.append(np.full(int(both.sum()), CELL_M * np.hypot(down, right)))
    graph = coo_array(
        (np.concatenate(lengths), (np.concatenate(starts), np.concatenate(ends))),
        shape=(whole.size, whole.size),
    ).tocsr()
    found = dijkstra(graph, directed=False, indices=number[first])[number[last]]
    return float(leg + found + other) if np.isfinite(found) else None


def _nearest_cell(point: Sequence[float]) -> tuple[tuple[int, int], float]:
    """Returns row and column of the nearest cell, and its distance, m."""
    x, y = np.subtract(point, ORIGIN_M) / CELL_M
    row, column = round(y), round(x)
    return (row, column), float(np.hypot(y - row, x - column)) * CELL_M


def make_worlds() -> tuple[list[list[str]], list[list[str]]]:
    """Returns the rows of both tables, without their headings."""
    generator = np.random.Generator(np.random.Philox(seed=SEED))
    cylinders: list[list[str]] = []
    paths: list[list[str]] = []
    while len(paths) < WORLDS:
        name = len(paths)
        filled = FILLED[name // len(STEPS) % len(FILLED)]
        cells = draw_cells(generator, filled, STEPS[name % len(STEPS)])
        length = reference_length(cells)
        if length is None:
            continue
        for row, column in np.argwhere(cells):
            x, y = ORIGIN_M[0] + column * CELL_M, ORIGIN_M[1] + row * CELL_M
            cylinders.append([str(name), f"{x:.3f}", f"{y:.3f}"])
        paths.append([str(name), f"{length:.4f}"])
    return cylinders, paths


def main() -> None:
    """Writes both tables into the package."""
    cylinders, paths = make_worlds()
    FOLDER.mkdir(exist_ok=True)
    for name, head, rows in (
        (CYLINDERS, ["world", "x_m", "y_m"], cylinders),
        (PATHS, ["world", "path_length_m"], paths),
    ):
        with (FOLDER / name).open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([head, *rows])


if __name__ == "__main__":
    main()
