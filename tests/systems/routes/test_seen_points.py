"""What is remembered of objects, slot by slot."""

from __future__ import annotations

import numpy as np
import pytest

from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.routes.occupancy_grid import make_occupancy_grid
from systems.routes.seen_points import (
    discs_to_avoid,
    is_at_rest,
    make_seen_points,
    remember_objects,
)

ARENA = (-2.0, -2.0, 2.0, 2.0)
P = (0.5, -0.5)
NOTHING = np.empty((0, 6))


def slots(*objects):
    """There, x, y, vx, vy, velocity known, radius, is a robot; the rest is empty."""
    port = np.zeros((OBJECT_SLOTS, OBJECT_SIZE))
    port[: len(objects)] = np.reshape(objects, (-1, OBJECT_SIZE))
    return port.ravel()


def remembered(*objects, rectangles=NOTHING):
    grid = make_occupancy_grid(ARENA)
    seen = make_seen_points(grid)
    remember_objects(seen, grid, rectangles, slots(*objects), P, 0.0)
    return seen.points[: seen.added[0]]


def test_nearest_points_of_what_rests_or_may_rest():
    found = remembered(
        (1, 0.6, 0.0, 0, 0, 1, 0.2, 0),
        (1, 0.0, 0.7, 0.0, 0, 0, 0, 0),
        (1, 1.0, 1.0, 0.01, 0.01, 1, 0, 0),
    )
    assert found == pytest.approx(np.array([[1.1, -0.5], [0.5, 0.2], [1.5, 0.5]]))


@pytest.mark.parametrize(
    "slot",
    [
        (0, 0.6, 0.0, 0, 0, 0, 0, 0),
        (1, 0.6, 0.0, 0.1, 0, 1, 0.2, 0),
        (1, 0.6, 0.0, 0, 0, 1, 0.2, 1),
        (1, 1.6, 0.0, 0, 0, 1, 0, 0),
        (1, -2.1, 0.0, 0, 0, 1, 0, 0),
    ],
    ids=["empty", "moves", "robot", "off the arena", "far"],
)
def test_what_is_not_remembered(slot):
    assert len(remembered(slot)) == 0


def test_what_the_map_has_is_not_remembered():
    box = np.array([[1.3, -0.5, 0.0, 0.4, 0.4, 0.0]])
    at_box, beside = (1, 0.6, 0.0, 0, 0, 1, 0, 0), (1, 0.5, 0.3, 0, 0, 1, 0, 0)
    found = remembered(at_box, beside, rectangles=box)
    assert found == pytest.approx(np.array([[1.0, -0.2]]))


def test_one_point_a_cell_and_the_oldest_are_forgotten():
    grid = make_occupancy_grid((0.0, 0.0, 6.0, 6.0))
    seen = make_seen_points(grid)
    assert len(seen.points) == 4000
    for k in range(5000):
        x, y = 0.05 * (k % 120) + 0.02, 0.05 * (k // 120) + 0.01
        for shift in (0.0, 0.02):
            port = slots((1, shift, 0, 0, 0, 0, 0, 0))
            remember_objects(seen, grid, NOTHING, port, (x, y), 0.0)
    assert seen.added[0] == 5000
    assert (seen.rows >= 0).sum() == 4000
    # The first thousand made room for the last.
    assert seen.points[0] == pytest.approx([0.05 * (4000 % 120) + 0.02, 0.05 * 33.2])
    assert seen.rows[0, 0] == -1
    assert seen.rows[120 - 1, 40] == 4919 - 4000


@pytest.mark.parametrize(
    ("speed_m_s", "unseen", "rests"),
    [
        (0.0, (), True),
        (0.04, (), True),
        (0.06, (), False),
        # 0.9 s without an echo are bridged; 1.1 s are not, and only 1.9 s remain.
        (0.0, (1.0, 1.9), True),
        (0.0, (1.0, 2.1), False),
    ],
)
def test_what_stays_near_a_place_for_3_s_is_at_rest(speed_m_s, unseen, rests):
    """Within 0.15 m, so at most 0.05 m/s: the first point of something that moves."""
    grid = make_occupancy_grid(ARENA)
    seen = make_seen_points(grid)
    for time in np.arange(0.0, 3.01, 0.1):
        assert not is_at_rest(seen, 0)
        if unseen and unseen[0] < time < unseen[1] + 0.05:
            continue
        port = slots((1, 0.6 + speed_m_s * time, 0.0, 0, 0, 0, 0.0, 0))
        remember_objects(seen, grid, NOTHING, port, P, time)
    assert is_at_rest(seen, 0) == rests
    # Once at rest, it stays so.
    remember_objects(seen, grid, NOTHING, slots((1, 0.6, 0, 0, 0, 0, 0, 0)), P, 60.0)
    assert is_at_rest(seen, 0) == rests


def test_routes_keep_off_robots_that_rest_for_now():
    grid = make_occupancy_grid(ARENA)
    seen = make_seen_points(grid)
    box = (1, 0.6, 0.0, 0, 0, 0, 0, 0)
    rests, moves = (1, 0, -0.8, 0, 0, 1, 0.15, 1), (1, 0.9, 0, 0, 0.1, 1, 0.15, 1)
    port = slots(box, rests, moves)
    remember_objects(seen, grid, NOTHING, port, P, 0.0)
    expected = [[0.5, -0.5 - 0.95, 0.15], [1.1, -0.5, 0.0]]
    discs = discs_to_avoid(seen, port, P)
    assert discs.rows == pytest.approx(np.array(expected))
    assert discs.largest == 0.15
    only_seen = discs_to_avoid(seen, slots(), P)
    assert only_seen.rows == pytest.approx(np.array(expected[1:]))
