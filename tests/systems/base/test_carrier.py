"""The drive of a robot that carries a loudspeaker."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from hypothesis import given, strategies as st
from pydantic import ValidationError
from scipy.integrate import solve_ivp

from diagrams import load_scenario
from systems.base.carrier_parameters import SourceRobotParameters, driven_path
from systems.base.driven_path import DrivenPath

T = 0.025
LAG, RADIUS, SEPARATION = 0.05, 0.06, 0.29
CORNER = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
ZIGZAG = ((0.0, 0.0), (2.0, 0.0), (0.5, 1.0), (3.0, 1.2))


def carrier(waypoints=CORNER, **fields) -> SourceRobotParameters:
    return SourceRobotParameters(waypoints_m=waypoints, **fields)


def wheel_speeds(path: DrivenPath, times) -> np.ndarray:
    """(n, 2) rim speeds of left and right wheel from pose and velocity, m/s."""
    headings = path.poses(times)[:, 2]
    velocities = np.array([path.velocity(time) for time in times])
    ahead = np.cos(headings) * velocities[:, 0] + np.sin(headings) * velocities[:, 1]
    half = 0.5 * SEPARATION * velocities[:, 2]
    return np.stack([ahead - half, ahead + half], axis=1)


def test_it_starts_from_rest():
    """Not with a step to 0.3 m/s: in 1 ms no more than 2 m/s^2 allow."""
    path = carrier(start_time_s=1.0).path()
    velocities = np.array([path.velocity(t) for t in 0.9 + 1e-3 * np.arange(800)])
    steps = np.linalg.norm(np.diff(velocities[:, :2], axis=0), axis=1)
    assert steps.max() <= 2e-3
    assert velocities[99].tolist() == [0.0, 0.0, 0.0]
    # After the ramp of 0.3 s.
    assert velocities[500, 0] == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("at_end", ["stop", "shuttle"])
@pytest.mark.parametrize("speed", [0.3, 0.7])
def test_wheels_keep_to_their_limits(speed, at_end):
    """Two motors push 5.3 kg: 2 m/s^2; tight corners use all of it."""
    path = carrier(ZIGZAG, speed_m_s=speed, corner_radius_m=0.05, at_end=at_end).path()
    wheels = wheel_speeds(path, T * np.arange(2000))
    assert np.abs(wheels).max() <= 1.0
    # The step of a tick decays with the lag: what it was at first, by its mean.
    held = LAG * (1.0 - math.exp(-T / LAG))
    accelerations = np.diff(wheels, axis=0) / held
    assert np.abs(accelerations).max() <= 2.0 + 1e-6
    assert np.abs(accelerations).max() == pytest.approx(2.0)


@pytest.mark.parametrize("radius", [0.001, 0.1, 0.3])
@pytest.mark.parametrize("speed", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("waypoints", [CORNER, ZIGZAG])
def test_it_keeps_to_its_path(waypoints, speed, radius):
    parameters = carrier(waypoints, speed_m_s=speed, corner_radius_m=radius)
    path, plan = parameters.path(), parameters.plan()
    times = np.arange(0.0, plan.duration + 15.0, 0.005)
    apart = np.linalg.norm((path.poses(times) - plan.poses(times))[:, :2], axis=1)
    assert apart.max() < 0.02
    assert math.dist(path.pose(times[-1])[:2], waypoints[-1]) < 5e-3
    assert path.velocity(plan.duration + 10.1) == (0.0, 0.0, 0.0)
    assert path.pose(plan.duration + 10.1) == path.pose(1e6)


def test_a_shuttle_keeps_to_its_path_backwards():
    parameters = carrier(ZIGZAG, at_end="shuttle")
    path, plan = parameters.path(), parameters.plan()
    times = np.arange(0.0, 4.0 * plan.duration, 0.01)
    apart = np.linalg.norm((path.poses(times) - plan.poses(times))[:, :2], axis=1)
    assert apart.max() < 0.002


@pytest.mark.parametrize("name", ["default", "obstacle_free"])
def test_library_s_sources_are_within_2_mm_of_their_plans(name):
    source = load_scenario(name).source
    path, plan = source.path(), source.plan()
    times = np.arange(0.0, plan.duration + 15.0, 0.005)
    apart = np.linalg.norm((path.poses(times) - plan.poses(times))[:, :2], axis=1)
    assert apart.max() < 0.002
    assert apart[-1] < 1e-5


def test_yaw_rate_has_no_step_at_the_ends_of_an_arc():
    """The plan's steps by 1 rad/s; the wheels by no more than 2 * 2/0.29 rad/s^2."""
    parameters = carrier(((0.0, 0.0), (2.0, 0.0), (2.0, 2.0)))
    times = np.arange(0.0, 16.0, 1e-3)
    planned = np.diff(parameters.plan().twists(times)[:, 1])
    assert np.abs(planned).max() == pytest.approx(1.0)
    path = parameters.path()
    driven = np.diff([path.velocity(time)[2] for time in times])
    assert np.abs(driven).max() <= 1e-3 * 4.0 / SEPARATION * 1.05
    assert np.abs(path.velocity(6.9)[2]) == pytest.approx(1.0, abs=0.05)


