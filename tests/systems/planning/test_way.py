"""Ways against SciPy's Dijkstra, and what cells cost against plain distances."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from systems.planning.carrot import find_carrot
from systems.planning.way import (
    ACROSS,
    DOUBTFUL,
    FREE,
    NEAR,
    OCCUPIED,
    STRAIGHT,
    TIGHT,
    UNKNOWN,
    find_way,
    make_way,
    mark_blocked,
)
from systems.safety.free_space import make_free_space

CELLS, NARROW, RADIUS = 80, 0.43, 0.466
WIDTHS = NARROW, RADIUS


def known_space(*, free=True):
    """4 m x 4 m around the origin in cells of 5 cm, all seen free or not."""
    space = make_free_space(CELLS, 0.05, 1, 2)
    if free:
        space.free_until[:] = math.inf
    return space


def echoes(space, x, y, hits):
    """Echoes from the cell of a place, which is not seen free."""
    at = math.floor(x / 0.05) % CELLS, math.floor(y / 0.05) % CELLS
    space.hits[at], space.free_until[at] = hits, -1.0


def seek(way, space, start, goal, time):
    """Echoes within 30 cm of the goal are its own."""
    find_way(way, space, start, goal, time, WIDTHS, np.array([[*goal, 0.3]]))


def cost_by_scipy(price, start, goal):
    """Least cost by another program: a step costs the price of the cell it leads to
    the goal from."""
    size = len(price)
    rows, columns, costs = [], [], []
    for i in range(size):
        for j in range(size):
            for di, dj in ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (1, -1)):
                a, b = i + di, j + dj
                if 0 <= a < size and 0 <= b < size:
                    rows.append(i * size + j)
                    columns.append(a * size + b)
                    step = STRAIGHT if di * dj == 0 else ACROSS
                    costs.append(step * price[i, j])
            if i and j:
                rows.append(i * size + j)
                columns.append((i - 1) * size + j - 1)
                costs.append(ACROSS * price[i, j])
    graph = coo_array((costs, (rows, columns)), shape=(size**2, size**2)).tocsr()
    return dijkstra(graph, indices=goal)[start]


@pytest.mark.parametrize("seed", range(5))
def test_a_way_costs_what_dijkstra_finds(seed):
    generator = np.random.default_rng(seed)
    space, way = known_space(), make_way(CELLS)
    for x, y in generator.uniform(-1.5, 1.5, (8, 2)):
        echoes(space, x, y, generator.choice([2.0, 9.0]))
    space.free_until[:, : CELLS // 4] = -1.0
    start, goal = generator.uniform(-1.9, 1.9, (2, 2))
    seek(way, space, tuple(start), tuple(goal), 0.0)
    size = CELLS // 2
    (si, sj), (gi, gj) = (np.floor(p / 0.1).astype(int) + 20 for p in (start, goal))
    assert way.cost[si, sj] == cost_by_scipy(way.price, si * size + sj, gi * size + gj)
    points = way.path[: way.points[0]]
    np.testing.assert_allclose(points[0], (np.array([si, sj]) - 19.5) * 0.1)
    np.testing.assert_allclose(points[-1], (np.array([gi, gj]) - 19.5) * 0.1)
    steps = np.abs(np.diff(points, axis=0))
    assert steps.max() < 0.1 + 1e-9
    assert way.length_m[0] == pytest.approx(np.hypot(*steps.T).sum())


def test_prices_go_by_distance_from_the_cell_that_echoed():
    space, way = known_space(), make_way(CELLS)
    echoes(space, 0.51, 0.01, 9.0)
    seek(way, space, (-1.0, -1.0), (-1.5, 1.5), 0.0)
    for i in range(CELLS // 2):
        for j in range(CELLS // 2):
            x, y = (i - 19.5) * 0.1, (j - 19.5) * 0.1
            dx = max(0.5 - x, 0.0, x - 0.55)
            dy = max(0.0 - y, 0.0, y - 0.05)
            distance = math.hypot(dx, dy)
            bands = [(NARROW, OCCUPIED), (RADIUS + 0.07, TIGHT), (RADIUS + 0.19, NEAR)]
            expected = next((p for limit, p in bands if distance < limit), FREE)
            # The cell itself was not seen free.
            assert way.price[i, j] == expected, (x, y)


def test_what_echoed_seldom_is_doubtful_and_what_is_unseen_dearer():
    space, way = known_space(free=False), make_way(CELLS)
    echoes(space, 0.51, 0.01, 2.0)
    seek(way, space, (-1.0, -1.0), (-1.5, 1.5), 0.0)
    assert way.price[25, 20] == DOUBTFUL
    assert way.price[0, 0] == UNKNOWN


def test_echoes_from_the_goal_are_no_obstacle():
    space, way = known_space(), make_way(CELLS)
    echoes(space, 0.51, 0.01, 9.0)
    seek(way, space, (-1.0, 0.0), (0.7, 0.0), 0.0)
    # But for the cell that was not seen free.
    assert sorted(np.unique(way.price)) == [FREE, UNKNOWN]


def test_marks_hold_for_their_time():
    space, way = known_space(), make_way(CELLS)
    mark_blocked(way, (0.5, 0.0), 10.0)
    for time, price in ((9.9, OCCUPIED), (10.1, FREE)):
        seek(way, space, (-1.0, 0.0), (1.5, 0.0), time)
        assert way.price[25, 20] == price


def test_the_carrot_is_in_sight():
    """Around a wall the way turns its end: the carrot is no farther than that."""
    space, way = known_space(), make_way(CELLS)
    for y in np.arange(-2.0, 0.6, 0.05):
        echoes(space, 0.01, y + 0.01, 9.0)
    seek(way, space, (-1.2, -1.0), (1.2, -1.0), 0.0)
    x, y = find_carrot(way, -1.2, -1.0, 5.0)
    # 0.466 m around the wall's end at (0, 0.6), which the disc just passes.
    assert -0.8 < x < 0.2
    assert 0.4 < y < 1.3
    for part in np.linspace(0.0, 1.0, 50):
        a, b = -1.2 + part * (x + 1.2), -1.0 + part * (y + 1.0)
        assert math.hypot(a - 0.0, max(b - 0.6, 0.0)) > RADIUS - 0.15 or b > 0.6


def test_the_carrot_is_straight_ahead_where_nothing_is():
    space, way = known_space(), make_way(CELLS)
    seek(way, space, (-1.5, 0.05), (1.5, 0.05), 0.0)
    assert find_carrot(way, -1.5, 0.05, 1.5) == pytest.approx((-0.05, 0.05))
    assert find_carrot(way, -1.5, 0.05, 9.0) == pytest.approx((1.55, 0.05))


def test_a_goal_beyond_the_window_is_headed_for_at_its_edge():
    space, way = known_space(), make_way(CELLS)
    seek(way, space, (0.05, 0.05), (30.0, 0.05), 0.0)
    assert way.path[way.points[0] - 1] == pytest.approx((1.95, 0.05))
