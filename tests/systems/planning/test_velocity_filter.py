"""The filter's choice against SciPy, its conditions, and runs on wheels with a lag."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog, minimize, nnls

from systems.base.robot import RobotParameters
from systems.laws.baselines.reciprocal_avoidance_controller import avoid_body
from systems.planning.safety_filter import SafetyFilter
from systems.planning.velocity_filter import (
    FilterNumbers,
    disc_plane,
    filtered_velocity,
)
from systems.ranging.ideal_object_sensor import IdealObjectSensor
from systems.world.geometry import nearest_point_on_rectangle, rectangle_clearance

BURGER = RobotParameters.model_validate({"preset": "turtlebot3_burger"})
EPSILON, TOP, LAG_S, TICK_S = 0.08, 0.22, 0.05, 0.025
KEEP = 0.5 * math.hypot(0.138, 0.178) + EPSILON + 0.05
NUMBERS = FilterNumbers(KEEP, TOP, 1.0)
#: No half planes of the outline.
NONE = np.empty((0, 3))


def drawn(seed: int) -> Any:
    """Wanted velocity, present one, heading, and one to five objects."""
    draw = np.random.default_rng(seed)
    objects = np.zeros((8, 8))
    for slot in objects[: draw.integers(1, 6)]:
        bearing, far = draw.uniform(0.0, math.tau), draw.uniform(0.15, 1.2)
        slot[:3] = 1.0, far * math.cos(bearing), far * math.sin(bearing)
        if draw.random() < 0.5:
            slot[3:5] = draw.uniform(-0.2, 0.2, 2)
            slot[5:] = 1.0, draw.uniform(0.05, 0.3), float(draw.random() < 0.4)
    wanted, now = draw.uniform(-0.2, 0.2, 2), draw.uniform(-0.15, 0.15, 2)
    return wanted, now, draw.uniform(-3.0, 3.0), objects


def constraints(objects: Any, now: Any, theta: float) -> tuple[Any, Any]:
    """n . v >= b that may be broken, and those that may not; by ``avoid_body``."""
    soft, hard = [], []
    for _, x, y, vx, vy, known, radius, robot in objects[objects[:, 0] > 0.5]:
        far = math.hypot(x, y)
        n = -x / far, -y / far
        if known < 0.5:
            soft.append((*n, KEEP - far))
            hard.append((*n, min(KEEP - far, 0.0)))
            continue
        center = x * (1.0 + radius / far), y * (1.0 + radius / far), 0.0
        relative = now[0] - vx, now[1] - vy
        nx, ny, offset = avoid_body(center, (0.0, 0.0), radius + KEEP, relative, 4.0)
        change = offset - nx * relative[0] - ny * relative[1]
        share = 0.5 if robot else 1.0
        soft.append((nx, ny, nx * now[0] + ny * now[1] + share * change))
    c, s = math.cos(theta), math.sin(theta)
    for along, across in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        # A rim's speed, v_x +- v_y with L/2 = epsilon, either way.
        rim = along * np.array([c, s]) + across * np.array([-s, c])
        hard.append((*(-rim), -TOP))
    return np.array(soft), np.array(hard)


def least_slack(soft: Any, hard: Any) -> float:
    """By linear programming in v and the slack."""
    rows = np.concatenate(
        [
            np.column_stack([-soft[:, :2], -np.ones(len(soft))]),
            np.insert(-hard[:, :2], 2, 0.0, axis=1),
        ]
    )
    limits = -np.concatenate([soft[:, 2], hard[:, 2]])
    bounds = [(None, None), (None, None), (0.0, None)]
    found = linprog([0.0, 0.0, 1.0], A_ub=rows, b_ub=limits, bounds=bounds)
    assert found.success
    return float(found.fun)


def nearest(wanted: Any, rows: Any, start: Any) -> Any:
    return minimize(
        lambda v: np.sum((v - wanted) ** 2),
        start,
        jac=lambda v: 2.0 * (v - wanted),
        constraints={"type": "ineq", "fun": lambda v: rows[:, :2] @ v - rows[:, 2]},
        tol=1e-14,
    ).x


def test_it_is_the_optimum_of_300_cases():
    """SLSQP's, and where it can be solved the conditions of Karush, Kuhn and Tucker."""
    infeasible = changed = 0
    for seed in range(300):
        wanted, now, theta, objects = drawn(seed)
        soft, hard = constraints(objects, now, theta)
        *v, slack = filtered_velocity(
            tuple(wanted), tuple(now), theta, objects.ravel(), NONE, NUMBERS
        )
        found, least = np.array(v), least_slack(soft, hard)
        assert slack == pytest.approx(least, abs=2e-6)
        if least < 1e-7:
            assert slack == 0.0
        infeasible += slack > 1e-6
        assert np.all(hard[:, :2] @ found >= hard[:, 2] - 1e-8)
        assert np.all(soft[:, :2] @ found >= soft[:, 2] - slack - 1e-8)
        soft[:, 2] -= slack
        rows = np.concatenate([soft, hard])
        if slack == 0.0:
            best = nearest(wanted, rows, found)
            assert np.sum((found - wanted) ** 2) <= np.sum((best - wanted) ** 2) + 1e-7
            active = rows[:, :2] @ found < rows[:, 2] + 1e-7
            pull = found - wanted
            changed += np.hypot(*pull) > 1e-6
            rest = (
                nnls(rows[active, :2].T, pull)[1] if active.any() else np.hypot(*pull)
            )
            assert rest == pytest.approx(0.0, abs=1e-7)
    assert infeasible > 20
    assert changed > 100


