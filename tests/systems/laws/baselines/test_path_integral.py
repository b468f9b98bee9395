"""MPPI: distances against SciPy's, and means against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from systems.base.robot import RobotParameters
from systems.laws.baselines.path_integral_controller import (
    _roll_numbers,
    _turn_first,
    distance_field,
    outline_points,
    price_unseen,
    roll_out,
)
from systems.laws.path_integral import PathIntegralParameters
from systems.planning.route_approach import Approach
from systems.safety.free_space import make_free_space

CELL_M = 0.05
START = 0.0, 0.0, 0.0


def test_distances_are_at_most_a_twelfth_too_long():
    random = np.random.default_rng(1)
    places = np.column_stack([random.uniform(-2.0, 2.0, (30, 2)), np.zeros(30)])
    field = distance_field(places, 0.0, 0.0, 2.0, CELL_M)
    exact = distance_transform_edt(field > 0.0) * CELL_M
    assert len(field) == 81
    assert (field >= exact - 1e-9).all()
    assert (field <= 1.083 * exact + 1e-9).all()


def test_places_are_where_they_are():
    field = distance_field(np.array([[3.5, -1.0, 0.0]]), 3.0, -1.0, 2.0, CELL_M)
    assert np.argwhere(field == 0.0).tolist() == [[50, 40]]
    assert (distance_field(np.empty((0, 3)), 0.0, 0.0, 1.0, CELL_M) > 1e5).all()


def test_a_cell_of_the_target_counts_as_farther_away():
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.05], [1.0, 0.0, 0.3]])
    field = distance_field(places, 0.0, 0.0, 2.0, CELL_M)
    np.testing.assert_allclose(
        field[[40, 50, 58, 60, 62], 40], [0, 0.5, 0.15, 0.05, 0.15]
    )


def rolled(own, noise, goal, *, field=None, rounds=1):
    """The plan after some rounds, each from the plan of the last."""
    controls = np.zeros((noise.shape[-2], 2))
    numbers = _roll_numbers(own, RobotParameters())
    if field is None:
        field = distance_field(np.empty((0, 3)), 0.0, 0.0, 2.5, CELL_M)
    for k in range(rounds):
        roll_out(controls, noise[k], START, goal, field, CELL_M, numbers)
    return controls


GAINS = {"angle_gain": 0.0, "obstacle_gain": 0.0}


def test_weights_are_those_of_the_costs():
    """Straight ahead the cost is that of the distance: by hand for each sample."""
    own = PathIntegralParameters(**GAINS)
    random = np.random.default_rng(2)
    noise = np.zeros((1, 10, 5, 2))
    noise[0, :, :, 0] = random.uniform(0.0, 3.0, (10, 1))
    goal = (1.0, 0.0, 0.0, 0.0)
    found = rolled(own, noise, goal)
    speeds = np.minimum(0.2 * noise[0, :, 0, 0], 0.62)
    times = 0.1 * np.arange(1, 6)
    ahead = RobotParameters().control_point_m
    costs = 5.0 * np.mean(1.0 - ahead - np.outer(speeds, times), axis=1)
    weights = np.exp(-costs / own.temperature)
    expected = weights @ speeds / weights.sum()
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], 0.0)


def test_a_cold_choice_is_the_best_sample():
    own = PathIntegralParameters(temperature=1e-6, **GAINS)
    noise = np.zeros((1, 10, 5, 2))
    noise[0, :, :, 0] = np.linspace(-0.5, 2.0, 10)[:, None]
    found = rolled(own, noise, (9.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(found[:, 0], 0.2 * 2.0, rtol=1e-9)


def test_it_goes_to_where_the_goal_will_be():
    """A goal that moves aside: the plan turns after it."""
    own = PathIntegralParameters()
    noise = np.random.default_rng(3).standard_normal((1, 500, 25, 2))
    left = rolled(own, noise, (1.0, 0.0, 0.0, 0.4))
    right = rolled(own, noise, (1.0, 0.0, 0.0, -0.4))
    assert left[:8, 1].mean() > 0.2
    assert right[:8, 1].mean() < -0.2


def test_it_does_not_drive_into_a_wall():
    own = PathIntegralParameters(temperature=0.02)
    noise = np.random.default_rng(4).standard_normal((10, 400, 25, 2))
    wall = np.array([(0.6, 0.05 * k, 0.0) for k in range(-60, 61)])
    field = distance_field(wall, 0.0, 0.0, 2.5, CELL_M)
    goal = 2.0, 0.0, 0.0, 0.0
    free = rolled(own, noise, goal, rounds=10)
    stopped = rolled(own, noise, goal, field=field, rounds=10)
    assert free[:, 0].sum() * 0.1 > 0.6
    # The body reaches 0.175 m ahead, and is kept off by the discs' rounding.
    assert stopped[:, 0].sum() * 0.1 < 0.6 - 0.175


@pytest.mark.parametrize("half", [(0.175, 0.41), (0.6, 0.25), (0.25, 0.25), (0.1, 0.7)])
def test_points_are_on_the_outline_and_near_each_other(half):
    """Walking the four sides, the next point is at most 0.05 m away."""
    points = outline_points(*half)
    share = np.abs(points) / half
    assert (share <= 1.0).all()
    np.testing.assert_allclose(share.max(axis=1), 1.0)
    for axis in range(2):
        side = np.linspace(-half[1 - axis], half[1 - axis], 101)
        for sign in (-1.0, 1.0):
            walk = np.full((101, 2), sign * half[axis])
            walk[:, 1 - axis] = side
            far = np.linalg.norm(walk[:, None] - points[None], axis=2).min(axis=1)
            assert far.max() <= 0.05 + 1e-9


def test_unseen_floor_costs_as_much_as_floor_near_an_obstacle():
    """One inflation length beyond the clearance, wherever nothing was seen free."""
    space = make_free_space(200, CELL_M, 1, 2)
    space.free_until[:20] = np.inf  # x from 0 to 1 m
    numbers = _roll_numbers(PathIntegralParameters(), RobotParameters())
    field = distance_field(np.array([[2.025, 0.025, 0.0]]), 0.025, 0.025, 2.5, CELL_M)
    before = field.copy()
    price_unseen(field, space, 0.025, 0.025, numbers)
    free = slice(50, 70)
    np.testing.assert_array_equal(field[free], before[free])
    unseen = np.delete(field, free, axis=0)
    limit = numbers.clearance_m + numbers.inflation_m
    assert unseen.max() == pytest.approx(limit)
    assert unseen.min() == 0.0


def test_it_turns_on_the_spot_to_what_is_behind_it():
    """A corridor 1.2 m wide, the diagonal of the body is 0.89 m (Nav2, issue 4049)."""
    approach = Approach(0.6, -1.5, 0.0, 1.5, 0.0)
    wide = 0.205, 0.44
    corridor = np.array(
        [(0.05 * k, y, 1.0) for k in range(-40, 41) for y in (-0.6, 0.6)]
    )
    assert abs(_turn_first(corridor, START, approach, wide)) == pytest.approx(2.0)
    narrow = corridor * (1.0, 0.78, 1.0)
    assert _turn_first(narrow, START, approach, wide) == 0.0
    ahead = approach._replace(x=1.5)
    assert _turn_first(corridor, START, ahead, wide) == 0.0
