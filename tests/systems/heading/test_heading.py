"""Compass, PID and pulse widths: closed forms, printed tables, the closed loop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from systems import DiffDrivePlant, HeadingController, MagneticHeading, MotorDriver
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.framework.compiling import njit
from systems.heading import heading_controller
from systems.heading.heading_controller import motor_duties
from systems.heading.parameters import CompassParameters


def heading(theta_deg):
    step = MagneticHeading(parameters=CompassParameters(noise_deg=0.0)).step
    outputs = [[0.0]]
    step.step(0, [], [[0.0, 0.0, math.radians(theta_deg)]], outputs, step.numbers)
    return outputs[0][0]


@pytest.mark.parametrize("theta_deg", range(-180, 181, 7))
def test_the_heading_is_clockwise_from_north_all_round(theta_deg):
    """North is along y of W; the printed ratio Hy / Hx is right in two quadrants."""
    off = math.remainder(heading(theta_deg) - (90.0 - theta_deg), 360.0)
    assert abs(off) < 1e-9


@given(st.floats(-100.0, 100.0))
def test_the_mended_map_is_speed_and_turn(error):
    left, right = motor_duties(error)
    v, w = max(0.0, 1.0 - abs(error) / 50.0), 0.01 * error
    assert (left, right) == pytest.approx((v + w, v - w), abs=1e-12)
    assert max(abs(left), abs(right)) <= 1.0 + 1e-12


@given(st.floats(-50.0, 50.0))
def test_the_mended_map_is_table_2_with_its_bracket_mended(error):
    """Left (0.01 -+ 1/L) e + 1, right as printed."""
    sign = 1.0 if error >= 0.0 else -1.0
    left = (0.01 - sign / 50.0) * error + 1.0
    right = -(0.01 + sign / 50.0) * error + 1.0
    assert motor_duties(error) == pytest.approx((left, right), abs=1e-12)


def turned(step_deg, seconds=6.0):
    """(n,) heading so far, deg clockwise, and (n,) speed ahead, of a turn."""
    robot = RobotParameters(preset="song2011_hearing")
    builder = DiagramBuilder()
    plant = DiffDrivePlant(robot=robot, plant=PlantParameters(motor_lag_s=0.1))
    blocks = [
        plant,
        MagneticHeading(parameters=CompassParameters(noise_deg=0.0)),
        HeadingController(),
        MotorDriver(robot=robot),
    ]
    wanted: Any = np.array([90.0 + step_deg])
    expected = ConstantVectorSource(wanted)
    for block in (*blocks, expected):
        builder.AddSystem(block)
    _, compass, control, motors = blocks
    for out, name, into in (
        (plant, "pose_WB", compass),
        (compass, "heading_deg", control),
        (control, "duty", motors),
        (motors, "wheel_speeds", plant),
    ):
        builder.Connect(out.GetOutputPort(name), into.GetInputPort(name))
    builder.Connect(
        expected.get_output_port(), control.GetInputPort("expected_heading_deg")
    )
    always: Any = np.array([1.0])
    move = builder.AddSystem(ConstantVectorSource(always))
    builder.Connect(move.get_output_port(), control.GetInputPort("move"))
    log = LogVectorOutput(plant.GetOutputPort("pose_WB"), builder, publish_period=0.025)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(seconds)
    x, y, theta = log.FindLog(simulator.get_context()).data()
    ahead = np.cos(theta[:-1]) * np.diff(x) + np.sin(theta[:-1]) * np.diff(y)
    return -np.degrees(theta), ahead / 0.025


def settled_s(headings, step_deg):
    off = np.flatnonzero(np.abs(headings - step_deg) > 2.0)
    return 0.025 * (off[-1] + 1)


@pytest.mark.parametrize(("step_deg", "within_s"), [(60, 1.3), (-120, 2.0), (170, 2.5)])
def test_mended_it_turns_quickly_and_hardly_too_far(step_deg, within_s):
    headings, _ = turned(step_deg)
    assert settled_s(headings, step_deg) < within_s
    assert np.max(np.sign(step_deg) * headings) < abs(step_deg) + 2.0


def test_with_the_printed_duties_it_drives_backwards(monkeypatch):
    """docs/results_searches.md: the second branch of table 2 overwrites the first."""

    def printed(error):
        sign = 1.0 if error >= 0.0 else -1.0
        left = (0.01 - sign) / 50.0 * error + 1.0
        return left, -(0.01 + sign / 50.0) * error + 1.0

    monkeypatch.setattr(heading_controller, "motor_duties", printed)
    headings, ahead = turned(90.0)
    assert ahead.min() < -0.1
    assert headings[-1] < 80.0  # still turning after 6 s


def duties(deviations, compiled=False):
    """(n, 2) at deviations that change as told, deg."""
    step = HeadingController().step
    work = njit(step.step, cache=True) if compiled else step.step
    state, rows = np.array(step.state), []
    for tick, deviation in enumerate(deviations):
        expected, now = np.array([179.0]), np.array([179.0 - deviation])
        outputs = (np.zeros(2),)
        work(tick, state, (expected, now, np.ones(1)), outputs, step.numbers)
        rows.append(outputs[0])
    return np.array(rows)


def test_no_kick_at_the_begin_and_none_at_the_wrap():
    """A differential part of 20 deg there would be 0.4 of duty."""
    first = duties([10.0])[0]
    assert first == pytest.approx(motor_duties(20.0 + 0.5 * 10.0 * 0.025))
    across = duties([179.5, -179.5 + 360.0 - 360.0])
    assert np.abs(across).max() <= 1.0
    errors = 0.5 * (across[:, 0] - across[:, 1]) / 0.01
    assert errors == pytest.approx([100.0, -100.0])


def test_compiled_it_does_the_same():
    deviations = 30.0 * np.sin(np.arange(200) / 15.0)
    np.testing.assert_allclose(duties(deviations), duties(deviations, True), rtol=1e-12)
