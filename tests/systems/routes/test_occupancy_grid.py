"""Blocked cells against distances worked out cell by cell, and SciPy's transform."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from systems.routes.occupancy_grid import (
    ARENA_MARGIN_M,
    block_discs,
    block_rectangles,
    cell_middle,
    cell_of,
    free_grid,
    make_occupancy_grid,
    sorted_discs,
)
from systems.world.geometry import rectangle_clearance

RADIUS = 0.35
ARENA = (-2.0, -1.5, 2.0, 1.5)


def test_cells_near_rectangles_are_blocked_and_no_others():
    generator = np.random.default_rng(3)
    boxes = np.column_stack(
        [
            generator.uniform(-2.2, 2.2, (6, 3)),
            generator.uniform(0.05, 1.0, (6, 2)),
            [0.0, 0.0, 0.0, 0.1, 0.2, 0.3],
        ]
    )
    boxes[4:, 4] = 0.0  # walls with round ends
    boxes[5, 3] = 0.0  # a disc
    grid = make_occupancy_grid(ARENA)
    block_rectangles(grid, boxes, RADIUS)
    assert grid.blocked.shape == (80, 60)
    for i in range(80):
        for j in range(60):
            # Two rectangles' distance, one of no extent.
            speck = np.array([-1.975 + 0.05 * i, -1.475 + 0.05 * j, 0.0, 0.0, 0.0, 0.0])
            off = min(rectangle_clearance(speck, box) for box in boxes)
            assert grid.blocked[i, j] == (off < RADIUS), (i, j, off)


def test_discs_grow_as_a_distance_transform_does():
    """From a disc in the middle of a cell, the transform is exact."""
    grid = make_occupancy_grid(ARENA)
    marks = np.ones((80, 60), dtype=bool)
    places = [(3, 5), (40, 22), (79, 59)]
    discs = np.array([[*cell_middle(grid, i, j), 0.1] for i, j in places])
    for place in places:
        marks[place] = False
    block_discs(grid, sorted_discs(discs), RADIUS - 0.003)
    off = 0.05 * distance_transform_edt(marks)
    np.testing.assert_array_equal(grid.blocked, off < RADIUS + 0.1 - 0.003)


def test_cells_and_their_middles():
    grid = make_occupancy_grid(ARENA)
    assert cell_of(grid, -1.99, -1.49) == (0, 0)
    assert cell_of(grid, 1.99, 1.49) == (79, 59)
    assert cell_of(grid, 2.01, 0.0) == (-1, -1)
    assert cell_of(grid, 0.0, -1.51) == (-1, -1)
    assert cell_middle(grid, 40, 30) == pytest.approx((0.025, 0.025))


def test_the_grid_of_a_map_holds_points_and_corners():
    """A square of 1 m turned by 45 deg reaches sqrt(1/2) from its middle."""
    box = np.array([[2.0, 3.0, math.pi / 4.0, 1.0, 1.0, 0.0]])
    grid = free_grid([(0, 0), (5, -1)], box)
    assert grid.low == pytest.approx((-ARENA_MARGIN_M, -1.0 - ARENA_MARGIN_M))
    top = 3.0 + math.sqrt(0.5) + ARENA_MARGIN_M
    assert grid.blocked.shape == (180, math.ceil((top + 3.0) / 0.05))
    assert not grid.blocked.any()
    assert free_grid([(1, 2), (3, 4)], []).low == (-1.0, 0.0)
