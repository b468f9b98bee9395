"""Makes the worlds that come with the package: ``python -m tools.worlds``.

As in the BARN challenge (Perille et al. 2020), a cellular automaton makes a random
field of cylinders between two walls. A world is kept if a disc can pass through it. Its
reference path is the shortest one for this disc on the grid.
"""

from __future__ import annotations

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
SEED = 2026
#: Side of a cell, m. Cylinders in neighboring cells touch each other.
CELL_M = 2.0 * RADIUS_M
#: Cells across and along the corridor, and the first row of the random field. The field
#: ends 3 m before the goal. Center of the first cell in W, m.
COLUMNS, ROWS, FIRST_ROW = 30, 64, 34
ORIGIN_M = (-4.425, 0.075)
#: Shares of cells that are occupied before the automaton runs, and numbers of its
#: steps. Each world has one pair of them.
FILLED, STEPS = (0.14, 0.18, 0.22, 0.25), (2, 3, 4)
WORLDS = len(FILLED) * len(STEPS)
#: An empty cell with at least this number of occupied neighbors becomes occupied. An
#: occupied cell with at most this number of them becomes empty.
_FILL_FROM, _CLEAR_TO = 5, 1
#: Radius of the disc that can pass, m. The narrowest passages are twice as wide.
DISC_M = 0.375
#: Greatest number of draws of a world.
_ATTEMPTS = 10_000
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


def make_world(number: int) -> tuple[Cells, float]:
    """Returns the occupied cells of a world, and the length of its path, m.

    The generator draws until the disc can pass. The result depends only on the number.
    """
    generator = np.random.Generator(np.random.Philox(seed=[SEED, number]))
    filled, steps = FILLED[number // len(STEPS)], STEPS[number % len(STEPS)]
    for _ in range(_ATTEMPTS):
        cells = draw_cells(generator, filled, steps)
        if (length := reference_length(cells)) is not None:
            return cells, length
    raise RuntimeError(f"world {number}: the disc passes in none of {_ATTEMPTS} draws")


def rows_of(number: int) -> tuple[list[str], list[str]]:
    """Returns the lines of a world in ``cylinders.csv`` and in ``paths.csv``."""
    cells, length = make_world(number)
    places = np.argwhere(cells)[:, ::-1] * CELL_M + ORIGIN_M
    return (
        [f"{number},{x:.3f},{y:.3f}" for x, y in places.tolist()],
        [f"{number},{length:.4f}"],
    )


def main() -> None:
    """Writes both tables into the package."""
    made = [rows_of(number) for number in range(WORLDS)]
    FOLDER.mkdir(exist_ok=True)
    for k, name, head in (
        (0, CYLINDERS, "world,x_m,y_m"),
        (1, PATHS, "world,path_length_m"),
    ):
        lines = [head, *(line for each in made for line in each[k])]
        (FOLDER / name).write_text("\n".join([*lines, ""]), "utf-8")


if __name__ == "__main__":
    main()
