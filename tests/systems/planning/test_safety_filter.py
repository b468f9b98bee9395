"""The filter against closed forms, simulated meetings and what wheels can do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from phonotaxis.testing import Bench
from systems.base.robot import RobotParameters
from systems.framework.block import Step
from systems.planning.safety_filter import SafetyFilter
from systems.planning.velocity_filter import (
    FilterNumbers,
    disc_plane,
    filtered_velocity,
    wheel_planes,
)

BURGER = RobotParameters.model_validate({"preset": "turtlebot3_burger"})
KEEP = 0.5 * math.hypot(0.138, 0.178) + 0.08 + 0.05
NUMBERS = FilterNumbers(KEEP, 0.22, 1.0)
#: No half planes of the outline.
NONE = np.empty((0, 3))


def objects_of(*slots):
    flat = np.zeros(64)
    for k, slot in enumerate(slots):
        flat[8 * k : 8 * k + len(slot)] = slot
    return flat


def meets(center, radius, velocity, horizon):
    """Least distance from a disc's middle within a horizon, less its radius, m."""
    times = np.linspace(0.0, horizon, 4001)
    ways = np.outer(times, velocity)
    return np.min(np.hypot(*(ways - center).T)) - radius


def test_the_plane_of_a_disc_parts_what_meets_it_from_what_does_not():
    """Moved out by what it says, a velocity just touches; random discs and speeds."""
    draw = np.random.default_rng(2)
    for _ in range(300):
        bearing, far = draw.uniform(0, math.tau), draw.uniform(0.5, 2.0)
        center = far * math.cos(bearing), far * math.sin(bearing)
        velocity, radius = draw.uniform(-0.6, 0.6, 2), draw.uniform(0.1, 0.45)
        nx, ny, inside = disc_plane(center, radius, velocity, 4.0, 0.025)
        assert math.hypot(nx, ny) == pytest.approx(1.0)
        assert (inside > 0.0) == (meets(center, radius, velocity, 4.0) < 0.0)
        moved = velocity + inside * np.array([nx, ny])
        assert meets(center, radius, moved, 4.0) == pytest.approx(0.0, abs=2e-3)


def test_what_overlaps_is_left_within_a_tick():
    nx, ny, inside = disc_plane((0.2, 0.0), 0.3, (0.1, 0.0), 4.0, 0.025)
    assert (nx, ny) == pytest.approx((-1.0, 0.0))
    left = 0.2 - 0.025 * (0.1 - inside)
    assert left == pytest.approx(0.3)


def test_wheels_can_do_what_their_planes_allow():
    draw = np.random.default_rng(4)
    for _ in range(200):
        theta, velocity = draw.uniform(-3, 3), draw.uniform(-0.4, 0.4, 2)
        c, s = math.cos(theta), math.sin(theta)
        ahead, aside = (
            c * velocity[0] + s * velocity[1],
            c * velocity[1] - s * velocity[0],
        )
        turn = aside / 0.08
        rims = abs(ahead + 0.08 * turn), abs(ahead - 0.08 * turn)
        planes = wheel_planes(theta, NUMBERS)
        allowed = np.all(planes[:, :2] @ velocity >= planes[:, 2] - 1e-12)
        assert allowed == (max(rims) <= 0.22)


def test_a_wall_is_approached_by_a_share_of_what_is_left():
    """d - d_s falls as exp(-alpha t) and does not pass 0."""
    far, v = 1.0, 0.0
    for tick in range(400):
        wall = objects_of([1, far, 0.0, 0.0, 0.0, 1])
        given = (0.22, 0.0), (v, 0.0), 0.0, wall, NONE, NUMBERS
        v, aside, slack = filtered_velocity(*given)
        far -= 0.025 * v
        assert far > KEEP
        assert (aside, slack) == (0.0, 0.0)
        if tick == 160:
            begin = far - KEEP
        if tick == 240:  # 2 s later, at (1 - alpha T) a tick
            assert far - KEEP == pytest.approx(begin * 0.975**80, rel=1e-9)
            assert far - KEEP == pytest.approx(begin * math.exp(-2.0), rel=0.03)


def test_nothing_changes_where_nothing_is_near():
    far = objects_of([1, 1.9, 0.0, 0.0, 0.0, 1])
    for empty in (objects_of(), far):
        found = filtered_velocity((0.1, 0.05), (0.1, 0.0), 0.3, empty, NONE, NUMBERS)
        assert found == pytest.approx((0.1, 0.05, 0.0))


