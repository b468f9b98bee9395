"""The target against a body that is drawn along waypoints, and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from phonotaxis import testing
from phonotaxis.testing import Bench
from systems.base.robot import RobotParameters
from systems.framework.signals import TICK_S
from systems.routes.parameters import RouteParameters
from systems.routes.path_target import (
    LEAD_M,
    PathTarget,
    nearest_on_route,
    point_on_route,
)
from systems.routes.route import ROUTE_SIZE, Route
from systems.routes.widest_route import plan_route
from systems.world.paths import WaypointPath

EPSILON = 0.08
ROBOT = RobotParameters(control_point_m=EPSILON)
# As many points as a planned route has. No route is planned here: the planner would be
# compiled by every process that lists the tests.
STRAIGHT = Route(np.column_stack([np.linspace(0.0, 3.0, 200), np.zeros(200)])).numbers


def arc(radius=0.5, count=60):
    """A quarter circle about the origin from (radius, 0)."""
    angles = np.linspace(0.0, 0.5 * math.pi, count)
    return Route(radius * np.column_stack([np.cos(angles), np.sin(angles)])).numbers


def run(block, places, route=STRAIGHT):
    """Target, and progress, at ticks at which P is at places; heading 0."""
    poses = np.array([[x - EPSILON, y, 0.0] for x, y in places])
    history = testing.run(
        block, (len(poses) - 1) * TICK_S, route=route, pose_WB_estimated=poses
    )
    return np.column_stack([history["target_state"], history["route_progress"]])


def make(**changes):
    return PathTarget(parameters=RouteParameters(**changes), robot=ROBOT)


@pytest.mark.parametrize("length", [3.0, 0.1])
def test_by_the_clock_it_is_a_body_on_waypoints(length):
    """Ramps and plateau, and of a short way a triangle."""
    route = plan_route((0.0, 0.0), (length, 0.0), []).numbers
    path = WaypointPath([(0, 0), (length, 0)], speed=0.15, acceleration=0.15)
    ticks = math.ceil(path.duration / TICK_S) + 20
    rows = run(make(), [(0.0, 0.0)] * ticks, route)
    for k in range(0, ticks, 7):
        expected = path.pose(k * TICK_S)[0], path.velocity(k * TICK_S)[0]
        assert rows[k, [0, 2]] == pytest.approx(expected, abs=1e-3)
        assert rows[k, 4] == pytest.approx(rows[k, 0], abs=1e-12)
    assert rows[-1] == pytest.approx([length, 0, 0, 0, length, 0], abs=1e-12)
    changes = np.abs(np.diff(rows[:, 2]))
    assert changes.max() <= 0.15 * TICK_S + 1e-12


def test_it_waits_for_who_stands():
    """From its top speed it stops just where the lead ends."""
    rows = run(make(timing="waiting"), [(0.7, 0.2)] * 400)
    lead = rows[:, 4] - rows[:, 5]
    assert rows[:, 5] == pytest.approx(0.7)
    assert lead.max() <= LEAD_M + 1e-9
    assert rows[-1, :4] == pytest.approx([0.7 + LEAD_M, 0, 0, 0], abs=3e-5)
    assert rows[:, 2].max() == pytest.approx(0.15)
    assert np.abs(np.diff(rows[:, 2])).max() <= 0.15 * TICK_S + 1e-12


def test_it_keeps_the_lead_of_who_is_slow_and_goes_on():
    """P at 0.1 m/s, at rest from 20 s to 25 s, then at 0.3 m/s to the goal."""
    times = np.arange(0.0, 40.0, TICK_S)
    x = np.interp(times, [0, 20, 25, 28], [0, 2, 2, 2.9])
    rows = run(make(timing="waiting"), [(at, 0.0) for at in x])
    lead = rows[:, 4] - rows[:, 5]
    assert lead.max() <= LEAD_M + 1e-9
    behind = (times > 19.0) & (times < 20.0)
    # Following a steady speed v, it stays v^2/(2 a) + v T/2 short of the lead's end.
    expected = LEAD_M - 0.1**2 / 0.3 - 0.1 * TICK_S / 2
    assert lead[behind] == pytest.approx(expected, abs=2e-3)
    assert rows[behind, 2] == pytest.approx(0.1, abs=1e-3)
    assert np.abs(np.diff(rows[:, 2])).max() <= 0.15 * TICK_S + 1e-12
    assert rows[-1, :4] == pytest.approx([3.0, 0, 0, 0], abs=1e-6)


def test_a_new_route_begins_anew_where_p_is_nearest():
    block = make()
    rows = run(block, [(0.0, 0.0)] * 200)
    at = Bench(
        block,
        route=STRAIGHT,
        pose_WB_estimated=[0.0, 0.0, 0.0],
    )
    for _ in range(200):
        at.tick()
    assert at.output("target_state")[0] > rows[100, 0]
    turned = plan_route((0.0, -1.0), (0.0, 4.0), []).numbers
    at.set(route=turned, pose_WB_estimated=[0.3, 1.2, 0.0])
    assert at.output("target_state") == pytest.approx([0, 1.2, 0, 0], abs=1e-9)
    assert at.output("route_progress") == pytest.approx([2.2, 2.2])
    speed = [at.tick().output("target_state")[3] for _ in range(3)]
    assert speed == pytest.approx([0.15 * TICK_S * k for k in (1, 2, 3)])


def test_p_is_not_taken_for_a_place_far_ahead():
    """Up and down a lane 0.4 m wide: P is at first nearer to the way down."""
    up = np.column_stack([np.zeros(81), np.linspace(0, 4, 81)])
    over = np.column_stack([np.linspace(0.05, 0.35, 7), np.full(7, 4.0)])
    down = np.column_stack([np.full(81, 0.4), np.linspace(4, 0, 81)])
    route = Route(np.concatenate([up, over, down])).numbers
    rows = run(make(), [(0.0, 0.0), (0.05, 0.1), (0.3, 0.2)], route)
    assert rows[:, 5] == pytest.approx([0.0, 0.1, 0.2])


def test_without_a_route_it_is_where_p_is():
    rows = run(make(), [(1.0, 2.0)] * 2, np.zeros(ROUTE_SIZE))
    assert rows == pytest.approx(np.array([[1, 2, 0, 0, 0, 0]] * 2))


def test_places_and_directions_are_those_of_a_circle():
    route = arc()
    for along in np.linspace(0.01, 0.77, 20):
        x, y, tx, ty = point_on_route(route, along)
        angle = along / 0.5
        assert (x, y) == pytest.approx(
            (0.5 * math.cos(angle), 0.5 * math.sin(angle)), abs=1e-4
        )
        assert (tx, ty) == pytest.approx((-math.sin(angle), math.cos(angle)), abs=1e-2)
    # Between points the direction does not step.
    near = 20 * route[1] - 1e-9, 20 * route[1] + 1e-9
    before, after = (point_on_route(route, along)[2:] for along in near)
    assert before == pytest.approx(after, abs=1e-6)


def test_the_velocity_is_the_derivative_of_the_place():
    route = arc()
    for along in (0.004, 0.1, 0.333, 0.78):
        low, high = (point_on_route(route, along + h)[:2] for h in (-1e-6, 1e-6))
        slope = (np.array(high) - low) / 2e-6
        assert point_on_route(route, along)[2:] == pytest.approx(slope, abs=1e-6)


def test_nearest_is_the_nearest_of_many():
    """A place at an angle is nearest to a circle at that angle, within half a side."""
    route = arc(count=190)
    for angle in (0.0, 0.3, 1.0, 0.5 * math.pi):
        for radius in (0.2, 0.9):
            x, y = radius * math.cos(angle), radius * math.sin(angle)
            found = nearest_on_route(route, x, y, 0.0, 9.0)
            assert found == pytest.approx(0.5 * angle, abs=2.5e-3)
    assert nearest_on_route(route, 0.0, 0.5, 0.1, 0.3) == pytest.approx(0.3)
    assert nearest_on_route(route, 0.5, 0.0, 0.1, 0.3) == pytest.approx(0.1)


def test_compiled_it_is_the_same(compiled_tick):
    """To the last bit, a new route among the ticks."""
    block = make(timing="waiting")
    step = block.step
    routes = [STRAIGHT] * 60 + [arc()] * 60
    x = np.linspace(0.0, 0.4, 120)
    poses = [[a, 0.1 * a, 0.3] for a in x]
    at = Bench(block, route=routes[0], pose_WB_estimated=poses[0])
    state, outputs = np.array(step.state), (np.zeros(4), np.zeros(2), np.zeros(1))
    for k, (route, pose) in enumerate(zip(routes, poses, strict=True)):
        at.set(route=route, pose_WB_estimated=pose)
        compiled_tick(step.step, k, state, (route, pose), outputs, step.numbers)
        np.testing.assert_array_equal(at.output("target_state"), outputs[0])
        np.testing.assert_array_equal(at.output("route_progress"), outputs[1])
        at.tick()