def test_another_integration_of_the_plant_goes_the_same_way():
    """Controller and plant written again from docs/model.md, by scipy's DOP853."""
    parameters = carrier(speed_m_s=0.4, corner_radius_m=0.2)
    plan, path = parameters.plan(), parameters.path()

    def rates(_, state, command):
        left, right = RADIUS * state[3], RADIUS * state[4]
        v, omega = (left + right) / 2.0, (right - left) / SEPARATION
        lagging = (command - state[3:]) / LAG
        return [v * math.cos(state[2]), v * math.sin(state[2]), omega, *lagging]

    state = np.zeros(5)
    for tick in range(320):
        x, y, theta = plan.pose(tick * T)
        v_x, v_y, omega = plan.velocity(tick * T + LAG + T / 2)
        v = math.hypot(v_x, v_y)
        error = np.array([x - state[0], y - state[1]])
        ahead = error @ [math.cos(state[2]), math.sin(state[2])]
        aside = error @ [-math.sin(state[2]), math.cos(state[2])]
        turn = theta - state[2]
        speed = v * math.cos(turn) + 2.0 * ahead
        yaw_rate = omega + 50.0 * v * aside + 5.0 * math.sin(turn)
        half = 0.5 * SEPARATION * yaw_rate
        wish = np.array([speed - half, speed + half]) / RADIUS
        most = 2.0 / RADIUS * LAG
        command = state[3:] + np.clip(wish - state[3:], -most, most)
        found = solve_ivp(
            rates, (0.0, T), state, "DOP853", args=(command,), rtol=1e-11, atol=1e-12,
            t_eval=[0.4 * T, T],
        )  # fmt: skip
        between, state = found.y.T
        # Between the ticks the pose is a cubic.
        apart = np.abs(np.array(path.pose((tick + 0.4) * T)) - between[:3])
        assert np.all(apart < [1e-6, 1e-6, 1e-5])
        at = path.pose((tick + 1) * T)
        np.testing.assert_allclose(at, state[:3], atol=1e-7, rtol=0)
    assert math.dist(state[:2], CORNER[-1]) < 2e-3


@given(st.floats(0.0, 60.0))
def test_velocity_is_the_derivative_of_the_pose(time):
    path = carrier(start_time_s=0.51, at_end="shuttle").path()
    h = 1e-6
    before, after = path.pose(time - h), path.pose(time + h)
    change = [(b - a) / (2 * h) for a, b in zip(before, after, strict=True)]
    # Accelerations step at ticks, by up to twice 14 rad/s^2.
    np.testing.assert_allclose(path.velocity(time), change, atol=5e-5)


def test_a_shuttle_brakes_and_drives_backwards():
    parameters = carrier(((0.0, 0.0), (1.5, 0.0)), at_end="shuttle")
    turn = 1.5 / 0.3 + 0.3
    path = parameters.path()
    assert path.pose(turn)[:2] == pytest.approx((1.5, 0.0), abs=2e-3)
    assert path.velocity(turn)[0] == pytest.approx(0.0, abs=0.01)
    back = turn + 2.5
    assert path.velocity(back) == pytest.approx((-0.3, 0.0, 0.0), abs=1e-3)
    assert path.pose(back)[2] == pytest.approx(0.0, abs=1e-9)
    assert path.pose(2 * turn)[0] == pytest.approx(0.0, abs=2e-3)


def test_it_moves_alike_whatever_is_asked_first():
    """It is integrated in pieces, as far as asked."""
    times = [T * k for k in range(1200)]
    fresh = driven_path.__wrapped__(carrier(at_end="shuttle"))
    in_turn = [fresh.pose(time) for time in times]
    shuffled = random.Random(1).sample(times, len(times))
    other = driven_path.__wrapped__(carrier(at_end="shuttle"))
    found = {time: other.pose(time) for time in shuffled}
    assert in_turn == [found[time] for time in times]
    at_once = driven_path.__wrapped__(carrier(at_end="shuttle")).poses(times)
    np.testing.assert_allclose(at_once, in_turn, atol=1e-14)


def test_a_later_start_is_the_same_motion_later():
    now, later = carrier().path(), carrier(start_time_s=3.21).path()
    for time in np.linspace(0.0, 20.0, 97):
        assert later.pose(time + 3.21) == pytest.approx(now.pose(time), abs=1e-9)
    assert later.pose(3.2) == (0.0, 0.0, 0.0)
    np.testing.assert_array_equal(later.poses([0.0, 3.2]), np.zeros((2, 3)))


def test_one_that_rests_costs_nothing():
    path = carrier(((1.0, 2.0),)).path()
    assert not path.moves
    assert path.pose(1e9) == (1.0, 2.0, 0.0)
    assert path.velocity(1e9) == (0.0, 0.0, 0.0)
    np.testing.assert_array_equal(path.poses([0.0, 9.0]), [[1.0, 2.0, 0.0]] * 2)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"speed_m_s": 0.9}, r"speed_m_s: at 0.9 m/s corners need wheels .* lower it"),
        ({"acceleration_m_s2": 1.4}, "acceleration_m_s2: 1.4 .* reach 2 m/s.2.* lower"),
        ({"corner_radius_m": 0.0}, "corner_radius_m"),
    ],
)
def test_what_the_wheels_cannot_do_is_refused(fields, message):
    with pytest.raises(ValidationError, match=message):
        carrier(**fields)
