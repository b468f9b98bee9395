"""The velocity nearest to a wanted one: against SciPy's optimizer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from systems.planning.half_planes import nearest_velocity

TOP = 0.6


def drawn(seed, count):
    random = np.random.default_rng(seed)
    angles = random.uniform(0.0, math.tau, count)
    offsets = random.uniform(-0.5, 0.25, count)
    planes = np.column_stack([np.cos(angles), np.sin(angles), offsets])
    return planes, tuple(random.uniform(-0.6, 0.6, 2))


def slack(planes, velocity):
    """By how much the worst of the planes is broken, m/s."""
    return max(0.0, np.max(planes[:, 2] - planes[:, :2] @ velocity, initial=0.0))


def solved(planes, wanted):
    """The least slack first, then the nearest velocity with it, by SLSQP."""
    ball = {"type": "ineq", "fun": lambda v: TOP**2 - v[0] ** 2 - v[1] ** 2}
    within = {
        "type": "ineq",
        "fun": lambda v: planes[:, :2] @ v[:2] - planes[:, 2] + v[2],
    }
    start = [0.0, 0.0, 2.0]
    bounds = [(None, None), (None, None), (0.0, None)]
    first = minimize(
        lambda v: v[2], start, constraints=[ball, within], bounds=bounds, tol=1e-12
    )
    assert first.success
    least = max(first.x[2], 0.0)
    kept = {
        "type": "ineq",
        "fun": lambda v: planes[:, :2] @ v - planes[:, 2] + least + 1e-9,
    }
    second = minimize(
        lambda v: np.sum((v - wanted) ** 2),
        first.x[:2],
        constraints=[ball, kept],
        tol=1e-12,
    )
    return second.x, least


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_it_is_the_optimum(count):
    infeasible = 0
    for seed in range(25):
        planes, wanted = drawn(seed, count)
        *xy, moved = nearest_velocity(planes, wanted, TOP, 0)
        found = np.array(xy)
        best, least = solved(planes, wanted)
        assert moved == pytest.approx(least, abs=1e-5)
        infeasible += least > 1e-6
        assert math.hypot(*found) <= TOP + 1e-6
        assert slack(planes, found) == pytest.approx(least, abs=1e-5)
        if least < 1e-6:
            far = np.linalg.norm(found - wanted)
            assert far == pytest.approx(np.linalg.norm(best - wanted), abs=1e-4)
    assert count < 6 or infeasible > 0


def test_nothing_in_the_way():
    nothing = np.empty((0, 3))
    assert nearest_velocity(nothing, (0.3, -0.2), TOP, 0) == (0.3, -0.2, 0.0)
    found = nearest_velocity(nothing, (3.0, -4.0), TOP, 0)[:2]
    assert found == pytest.approx((0.36, -0.48))
    assert nearest_velocity(nothing, (0.0, 0.0), TOP, 0) == (0.0, 0.0, 0.0)


def test_hard_planes_are_not_moved():
    """Away from a wall by 0.2 m/s at least, and no faster than 0.1 m/s along x."""
    planes = np.array([[1.0, 0.0, 0.2], [-1.0, 0.0, -0.1], [1.0, 0.0, -0.1]])
    x, y, moved = nearest_velocity(planes, (-0.4, 0.3), TOP, 2)
    assert (x, y) == pytest.approx((0.1, 0.3), abs=1e-6)
    assert moved == pytest.approx(0.1, abs=1e-6)
    x, y, moved = nearest_velocity(planes, (-0.4, 0.3), TOP, 0)
    assert (x, moved) == pytest.approx((0.15, 0.05), abs=1e-6)
