"""A* against SciPy's Dijkstra on the same neighbors."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from systems.routes.grid_search import search_cells


def cost_by_dijkstra(blocked, start, goal):
    """The graph whole, of all pairs of neighbors."""
    n, m = blocked.shape
    number = np.arange(n * m).reshape(n, m)
    free = np.pad(~blocked, 1)
    here = np.s_[1 : n + 1, 1 : m + 1]
    rows, columns, costs = [], [], []
    for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):

        def shifted(a, b):
            return free[1 + a : n + 1 + a, 1 + b : m + 1 + b]

        there = free[here] & shifted(di, dj) & shifted(di, 0) & shifted(0, dj)
        rows.append(number[there])
        columns.append(number[there] + di * m + dj)
        costs.append(np.full(there.sum(), math.hypot(di, dj)))
    entries = np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))
    graph = coo_array(entries, shape=(n * m, n * m)).tocsr()
    found = dijkstra(graph, directed=False, indices=number[start])
    return found[number[goal]]


def random_grid(seed, size):
    generator = np.random.default_rng(seed)
    blocked = generator.random((size, size)) < generator.uniform(0.1, 0.4)
    start, goal = (tuple(generator.integers(0, size, 2).tolist()) for _ in range(2))
    blocked[start] = blocked[goal] = False
    return blocked, start, goal


def test_cost_is_dijkstras_and_no_corner_is_cut():
    ways = 0
    for seed in range(100):
        blocked, start, goal = random_grid(seed, 100)
        cells, cost = (
            search_cells(blocked, start, goal),
            cost_by_dijkstra(blocked, start, goal),
        )
        if not len(cells):
            assert cost == math.inf
            continue
        ways += 1
        steps = np.diff(cells, axis=0)
        assert tuple(cells[0]) == start
        assert tuple(cells[-1]) == goal
        assert np.abs(steps).max(initial=0) <= 1
        assert np.hypot(*steps.T).sum() == pytest.approx(cost, abs=1e-9)
        assert not blocked[tuple(cells.T)].any()
        (i, j), (di, dj) = cells[:-1].T, steps.T
        assert not (blocked[i + di, j] | blocked[i, j + dj]).any()
    assert 60 < ways < 100


def test_a_step_between_two_corners_is_none():
    blocked = np.zeros((2, 2), dtype=bool)
    blocked[0, 1] = True
    round_it = [[0, 0], [1, 0], [1, 1]]
    np.testing.assert_array_equal(search_cells(blocked, (0, 0), (1, 1)), round_it)
    blocked[1, 0] = True
    assert len(search_cells(blocked, (0, 0), (1, 1))) == 0


def test_walled_in_or_blocked_is_none():
    blocked = np.zeros((9, 9), dtype=bool)
    blocked[2:7, 2:7] = True
    blocked[3:6, 3:6] = False
    assert len(search_cells(blocked, (0, 0), (4, 4))) == 0
    assert len(search_cells(blocked, (4, 4), (0, 0))) == 0
    assert len(search_cells(blocked, (0, 0), (2, 2))) == 0
    assert len(search_cells(blocked, (2, 2), (0, 0))) == 0
    np.testing.assert_array_equal(search_cells(blocked, (4, 4), (4, 4)), [[4, 4]])


def test_a_large_grid_is_searched_at_once():
    """200 x 200 cells, median of 5 maps, within 60 ms."""
    search_cells(np.zeros((3, 3), dtype=bool), (0, 0), (2, 2))
    took = []
    for seed in range(5):
        blocked = np.random.default_rng(seed).random((200, 200)) < 0.25
        blocked[:2] = blocked[-2:] = False
        begin = time.process_time()
        assert len(search_cells(blocked, (0, 0), (199, 199)))
        took.append(time.process_time() - begin)
    assert np.median(took) < 0.06
