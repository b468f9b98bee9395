"""From what is commanded to wheels: P must move as it says, within the limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from pydrake.autodiffutils import AutoDiffXd

from phonotaxis.testing import Bench, assert_linearization
from systems.base.diff_drive_plant import PlantNumbers, body_twist, plant_derivatives
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.base.wheel_speed_command import (
    WheelCommand,
    clamped_velocity,
    hand_position_twist,
    hand_position_velocity,
    integrate_velocity,
    limited_wheel_speeds,
    turned_off_back,
)
from systems.world.geometry import control_point

pytestmark = pytest.mark.drake

ROBOT = RobotParameters()
angle = st.floats(-math.pi, math.pi)


def wheels_for(v_WP, theta):
    v, omega = hand_position_twist(v_WP, theta, 0.175)
    return limited_wheel_speeds(v, omega, ROBOT)


@given(angle, angle, st.floats(0.0, 0.2))
def test_control_point_moves_with_the_virtual_mass(theta, direction, speed):
    """P differentiated through the plant, its motors settled."""
    v_WP = (speed * math.cos(direction), speed * math.sin(direction))
    wheels = wheels_for(v_WP, theta)
    state = np.array([0.3, -0.2, theta, 0.0, 0.0, *wheels])
    numbers = PlantNumbers.of(ROBOT, PlantParameters())
    rates = plant_derivatives(np.array(state), np.array(wheels), *numbers)
    h = 1e-6
    ahead = control_point((state + h * rates)[:3], 0.175)
    behind = control_point((state - h * rates)[:3], 0.175)
    v_P = np.subtract(ahead, behind) / (2 * h)
    np.testing.assert_allclose(v_P, v_WP, atol=1e-8)


def test_sideways_motion_turns_on_the_spot():
    v, omega = hand_position_twist((0.0, 0.1), 0.0, 0.2)
    assert (v, omega) == (0.0, pytest.approx(0.5))


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-9, 9), st.floats(-9, 9))
def test_speed_is_clamped_in_its_direction(vx, vy, ax, ay):
    free = np.array([vx + 0.025 * ax, vy + 0.025 * ay])
    clamped = np.array(integrate_velocity((vx, vy), (ax, ay), 0.025, 0.72))
    speed = np.linalg.norm(free)
    expected = free if speed <= 0.72 else free * 0.72 / speed
    np.testing.assert_allclose(clamped, expected, atol=1e-11)


@given(st.floats(-2, 2), st.floats(-2, 2))
def test_clamp_keeps_the_direction(vx, vy):
    found = np.array(clamped_velocity(vx, vy, 0.72))
    assert np.linalg.norm(found) == pytest.approx(min(math.hypot(vx, vy), 0.72))
    assert vx * found[1] == pytest.approx(vy * found[0], abs=1e-12)
    assert found @ (vx, vy) >= 0.0


@given(angle, st.floats(-1, 1), st.floats(-4, 4))
def test_velocity_of_p_is_that_of_the_twist(theta, v, omega):
    """By hand: v ahead, and epsilon omega to the left."""
    vx, vy = hand_position_velocity((v, omega), theta, 0.175)
    left = 0.175 * omega
    assert vx == pytest.approx(v * math.cos(theta) - left * math.sin(theta), abs=1e-12)
    assert vy == pytest.approx(v * math.sin(theta) + left * math.cos(theta), abs=1e-12)
    back = hand_position_twist((vx, vy), theta, 0.175)
    assert back == pytest.approx((v, omega), abs=1e-11)


@given(st.floats(-2, 2), st.floats(-10, 10))
def test_wheel_limit_keeps_the_curvature(v, omega):
    wheels = limited_wheel_speeds(v, omega, ROBOT)
    assert max(map(abs, wheels)) <= 12.0 + 1e-12
    limited_v, limited_omega = body_twist(wheels, ROBOT)
    assert limited_v * omega == pytest.approx(v * limited_omega, abs=1e-12)
    assert limited_v * v >= 0.0
    assert limited_omega * omega >= 0.0


@given(st.floats(-0.3, 0.3), st.floats(-1, 1))
def test_wheels_within_the_limit_give_the_twist(v, omega):
    twist = body_twist(limited_wheel_speeds(v, omega, ROBOT), ROBOT)
    assert twist == pytest.approx((v, omega), abs=1e-12)


def test_a_full_turn_to_the_side_is_scaled():
    """P at top speed across: 4.11 rad/s would need 14.06 rad/s of each wheel."""
    left, right = wheels_for((0.0, 0.72), 0.0)
    assert (left, right) == (pytest.approx(-12.0), pytest.approx(12.0))


def test_acts_from_the_tick_on_and_not_before():
    at = Bench(WheelCommand(), acceleration_W=[2.0, 0.0], pose_WB_estimated=[0, 0, 0])
    np.testing.assert_array_equal(at.output("wheel_speeds"), [0.0, 0.0])
    at.tick()
    np.testing.assert_allclose(at.output("v_WP"), [0.05, 0.0])
    np.testing.assert_allclose(at.output("wheel_speeds"), [0.05 / 0.06] * 2)


def test_constant_push_does_not_wind_up():
    at = Bench(WheelCommand(), acceleration_W=[2.0, 0.0], pose_WB_estimated=[0, 0, 0])
    for _ in range(100):
        at.tick()
    assert at.output("v_WP")[0] == pytest.approx(0.72)
    at.set(acceleration_W=[-2.0, 0.0])
    at.tick()
    assert at.output("v_WP")[0] == pytest.approx(0.67)


def test_own_dimensions_are_used():
    robot = RobotParameters(
        wheel_radius_m=0.1, wheel_separation_m=0.5, control_point_m=0.25
    )
    at = Bench(
        WheelCommand(robot=robot),
        acceleration_W=[4.0, 2.0],
        pose_WB_estimated=[0, 0, 0],
    ).tick()
    # v = 0.1, omega = 0.05 / 0.25 = 0.2: rims at 0.1 -+ 0.05.
    np.testing.assert_allclose(at.output("wheel_speeds"), [0.5, 1.5])


@pytest.mark.parametrize(
    "point",
    [
        [0.1, -0.05, 0.5, 0.3, 0.4],
        [0.6, 0.5, 2.0, -1.0, 0.6],
        [0.1, 0.7, 0.5, 0.3, -0.4],
    ],
)
def test_gradient(point):
    """Free, clamped, and with the wheels scaled."""
    robot = RobotParameters(control_point_m=0.2, top_speed_m_s=0.7)
    assert_linearization(
        WheelCommand(robot=robot),
        state=[*point[:2], 0.0, 0.0],
        acceleration_W=point[2:4],
        pose_WB_estimated=[0.0, 0.0, point[4]],
    )


def commanded(port, command, theta=0.7):
    """Velocity of P and wheel speeds after a tick with a command."""
    block = WheelCommand(command=port)
    at = Bench(block, **{port: command}, pose_WB_estimated=[0.3, -0.1, theta])
    np.testing.assert_array_equal(at.output("wheel_speeds"), [0.0, 0.0])
    at.tick()
    return at.output("v_WP"), at.output("wheel_speeds")


def test_velocity_is_obeyed_at_once():
    v_WP, wheels = commanded("velocity_W", [0.1, -0.1])
    np.testing.assert_allclose(v_WP, [0.1, -0.1])
    np.testing.assert_allclose(wheels, wheels_for((0.1, -0.1), 0.7))


def test_velocity_beyond_top_speed_keeps_its_direction():
    v_WP, wheels = commanded("velocity_W", [3.0, 4.0])
    np.testing.assert_allclose(v_WP, [0.6 * 0.72, 0.8 * 0.72])
    assert max(abs(wheels)) <= 12.0 + 1e-12


def test_twist_is_obeyed_at_once_whatever_the_heading():
    for theta in (0.0, 0.7, -2.5):
        v_WP, wheels = commanded("twist_B", [0.3, 0.5], theta)
        twist = body_twist(wheels, ROBOT)
        assert twist == pytest.approx((0.3, 0.5))
        assert np.linalg.norm(v_WP) == pytest.approx(math.hypot(0.3, 0.175 * 0.5))


@pytest.mark.parametrize("twist", [[2.0, 1.0], [0.5, 6.0], [-1.0, 2.0], [0.0, 9.0]])
def test_twist_beyond_the_limits_keeps_its_curvature(twist):
    v_WP, wheels = commanded("twist_B", twist)
    v, omega = body_twist(wheels, ROBOT)
    assert v * twist[1] == pytest.approx(twist[0] * omega)
    assert v * twist[0] + omega * twist[1] > 0.0
    assert np.linalg.norm(v_WP) == pytest.approx(0.72)
    assert max(abs(wheels)) <= 12.0 + 1e-12


@pytest.mark.parametrize("port", ["velocity_W", "twist_B"])
@pytest.mark.parametrize("point", [[0.2, -0.1, 0.4], [0.6, 0.7, 0.4], [0.1, 4.5, -0.4]])
def test_gradient_of_other_commands(port, point):
    """Free, clamped, and with the wheels scaled."""
    block = WheelCommand(command=port, robot=RobotParameters(top_speed_m_s=0.7))
    pose = [0.0, 0.0, point[2]]
    assert_linearization(block, **{port: point[:2]}, pose_WB_estimated=pose)


def test_a_vector_straight_back_is_turned_aside():
    """By hand: by tan 5 deg of what exceeds 0.1, to the side that it has, or left."""
    aside = math.tan(math.radians(5.0)) * 0.5
    for across, expected in ((0.0, aside), (1e-9, aside), (-1e-9, -aside)):
        found = turned_off_back(-0.6, across, 0.0, 0.1)
        assert found == pytest.approx((-0.6, expected))
    found = turned_off_back(-1e-9, -0.6, math.pi / 2, 0.1)  # left of B is -x of W
    assert found == pytest.approx((-aside, -0.6))


@given(angle, angle, st.floats(0.0, 3.0))
def test_no_other_vector_is_turned(theta, off, length):
    """Neither ahead, nor beside, nor 5 deg off straight back, nor a short one."""
    x, y = length * math.cos(theta + off), length * math.sin(theta + off)
    found = turned_off_back(x, y, theta, 0.3)
    if abs(off) < math.radians(174.9) or length < 0.3:
        assert found == (x, y)
    turned = math.remainder(math.atan2(found[1], found[0]) - theta - off, math.tau)
    assert abs(turned) <= math.radians(5.0) + 1e-9 or length < 1e-9


def test_derivatives_of_what_is_not_turned_stay():
    """Of what pulls ahead, and of a short vector back: those of a linear model."""
    units: Any = np.eye(2)
    for along in (-0.2, 0.0, 1.2):
        x, y = AutoDiffXd(along, units[0]), AutoDiffXd(0.0, units[1])
        found = turned_off_back(x, y, 0.0, 0.3)
        for each, unit in zip(found, units, strict=True):
            np.testing.assert_array_equal(each.derivatives(), unit)
