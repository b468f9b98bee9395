"""Dead reckoning: rounding, arcs, and the slip that it cannot see."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from systems.base.diff_drive_plant import DiffDrivePlant
from systems.base.parameters import OdometryParameters, PlantParameters
from systems.base.robot import RobotParameters
from systems.base.wheel_odometry import WheelOdometry, advance_pose, encoder_angle

ROBOT = RobotParameters()
EXACT = OdometryParameters(rounding=False)
PULSE = math.tau / 2600
FIVE: Any = np.array([5.0, 5.0])


@given(st.floats(-1e3, 1e3), st.integers(10, 10_000))
def test_rounding_is_down_by_less_than_a_pulse(angle, pulses):
    rounded = encoder_angle(angle, pulses)
    assert -1e-9 <= angle - rounded < math.tau / pulses + 1e-9
    assert rounded * pulses / math.tau == pytest.approx(
        round(rounded * pulses / math.tau), abs=1e-6
    )


def arc(pose, steps):
    """Where an exact circular arc ends."""
    left, right = (0.06 * step for step in steps)
    turn = (right - left) / 0.41
    radius = (left + right) / 2 / turn
    x, y, theta = pose
    return (
        x + radius * (math.sin(theta + turn) - math.sin(theta)),
        y - radius * (math.cos(theta + turn) - math.cos(theta)),
        theta + turn,
    )


def test_error_of_a_step_is_of_third_order():
    """Half the step, an eighth of the error; the chord is short by d turn^2/24."""
    pose, errors = (0.3, -0.2, 0.8), []
    for part in (1.0, 0.5, 0.25):
        steps = (2.0 * part, 5.0 * part)
        error = np.subtract(advance_pose(pose, steps, ROBOT), arc(pose, steps))
        errors.append(np.linalg.norm(error))
    distance, turn = 0.06 * 3.5, 0.06 * 3.0 / 0.41
    assert errors[0] == pytest.approx(distance * turn**2 / 24, rel=0.02)
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.02)
    assert errors[1] / errors[2] == pytest.approx(8.0, rel=0.02)


def test_a_straight_line_is_exact():
    pose = advance_pose((1.0, 2.0, math.pi / 6), (10.0, 10.0), ROBOT)
    expected = (1.0 + 0.6 * math.cos(math.pi / 6), 2.3, math.pi / 6)
    assert pose == pytest.approx(expected)


def test_pose_follows_the_angles_without_a_tick_of_delay(bench):
    block = WheelOdometry(odometry=EXACT, initial_pose=(1.0, 2.0, 0.0))
    at = bench(block, wheel_angles=[0.0, 0.0])
    at.block.GetInputPort("wheel_angles").FixValue(at.context, [0.25, 0.25])
    np.testing.assert_allclose(at.output("pose_WB_estimated"), [1.015, 2.0, 0.0])
    np.testing.assert_allclose(
        at.output("velocity_WB_estimated"), [0.6, 0.0, 0.0], atol=1e-12
    )


def test_pose_adds_up_over_ticks(bench):
    at = bench(WheelOdometry(odometry=EXACT), wheel_angles=[0.0, 0.0])
    pose = (0.0, 0.0, 0.0)
    for k in range(1, 30):
        at.block.GetInputPort("wheel_angles").FixValue(at.context, [0.2 * k, 0.3 * k])
        pose = advance_pose(pose, (0.2, 0.3), ROBOT)
        np.testing.assert_allclose(at.output("pose_WB_estimated"), pose)
        at.tick()
    exact = arc((0.0, 0.0, 0.0), (0.2 * 29, 0.3 * 29))
    np.testing.assert_allclose(pose, exact, atol=1e-5)


@pytest.mark.parametrize(("angle", "pulses"), [(0.9, 0), (1.1, 1), (-0.1, -1)])
def test_encoders_count_whole_pulses(bench, angle, pulses):
    at = bench(WheelOdometry(), wheel_angles=[angle * PULSE, angle * PULSE])
    expected = 0.06 * pulses * PULSE
    np.testing.assert_allclose(at.output("pose_WB_estimated"), [expected, 0, 0])


def test_rounding_does_not_accumulate(bench):
    """Angles are rounded, not steps: after 500 ticks still within a pulse."""
    at = bench(WheelOdometry(), wheel_angles=[0.0, 0.0])
    step = 3.3717 * PULSE
    for k in range(1, 501):
        angles = [k * step, k * step]
        at.block.GetInputPort("wheel_angles").FixValue(at.context, angles)
        at.tick()
    driven = at.output("pose_WB_estimated")[0]
    assert 0.0 <= 0.06 * 500 * step - driven < 0.06 * PULSE


def test_slip_goes_unseen():
    """The robot turns away; its odometry reports the straight line asked for."""
    builder = DiagramBuilder()
    command = builder.AddSystem(ConstantVectorSource(FIVE))
    slipping = PlantParameters(slip=(0.2, 0.0))
    plant = builder.AddSystem(DiffDrivePlant(plant=slipping))
    odometry = builder.AddSystem(WheelOdometry(odometry=EXACT))
    builder.Connect(command.get_output_port(), plant.GetInputPort("wheel_speeds"))
    builder.Connect(
        plant.GetOutputPort("wheel_angles"), odometry.GetInputPort("wheel_angles")
    )
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(2.0)
    context = simulator.get_context()
    believed: Any = odometry.GetOutputPort("pose_WB_estimated").Eval(
        odometry.GetMyContextFromRoot(context)
    )
    true: Any = plant.GetOutputPort("pose_WB").Eval(plant.GetMyContextFromRoot(context))
    path = 0.3 * (2.0 - 0.05)
    np.testing.assert_allclose(believed, [path, 0.0, 0.0], atol=1e-3)
    assert true[2] == pytest.approx(0.06 * 1.0 / 0.41 * (2.0 - 0.05), rel=1e-3)


def test_a_rounded_angle_has_no_derivative():
    with pytest.raises(ValueError, match=r"set odometry\.rounding to false"):
        WheelOdometry().ToAutoDiffXd()


def test_gradient(bench, check_gradient):
    def respond(block, x):
        at = bench(block, state=x[:5], wheel_angles=x[5:])
        pose = at.output("pose_WB_estimated")
        return [*pose, *at.output("velocity_WB_estimated"), *at.updated()]

    robot = RobotParameters(wheel_radius_m=0.1, wheel_separation_m=0.5)
    block = WheelOdometry(robot=robot, odometry=EXACT)
    check_gradient(block, respond, [0.3, -0.2, 0.9, 4.0, 5.0, 4.3, 5.6])
