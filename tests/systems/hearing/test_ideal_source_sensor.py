"""Exact hearing: geometry, the tick of latency, the gate."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from phonotaxis.testing import Bench, assert_linearization
from systems.base.robot import RobotParameters
from systems.hearing.ideal_source_sensor import IdealSourceSensor, relative_position
from systems.sound.parameters import SoundParameters

pytestmark = pytest.mark.drake

place = st.floats(-5.0, 5.0)
angle = st.floats(-3.0, 3.0)

#: P at (1, 1.175), facing north; the source 2 m ahead and 1 m to the left.
POSES: dict[str, Any] = {
    "pose_WB": [1.0, 1.0, math.pi / 2],
    "pose_WS": [0.0, 3.175, 0.3],
}


def test_position_bearing_and_range_a_tick_later():
    at = Bench(IdealSourceSensor(always=True), **POSES)
    assert at.output("detected")[0] == 0.0
    at.tick()
    np.testing.assert_allclose(at.output("p_PS_B"), [2.0, 1.0], atol=1e-12)
    assert at.output("source_bearing")[0] == pytest.approx(math.atan2(1, 2))
    assert at.output("source_range")[0] == pytest.approx(math.sqrt(5))
    assert at.output("detected")[0] == at.output("range_valid")[0] == 1.0


def test_present_poses_do_not_show_before_the_tick():
    at = Bench(IdealSourceSensor(always=True), **POSES).tick()
    at.set(pose_WS=[9.0, 9.0, 0.0])
    np.testing.assert_allclose(at.output("p_PS_B"), [2.0, 1.0], atol=1e-12)
    at.tick()
    np.testing.assert_allclose(at.output("p_PS_B"), [7.825, -8.0], atol=1e-12)


def test_tells_front_from_back():
    poses: dict[str, Any] = {"pose_WB": [0, 0, 0], "pose_WS": [-1.825, 0.5, 0]}
    at = Bench(IdealSourceSensor(always=True), **poses).tick()
    np.testing.assert_allclose(at.output("p_PS_B"), [-2.0, 0.5], atol=1e-12)
    assert abs(at.output("source_bearing")[0]) > math.pi / 2


@given(place, place, angle, place, place, angle, place, place)
def test_relative_position_does_not_depend_on_the_frame(x, y, th, xs, ys, turn, dx, dy):
    here = relative_position((x, y, th), (xs, ys), 0.175)
    c, s = math.cos(turn), math.sin(turn)

    def moved(a, b):
        return c * a - s * b + dx, s * a + c * b + dy

    there = relative_position((*moved(x, y), th + turn), moved(xs, ys), 0.175)
    assert there == pytest.approx(here, abs=1e-9)


def heard_ticks(ticks: int, **gate) -> list[int]:
    """Ticks whose update hears the source."""
    at = Bench(IdealSourceSensor(**gate), **POSES)
    heard = []
    for tick in range(ticks):
        at.context.SetTime(tick * 0.025)
        if at.next_state()[2] > 0.5:
            heard.append(tick)
    return heard


def test_hears_the_frames_that_end_within_the_burst():
    """0.5 s in 2 s: frames 1 to 20, then 81 to 100."""
    expected = [*range(1, 21), *range(81, 101)]
    assert heard_ticks(140) == expected


def test_gate_is_set_by_its_parameters():
    heard = heard_ticks(90, sound=SoundParameters(on_s=0.1, period_s=1.0, start_s=0.5))
    assert heard == [*range(21, 25), *range(61, 65)]


def test_hears_at_any_distance():
    far = POSES | {"pose_WS": [0.0, 5e3, 0.3]}
    at = Bench(IdealSourceSensor(always=True), **far)
    assert at.next_state()[2] == 1.0


def test_exact_hearing_claims_no_error():
    at = Bench(IdealSourceSensor(always=True), **POSES).tick()
    np.testing.assert_array_equal(at.output("covariance"), np.zeros(4))


def test_gradient_of_the_measurement():
    block = IdealSourceSensor(
        robot=RobotParameters(control_point_m=0.2),
        sound=SoundParameters(on_s=0.2, period_s=1.0),
    )
    pose_WB, pose_WS = [0.3, -0.2, 0.8], [2.0, 1.1, 0.0]
    assert_linearization(
        block, time_s=0.1, state=[0.5, 0.4, 1.0], pose_WB=pose_WB, pose_WS=pose_WS
    )


def test_gradient_of_the_outputs():
    assert_linearization(IdealSourceSensor(), state=[1.4, -0.9, 1.0], **POSES)
