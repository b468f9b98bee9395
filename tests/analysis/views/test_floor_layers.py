"""Layers put together again are the floor at every time."""

from __future__ import annotations

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, strategies as st

from analysis.runs.known_space import KnownSpace
from analysis.views.floor_layers import clipped, floor_layers, merged_cells


def of_cells(cells):
    count = len(cells)
    return KnownSpace(
        np.arange(float(count)), (-1.0, 2.0), 0.25, cells, np.zeros(cells.shape)
    )


def painted(rectangles, shape):
    """How often each cell is covered; middles decide, as a rectangle has no gaps."""
    x = -1.0 + 0.25 * (np.arange(shape[0]) + 0.5)
    y = 2.0 + 0.25 * (np.arange(shape[1]) + 0.5)
    count = np.zeros(shape, dtype=int)
    for x_low, x_high, y_low, y_high in rectangles:
        inside_x, inside_y = (x > x_low) & (x < x_high), (y > y_low) & (y < y_high)
        count += np.outer(inside_x, inside_y)
    return count


@given(
    arrays.arrays(
        bool, st.tuples(st.integers(1, 5), st.integers(1, 7), st.integers(1, 7))
    ),
    st.booleans(),
)
def test_layers_are_the_cells_at_every_time(cells, whole):
    layers = floor_layers(of_cells(cells), cells, whole=whole)
    for k, there in enumerate(cells):
        now = [each.rectangles for each in layers if each.begin <= k < each.end]
        together = np.concatenate([np.zeros((0, 4)), *now])
        assert np.array_equal(painted(together, there.shape), there * 1)


def test_what_stays_is_one_rectangle():
    cells = np.zeros((3, 4, 5), dtype=bool)
    cells[1:, 1:3, 1:4] = True
    (layer,) = floor_layers(of_cells(cells), cells)
    assert (layer.begin, layer.end) == (1, 3)
    assert layer.rectangles == pytest.approx(np.array([[-0.75, -0.25, 2.25, 3.0]]))


def test_an_l_is_two_rectangles():
    cells = np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool)
    assert merged_cells(cells).tolist() == [[0, 1, 0, 3], [1, 3, 0, 1]]


def test_nothing_is_no_layer():
    cells = np.zeros((2, 3, 3), dtype=bool)
    assert floor_layers(of_cells(cells), cells) == []
    assert merged_cells(cells[0]).shape == (0, 4)


def test_rectangles_are_cut_off_at_the_floor():
    rectangles = np.array([[0.0, 2.0, 0.0, 2.0], [3.0, 4.0, 0.0, 1.0]])
    assert clipped(rectangles, (1.0, 2.5, -1.0, 1.5)).tolist() == [[1.0, 2.0, 0.0, 1.5]]