def test_inside_it_may_always_leave():
    """And is told to, as far as the wheels can."""
    near = objects_of([1, 0.1, 0.0, 0.0, 0.0, 1])
    vx, _, slack = filtered_velocity((0.1, 0.0), (0.0, 0.0), 0.0, near, NONE, NUMBERS)
    assert vx == pytest.approx(-(KEEP - 0.1))
    assert slack == 0.0
    vx, vy, _ = filtered_velocity((-0.2, 0.02), (0.0, 0.0), 0.0, near, NONE, NUMBERS)
    assert (vx, vy) == pytest.approx((-0.2, 0.02))


@pytest.mark.parametrize("speed", [0.05, 0.1, 0.15, 0.2])
@pytest.mark.parametrize("aside", [-0.1, 0.0, 0.2])
def test_what_crosses_is_let_pass(speed, aside):
    """It comes from the left, timed to meet; with the motors' lag of 50 ms."""
    radius, horizon = 0.2, 20.0
    at, v, lagged = np.zeros(2), np.zeros(2), np.zeros(2)
    meet = 10.0
    other, other_v = np.array([1.5, speed * meet + aside]), np.array([0.0, -speed])
    least = math.inf
    for _ in range(round(horizon / 0.025)):
        center = other - at
        far = np.hypot(*center)
        edge = center * (1.0 - radius / far)
        objects = objects_of([1, *edge, *other_v, 1, radius])
        if far - radius > 2.0:
            objects = objects_of()
        wanted = np.array([0.15, -0.5 * at[1]])
        given = tuple(wanted), tuple(v), 0.0, objects, NONE, NUMBERS
        vx, vy, _ = filtered_velocity(*given)
        v = np.array([vx, vy])
        lagged += (v - lagged) * (1.0 - math.exp(-0.025 / 0.05))
        at, other = at + 0.025 * lagged, other + 0.025 * other_v
        least = min(least, np.hypot(*(other - at)) - radius)
    assert least > KEEP - 0.05  # the margin is for the lag


def test_robots_share_the_way_out():
    """Two head-on, a little off: each takes half, and neither comes too near."""
    radius = 0.5 * math.hypot(0.138, 0.178)
    places = np.array([[-2.0, 0.02], [2.0, -0.02]])
    velocities = np.zeros((2, 2))
    least = math.inf
    for _ in range(1200):
        found = []
        for k in range(2):
            center = places[1 - k] - places[k]
            far = np.hypot(*center)
            edge = center * (1.0 - radius / far)
            objects = objects_of([1, *edge, *velocities[1 - k], 1, radius, 1])
            if far > 2.2:
                objects = objects_of()
            goal = np.array([2.0, 0.0]) if k == 0 else np.array([-2.0, 0.0])
            away = goal - places[k]
            wanted = 0.15 * away / max(np.hypot(*away), 0.15)
            v = tuple(velocities[k])
            given = tuple(wanted), v, 0.0, objects, NONE, NUMBERS
            found.append(filtered_velocity(*given)[:2])
        velocities = np.array(found)
        places = places + 0.025 * velocities
        least = min(least, np.hypot(*(places[0] - places[1])) - radius)
    assert least > KEEP - 1e-3
    np.testing.assert_allclose(places, [[2.0, 0.0], [-2.0, 0.0]], atol=0.05)


def test_the_block_does_not_wind_up():
    block = SafetyFilter(robot=BURGER)
    step: Step = block.step
    state = list(step.state)
    wall = objects_of([1, KEEP, 0.0, 0.0, 0.0, 1]).tolist()
    for _ in range(200):
        inputs = [2.5, 0.0], [0.0, 0.0, 0.0], wall, [1.0]
        step.step(0, state, inputs, (), step.numbers)
    assert state[:4] == pytest.approx([0.0] * 4, abs=1e-12)
    assert state[4:] == [0.0, 1.0]
    clear = [0.0] * 64
    step.step(0, state, ([2.5, 0.0], [0.0, 0.0, 0.0], clear, [1.0]), (), step.numbers)
    assert state[2] == pytest.approx(0.0625)
    assert state[0] == pytest.approx(0.0625 / 0.033)


def test_in_drake_it_is_the_same():
    block = SafetyFilter(robot=BURGER)
    crossing = objects_of([1, 0.5, 0.1, 0.0, -0.1, 1, 0.2])
    inputs = {
        "acceleration_W": [1.0, 0.5],
        "pose_WB_estimated": [0.0, 0.0, 0.4],
        "objects_W": crossing,
        "route_clearance": [1.0],
    }
    at, state = Bench(block, **inputs), [0.0] * 6
    for _ in range(5):
        at.tick()
        values = [list(value) for value in inputs.values()]
        block.step.step(0, state, values, (), block.step.numbers)
    for port, k in (("wheel_speeds", 0), ("v_WP", 2), ("filter_report", 4)):
        assert at.output(port).tolist() == state[k : k + 2]