def test_both_velocity_obstacles_are_one():
    """Of a disc: the closed form, and that of rectangles without extent."""
    for seed in range(200):
        draw = np.random.default_rng(seed)
        bearing, far = draw.uniform(0, math.tau), draw.uniform(0.1, 2.0)
        place = far * math.cos(bearing), far * math.sin(bearing)
        radius, velocity = draw.uniform(0.05, 0.6), tuple(draw.uniform(-0.5, 0.5, 2))
        nx, ny, inside = disc_plane(place, radius, velocity, 4.0, 0.1)
        other = avoid_body((*place, 0.0), (0.0, 0.0), radius, velocity, 4.0)
        assert other[:2] == pytest.approx((nx, ny), abs=1e-9)
        change = other[2] - other[0] * velocity[0] - other[1] * velocity[1]
        assert change == pytest.approx(inside, abs=1e-9)


def driven(
    bodies: Any, velocities: Any, wish: Any, *, seconds: float, pose: Any = (0, 0, 0)
) -> tuple[Any, Any]:
    """A robot whose wheels follow with their lag, on the sensor's objects.

    Returns:
        (ticks, bodies) distances of P from each body, m; (ticks, 4) wheel speeds that
        were commanded, rad/s, and speeds of P that the filter gave, m/s.
    """
    boxes = np.array(bodies, dtype=float).reshape(-1, 5)
    bodies = np.column_stack([boxes, np.zeros(len(boxes))])
    sensor = IdealObjectSensor(robot=BURGER, bodies=len(bodies)).step
    command = SafetyFilter(robot=BURGER).step
    seen, state = np.array(sensor.state), list(command.state)
    (x, y, theta), wheels = pose, np.zeros(2)
    distances, commands = [], []
    for tick in range(round(seconds / TICK_S)):
        poses = bodies[:, :3] + TICK_S * tick * np.array(velocities)
        objects = [[0.0] * 64]
        places = [np.array([x, y, theta]), poses.ravel(), bodies[:, 3:].ravel()]
        sensor.step(tick, seen, places, objects, sensor.numbers)
        p_WP = x + EPSILON * math.cos(theta), y + EPSILON * math.sin(theta)
        rectangles = np.hstack([poses, bodies[:, 3:]])
        away = [nearest_point_on_rectangle(p_WP, tuple(box)) for box in rectangles]
        distances.append([math.hypot(*vector) for vector in away])
        acceleration = 4.0 * (np.array(wish(tick, p_WP)) - state[2:4])
        inputs = acceleration.tolist(), [x, y, theta], objects[0], [1.0]
        command.step(tick, state, inputs, (), command.numbers)
        commands.append(state[:4])
        for _ in range(5):
            before = wheels
            share = 1.0 - math.exp(-0.2 * TICK_S / LAG_S)
            wheels = wheels + share * (np.array(state[:2]) - wheels)
            left, right = 0.033 * 0.5 * (before + wheels)
            way, turn = (
                0.1 * TICK_S * (left + right),
                0.2 * TICK_S * (right - left) / 0.16,
            )
            x += way * math.cos(theta + 0.5 * turn)
            y += way * math.sin(theta + 0.5 * turn)
            theta += turn
    return np.array(distances), np.array(commands)


