"""ORCA: its half planes against velocities that are tried, one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.laws.baselines.reciprocal_avoidance_controller import avoid_body

RADIUS, HORIZON = 0.5, 3.0


def hits(relative, half, velocity, radius=RADIUS, horizon=HORIZON):
    """Whether a disc at the origin comes to touch the rectangle, by small steps."""
    c, s = math.cos(relative[2]), math.sin(relative[2])
    times = np.linspace(0.0, horizon, 3001)[1:]
    dx = velocity[0] * times - relative[0]
    dy = velocity[1] * times - relative[1]
    u = np.maximum(np.abs(c * dx + s * dy) - half[0], 0.0)
    w = np.maximum(np.abs(c * dy - s * dx) - half[1], 0.0)
    return bool((np.hypot(u, w) < radius).any())


def drawn(seed):
    random = np.random.default_rng(seed)
    far, bearing = random.uniform(1.3, 3.0), random.uniform(0.0, math.tau)
    relative = (
        far * math.cos(bearing),
        far * math.sin(bearing),
        random.uniform(0.0, math.tau),
    )
    # Some toward the body, some anywhere.
    toward = np.array(relative[:2]) / far * random.uniform(0.3, 1.0)
    velocity = toward * (seed % 2) + random.uniform(-0.5, 0.5, 2)
    return relative, tuple(random.uniform(0.05, 0.5, 2)), tuple(velocity)


@pytest.mark.parametrize("seed", range(40))
def test_the_plane_touches_the_obstacle_where_it_is_nearest(seed):
    """The velocity is moved to the rim, and no velocity nearer changes sides."""
    relative, half, velocity = drawn(seed)
    nx, ny, offset = avoid_body(relative, half, RADIUS, velocity, HORIZON)
    assert math.hypot(nx, ny) == pytest.approx(1.0)
    change = offset - nx * velocity[0] - ny * velocity[1]
    inside = hits(relative, half, velocity)
    assert (change > 0.0) == inside
    past = 1.0 + 0.02 / abs(change)
    for part, still in ((0.97, True), (past, False)):
        tried = velocity[0] + part * change * nx, velocity[1] + part * change * ny
        assert hits(relative, half, tried) == (inside is still)
    for angle in np.linspace(0.0, math.tau, 72):
        step = 0.97 * abs(change)
        tried = (
            velocity[0] + step * math.cos(angle),
            velocity[1] + step * math.sin(angle),
        )
        assert hits(relative, half, tried) == inside


def test_head_on_with_a_point_is_the_closed_form():
    """On the axis the cut-off decides: |v| <= (d - r)/tau, with the normal back."""
    nx, ny, offset = avoid_body(
        (2.0, 0.0, 0.0), (0.0, 0.0), RADIUS, (0.5, 0.0), HORIZON
    )
    assert (nx, ny) == pytest.approx((-1.0, 0.0))
    assert offset == pytest.approx(-(2.0 - RADIUS) / HORIZON)


def test_fast_ones_leave_by_a_leg():
    """The leg's tangent is asin(r/d) off the axis (van den Berg, fig. 1)."""
    nx, ny, offset = avoid_body(
        (2.0, 0.0, 0.0), (0.0, 0.0), RADIUS, (2.0, 0.1), HORIZON
    )
    half_angle = math.asin(RADIUS / 2.0)
    assert (nx, ny) == pytest.approx((-math.sin(half_angle), math.cos(half_angle)))
    assert offset == pytest.approx(0.0, abs=1e-12)


def test_turning_all_turns_the_plane():
    one = avoid_body((1.5, 0.4, 0.3), (0.3, 0.1), RADIUS, (0.5, 0.2), HORIZON)
    c, s = math.cos(1.1), math.sin(1.1)

    def turned(x, y):
        return c * x - s * y, s * x + c * y

    other = avoid_body(
        (*turned(1.5, 0.4), 1.4), (0.3, 0.1), RADIUS, turned(0.5, 0.2), HORIZON
    )
    assert other == pytest.approx((*turned(*one[:2]), one[2]))


@pytest.mark.parametrize("place", [(0.4, 0.0), (0.05, 0.0), (0.0, -0.2)])
def test_in_contact_it_has_to_leave(place):
    """The plane asks for a speed away from the body."""
    nx, ny, offset = avoid_body((*place, 0.0), (0.1, 0.1), RADIUS, (0.0, 0.0), HORIZON)
    assert offset > 0.0
    assert nx * place[0] + ny * place[1] < 0.0
