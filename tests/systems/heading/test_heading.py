"""Compass, PID and pulse widths: closed forms, printed tables, the closed loop."""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numba import njit
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

from systems import DiffDrivePlant, HeadingController, MagneticHeading, MotorDriver
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.heading.heading_controller import PULSE_WIDTHS, motor_duties
from systems.heading.parameters import CompassParameters, HeadingControlParameters

MENDED, PRINTED, ELSE_ONLY = range(len(PULSE_WIDTHS))


def heading(theta_deg, **own):
    step = MagneticHeading(parameters=CompassParameters(noise_deg=0.0, **own)).step
    outputs = [[0.0]]
    step.step(0, [], [[0.0, 0.0, math.radians(theta_deg)]], outputs, step.numbers)
    return outputs[0][0]


@pytest.mark.parametrize("theta_deg", range(-180, 181, 7))
def test_the_heading_is_clockwise_from_north_all_round(theta_deg):
    """North is along y of W; the printed ratio Hy / Hx is right in two quadrants."""
    off = math.remainder(heading(theta_deg) - (90.0 - theta_deg), 360.0)
    assert abs(off) < 1e-9


@pytest.mark.parametrize(
    ("share", "most"), [(0.02, 1.146), (0.05, 2.866), (0.1, 5.739)]
)
def test_hard_iron_turns_it_by_up_to_its_arcsine(share, most):
    off = [
        abs(math.remainder(heading(t, hard_iron=(share, 0.0)) - (90.0 - t), 360.0))
        for t in np.linspace(-180.0, 180.0, 721)
    ]
    assert max(off) == pytest.approx(math.degrees(math.asin(share)), abs=0.01)
    assert max(off) == pytest.approx(most, abs=0.01)


@given(st.floats(-100.0, 100.0))
def test_the_mended_map_is_speed_and_turn(error):
    left, right = motor_duties(error, 50.0, MENDED)
    v, w = max(0.0, 1.0 - abs(error) / 50.0), 0.01 * error
    assert (left, right) == pytest.approx((v + w, v - w), abs=1e-12)
    assert max(abs(left), abs(right)) <= 1.0 + 1e-12


@given(st.floats(-50.0, 50.0))
def test_the_mended_map_is_table_2_with_its_bracket_mended(error):
    """Left (0.01 -+ 1/L) e + 1, right as printed."""
    sign = 1.0 if error >= 0.0 else -1.0
    left = (0.01 - sign / 50.0) * error + 1.0
    right = -(0.01 + sign / 50.0) * error + 1.0
    assert motor_duties(error, 50.0, MENDED) == pytest.approx((left, right), abs=1e-12)


def test_the_printed_map_drives_both_motors_backwards():
    assert motor_duties(100.0, 50.0, PRINTED) == pytest.approx((-0.98, -2.0), abs=1e-12)


def test_with_the_else_alone_it_jumps_by_half():
    below, above = (motor_duties(e, 50.0, ELSE_ONLY)[0] for e in (50.0, 50.0 + 1e-9))
    assert abs(above - below) == pytest.approx(0.49, abs=1e-6)


def turned(step_deg, seconds=6.0, pulse_widths="mended"):
    """(n,) heading so far, deg clockwise, and (n,) speed ahead, of a turn."""
    robot = RobotParameters(preset="song2011_hearing")
    builder = DiagramBuilder()
    plant = DiffDrivePlant(robot=robot, plant=PlantParameters(motor_lag_s=0.1))
    blocks = [
        plant,
        MagneticHeading(parameters=CompassParameters(noise_deg=0.0)),
        HeadingController(
            parameters=HeadingControlParameters(pulse_widths=pulse_widths)
        ),
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


def test_as_printed_it_drives_backwards():
    _, ahead = turned(90.0, pulse_widths="printed")
    assert ahead.min() < -0.1


def test_with_the_else_alone_it_is_slow():
    mended, alone = (
        settled_s(turned(90.0, pulse_widths=kind)[0], 90.0)
        for kind in ("mended", "else_only")
    )
    assert alone > 1.3 * mended


def duties(deviations, compiled=False):
    """(n, 2) at deviations that change as told, deg."""
    step = HeadingController().step
    numbers = step.numbers
    work = step.step
    if compiled:
        own = numbers.own
        kind: Any = namedtuple("kind", [*own.model_dump()])  # type: ignore[misc]
        numbers = numbers._replace(own=kind(*own.model_dump().values()))
        work = njit(step.step)
    state, rows = np.array(step.state), []
    for tick, deviation in enumerate(deviations):
        expected, now = np.array([179.0]), np.array([179.0 - deviation])
        outputs = (np.zeros(2),)
        work(tick, state, (expected, now, np.ones(1)), outputs, numbers)
        rows.append(outputs[0])
    return np.array(rows)


def test_no_kick_at_the_begin_and_none_at_the_wrap():
    """A differential part of 20 deg there would be 0.4 of duty."""
    first = duties([10.0])[0]
    assert first == pytest.approx(motor_duties(20.0 + 0.5 * 10.0 * 0.025, 50.0, MENDED))
    across = duties([179.5, -179.5 + 360.0 - 360.0])
    assert np.abs(across).max() <= 1.0
    errors = 0.5 * (across[:, 0] - across[:, 1]) / 0.01
    assert errors == pytest.approx([100.0, -100.0])


def test_compiled_it_does_the_same():
    deviations = 30.0 * np.sin(np.arange(200) / 15.0)
    np.testing.assert_allclose(duties(deviations), duties(deviations, True), rtol=1e-12)