def test_with_the_motors_lag_a_wall_is_approached_and_not_passed():
    """The lag of 50 ms makes of alpha the slow root of 0.05 s^2 + s + 1 = 0."""
    wall = [1.5, 0.0, 0.0, 0.2, 9.0]
    distances, _ = driven(
        [wall], [[0.0] * 3], lambda tick, p_WP: (0.22, 0.0), seconds=12.0
    )
    left = distances[:, 0] - KEEP
    assert np.all(left > 0.0)
    rate = math.log(left[-200] / left[-120]) / 2.0
    assert rate == pytest.approx((1.0 - math.sqrt(0.8)) / 0.1, rel=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_lag_and_turns_among_boxes_cost_millimeters(seed):
    """And wheels are never told more than they can, though the wish swings about."""
    draw = np.random.default_rng(seed)
    angles = [math.tau * k / 5 for k in range(5)]
    boxes = [
        [0.8 * math.cos(a), 0.8 * math.sin(a), draw.uniform(0, 3), 0.3, 0.4]
        for a in angles
    ]
    phase = draw.uniform(0.0, math.tau)

    def wish(tick: int, p_WP: Any) -> Any:
        turning = 0.5 * TICK_S * tick + phase
        return 0.2 * math.cos(turning), 0.2 * math.sin(1.3 * turning)

    distances, commands = driven(boxes, np.zeros((5, 3)), wish, seconds=20.0)
    assert np.min(distances) > KEEP - 0.005
    assert np.min(distances) < KEEP + 0.02
    assert np.max(np.abs(commands[:, :2])) <= TOP / 0.033 * (1.0 + 1e-6)
    assert np.max(np.hypot(*commands[:, 2:].T)) <= TOP + 1e-8


@pytest.mark.parametrize("seed", range(8))
def test_slower_boxes_that_cross_are_not_touched(seed):
    """Timed to meet P half way; rectangles, turned as it comes."""
    draw = np.random.default_rng(seed)
    speed, course = draw.uniform(0.12, 0.22), draw.uniform(0.6, 5.7)
    velocity = speed * np.array([math.cos(course), math.sin(course)])
    start = np.array([1.2, 0.0]) - 8.0 * velocity
    box = [*start, draw.uniform(0.0, 3.0), 0.4, 0.3]
    distances, _ = driven(
        [box],
        [[*velocity, 0.0]],
        lambda tick, p_WP: (0.15, -0.5 * p_WP[1]),
        seconds=16.0,
        pose=(-EPSILON, 0.0, 0.0),
    )
    assert np.min(distances[0]) > KEEP
    assert np.min(distances) > KEEP - 0.002


@pytest.mark.parametrize("speed", [0.3, 0.45, 0.6])
def test_what_comes_does_not_drive_it_into_a_wall(speed):
    """A box too wide to get away from; the wall's constraint is not softened."""
    box, wall = [0.0, 2.0, 0.0, 2.0, 1.0], [0.0, -0.6, 0.0, 20.0, 0.2]
    way = 0.0, -speed
    distances, _ = driven(
        [box, wall],
        [[*way, 0.0], [0.0] * 3],
        lambda tick, p_WP: (0.0, -0.1),
        seconds=1.6 / speed,
    )
    assert np.min(distances[:, 0]) < KEEP - 0.02, "it was pressed"
    assert np.min(distances[:, 1]) > KEEP - 0.002


def test_two_robots_that_meet_do_not_touch():
    """Bodies, wheels and lag, from eight sides; each sees the other's rectangle."""
    for bearing in np.linspace(1.0, 5.0, 8):
        starts = np.array(
            [
                [0.0, 0.0, 0.0],
                [2.0 - 2.0 * math.cos(bearing), -2.0 * math.sin(bearing), bearing],
            ]
        )
        least = meeting(starts)
        assert least > 0.03, bearing


def meeting(starts: Any) -> float:
    """Least clearance of two robots' bodies that drive on at 0.15 m/s, m."""
    size = [BURGER.length_m, BURGER.width_m, 0.0]
    poses, wheels = starts.copy(), np.zeros((2, 2))
    courses = 0.15 * np.column_stack([np.cos(starts[:, 2]), np.sin(starts[:, 2])])
    sensors = [
        IdealObjectSensor(robot=BURGER, bodies=1, robots=(0,)).step for _ in "ab"
    ]
    commands = [SafetyFilter(robot=BURGER).step for _ in "ab"]
    seen = [np.array(sensor.state) for sensor in sensors]
    states = [list(command.state) for command in commands]
    least = math.inf
    for tick in range(1000):
        rows = [np.array([*pose, *size]) for pose in poses]
        least = min(least, rectangle_clearance(rows[0], rows[1]))
        for k in range(2):
            objects, pose = [[0.0] * 64], poses[k].tolist()
            inputs = [poses[k], poses[1 - k], np.array(size)]
            sensors[k].step(tick, seen[k], inputs, objects, sensors[k].numbers)
            pull = (4.0 * (courses[k] - states[k][2:4])).tolist()
            commands[k].step(
                tick,
                states[k],
                (pull, pose, objects[0], [1.0]),
                (),
                commands[k].numbers,
            )
        for k in range(2):
            share = 1.0 - math.exp(-TICK_S / LAG_S)
            wheels[k] += share * (np.array(states[k][:2]) - wheels[k])
            way = 0.5 * TICK_S * 0.033 * wheels[k].sum()
            turn = TICK_S * 0.033 * (wheels[k, 1] - wheels[k, 0]) / 0.16
            middle = poses[k, 2] + 0.5 * turn
            poses[k] += way * math.cos(middle), way * math.sin(middle), turn
    return least
