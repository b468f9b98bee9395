"""Dead reckoning: rounding, arcs, and the slip that it cannot see."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from scipy.integrate import quad

from phonotaxis.testing import Bench, assert_linearization, evaluate
from systems.base.diff_drive_plant import DiffDrivePlant
from systems.base.lagged_motion import advance_pose, lagged_motion
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.base.wheel_odometry import WheelOdometry, encoder_angle, odometry_step

pytestmark = pytest.mark.drake

ROBOT = RobotParameters()
EXACT = PlantParameters(pulses_per_revolution=None)
PULSE = math.tau / 2600
FIVE: Any = np.array([5.0, 5.0])


@given(st.floats(-1e3, 1e3), st.integers(10, 10_000))
def test_rounding_is_down_by_less_than_a_pulse(angle, pulses):
    rounded = encoder_angle(angle, pulses)
    assert -1e-9 <= angle - rounded < math.tau / pulses + 1e-9
    assert rounded * pulses / math.tau == pytest.approx(
        round(rounded * pulses / math.tau), abs=1e-6
    )


TICK_S, LAG_S, TOP = 0.025, 0.05, 12.0


class Driven(NamedTuple):
    """What rolling wheels do under a held command in each tick, in closed form."""

    angles: NDArray[np.float64]
    """(n + 1, 2) of the wheels at the ticks, rad."""
    places: NDArray[np.float64]
    """(n + 1, 2) of the axle, m."""
    headings: NDArray[np.float64]
    rolled: NDArray[np.float64]
    """(n + 1,) mean way of both rims, back and forth added up, m."""


def driven(commands: NDArray[np.float64], tick_s: float = TICK_S) -> Driven:
    """By quadrature with ten nodes a tick, and the rims' ways by 20 steps a tick."""
    at, weight = np.polynomial.legendre.leggauss(10)
    times = np.concatenate(
        [tick_s * (at + 1) / 2, [tick_s], tick_s * np.arange(21) / 20]
    )
    speed, speeds = np.zeros(2), []
    kept = math.exp(-tick_s / LAG_S)
    for command in commands:
        speeds.append(speed)
        speed = command + (speed - command) * kept
    lagged = (np.array(speeds) - commands)[:, None]
    decay = np.exp(-times / LAG_S)[None, :, None]
    steady = commands[:, None] * times[None, :, None]
    angles = steady + lagged * LAG_S * (1.0 - decay)
    rates = commands[:, None] + lagged * decay
    before = np.concatenate([np.zeros((1, 2)), np.cumsum(angles[:, 10], axis=0)])
    heading = (0.06 / 0.41) * ((before[:-1, None] + angles) @ [-1.0, 1.0])
    forward = 0.03 * rates[:, :10].sum(axis=2) * (0.5 * tick_s * weight)
    steps = np.stack([np.cos(heading[:, :10]), np.sin(heading[:, :10])], axis=-1)
    places = np.cumsum((forward[..., None] * steps).sum(axis=1), axis=0)
    ways = 0.03 * np.abs(np.diff(angles[:, 11:], axis=1)).sum(axis=(1, 2))
    return Driven(
        before,
        np.concatenate([np.zeros((1, 2)), places]),
        (0.06 / 0.41) * (before @ [-1.0, 1.0]),
        np.concatenate([[0.0], np.cumsum(ways)]),
    )


def by_odometry(
    commands: NDArray[np.float64],
    angles: NDArray[np.float64],
    plant: PlantParameters,
    tick_s: float = TICK_S,
) -> NDArray[np.float64]:
    """(n + 1, 3) poses of the block's step, at each tick before its new command."""
    block: Any = WheelOdometry(plant=plant, tick_s=tick_s)
    state, poses = [0.0] * 5, [[0.0] * 3]
    for tick, command in enumerate(commands.tolist()):
        outputs = [[0.0] * 3, [0.0] * 3]
        inputs = [angles[tick + 1].tolist(), command]
        odometry_step(tick + 1, state, inputs, outputs, block.step.numbers)
        poses.append(outputs[0])
    return np.array(poses)


def swinging(
    ticks: int, hz: float, phase: float, forward: float, turn: float, tick_s: float
) -> NDArray[np.float64]:
    """Wheel speeds that swing forward and in turning, within the wheels' limit."""
    angle = math.tau * hz * tick_s * np.arange(ticks)
    v, w = forward * np.cos(angle), turn * np.sin(angle + phase)
    return np.clip(np.column_stack([v - w, v + w]) * TOP, -TOP, TOP)


@pytest.mark.parametrize("tick_s", [0.025, 0.05])
@pytest.mark.parametrize("hz", [0.1, 0.5, 2.0, 3.2, 9.3])
def test_without_rounding_six_minutes_of_swinging_are_known_to_a_tenth_of_a_mm(
    hz, tick_s
):
    """Forward speed in phase with the yaw acceleration: a millimeter in an hour."""
    commands = swinging(round(360.0 / tick_s), hz, 0.0, 1.0, 1.0, tick_s)
    true = driven(commands, tick_s)
    poses = by_odometry(commands, true.angles, EXACT, tick_s)
    error = np.hypot(*(poses[:, :2] - true.places).T)
    assert error.max() < 1e-4
    np.testing.assert_allclose(poses[:, 2], true.headings, atol=1e-9)
    # They do drive: the mean heading over each tick would be off by far more.
    chords = np.cumsum(
        np.diff(true.angles, axis=0).mean(axis=1)
        * 0.06
        * np.exp(1j * (true.headings[1:] + true.headings[:-1]) / 2.0)
    )
    if hz > 1.0:
        off = abs(chords[-1] - complex(*true.places[-1]))
        assert off > 0.1


@pytest.mark.parametrize("pulses", [100, 2600])
def test_pulses_leave_the_place_within_the_bound_that_follows_from_them(pulses):
    """(q/L) s + q: swings, random commands, reversals within a pulse."""
    draw, worst = np.random.default_rng(5), 0.0
    ticks = 2400
    swings = [
        swinging(ticks, hz, phase, forward, turn, TICK_S)
        for hz in (0.3, 1.1, 3.2, 7.0)
        for phase in (0.0, 1.0)
        for forward, turn in ((1.0, 1.0), (0.3, 0.05))
    ]
    held = np.repeat(draw.uniform(-TOP, TOP, (ticks // 8, 2)), 8, axis=0)
    flips = np.where(np.arange(ticks)[:, None] % 2, 1.0, -1.0)
    dither = flips * draw.uniform(0.0, 4.0, (1, 2))
    q = 0.06 * math.tau / pulses
    for commands in (*swings, held, dither, 0.05 * held):
        true = driven(commands)
        plant = PlantParameters(pulses_per_revolution=pulses)
        poses = by_odometry(commands, true.angles, plant)
        error = np.hypot(*(poses[:, :2] - true.places).T)
        bound = q / 0.41 * true.rolled + q
        assert np.all(error <= bound)
        worst = max(worst, float((error / bound)[10:].max()))
    assert worst > 0.3


def test_an_arc_at_constant_speed_is_exact():
    motion = lagged_motion(TICK_S, LAG_S)
    x, y, theta = advance_pose((0.3, -0.2, 0.8), (0.21, 0.44), (0.21, 0.44), motion)
    radius = 0.21 / 0.44
    assert x == pytest.approx(
        0.3 + radius * (math.sin(1.24) - math.sin(0.8)), abs=1e-12
    )
    assert y == pytest.approx(
        -0.2 - radius * (math.cos(1.24) - math.cos(0.8)), abs=1e-12
    )
    assert theta == pytest.approx(1.24)


def test_a_straight_line_is_exact():
    motion = lagged_motion(TICK_S, LAG_S)
    pose = advance_pose((1.0, 2.0, math.pi / 6), (0.6, 0.0), (0.9, 0.0), motion)
    expected = (1.0 + 0.6 * math.cos(math.pi / 6), 2.3, math.pi / 6)
    assert pose == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("lag", [0.001, 0.02, 0.05, 0.5])
@pytest.mark.parametrize("tick_s", [0.001, 0.025, 1.0])
def test_quadrature_follows_any_lag_and_any_tick(tick_s, lag):
    """Against SciPy's adaptive integral of cos(heading) along the way."""
    motion = lagged_motion(tick_s, lag)
    # Left and right wheel at first, and their commands, rad/s.
    (left, right), (steady_left, steady_right) = (12.0, -3.0), (-12.0, 8.0)
    rate, turn_rate = 0.03 * (steady_left + steady_right), 0.06 / 0.41 * 20.0
    lagged_way = 0.03 * (left + right) - rate
    lagged_turn = 0.06 / 0.41 * (right - left) - turn_rate

    def eastward(t: float) -> float:
        behind = -lag * math.expm1(-t / lag)
        speed = rate + lagged_way * math.exp(-t / lag)
        return speed * math.cos(0.4 + turn_rate * t + lagged_turn * behind)

    points = [min(lag, tick_s / 2), min(5 * lag, 0.9 * tick_s)]
    exactly = {"epsabs": 1e-13, "epsrel": 1e-12, "limit": 200, "points": points}
    expected = quad(eastward, 0.0, tick_s, **exactly)[0]
    steady = rate * tick_s, turn_rate * tick_s
    behind = -lag * math.expm1(-tick_s / lag)
    traveled = steady[0] + lagged_way * behind, steady[1] + lagged_turn * behind
    x, _, _ = advance_pose((0.0, 0.0, 0.4), traveled, steady, motion)
    assert x == pytest.approx(expected, abs=2e-9)


def test_pose_follows_the_angles_without_a_tick_of_delay():
    block = WheelOdometry(plant=EXACT, initial_pose=(1.0, 2.0, 0.0))
    at = Bench(block, wheel_angles=[0.0, 0.0], wheel_speeds=[10.0, 10.0])
    at.set(wheel_angles=[0.25, 0.25])
    np.testing.assert_allclose(at.output("pose_WB_estimated"), [1.015, 2.0, 0.0])
    np.testing.assert_allclose(
        at.output("velocity_WB_estimated"), [0.6, 0.0, 0.0], atol=1e-12
    )


def test_pose_adds_up_over_ticks():
    at = Bench(
        WheelOdometry(plant=EXACT), wheel_angles=[0.0, 0.0], wheel_speeds=[8.0, 12.0]
    )
    for k in range(1, 30):
        at.set(wheel_angles=[0.2 * k, 0.3 * k])
        way, turn = 0.06 * 0.25 * k, 0.06 * 0.1 * k / 0.41
        radius = way / turn
        expected = radius * math.sin(turn), radius * (1.0 - math.cos(turn)), turn
        np.testing.assert_allclose(at.output("pose_WB_estimated"), expected, atol=1e-12)
        at.tick()


@pytest.mark.parametrize(("angle", "pulses"), [(0.9, 0), (1.1, 1), (-0.1, -1)])
def test_encoders_count_whole_pulses(angle, pulses):
    outputs = evaluate(
        WheelOdometry(),
        wheel_angles=[angle * PULSE, angle * PULSE],
        wheel_speeds=[0.0, 0.0],
    )
    expected = 0.06 * pulses * PULSE
    np.testing.assert_allclose(outputs["pose_WB_estimated"], [expected, 0, 0])


def test_rounding_does_not_accumulate():
    """Angles are rounded, not steps: after 500 ticks still within a pulse."""
    at = Bench(WheelOdometry(), wheel_angles=[0.0, 0.0], wheel_speeds=[0.3, 0.3])
    step = 3.3717 * PULSE
    for k in range(1, 501):
        angles = [k * step, k * step]
        at.set(wheel_angles=angles)
        at.tick()
    driven = at.output("pose_WB_estimated")[0]
    assert 0.0 <= 0.06 * 500 * step - driven < 0.06 * PULSE


def test_slip_goes_unseen():
    """The robot turns away; its odometry reports the straight line asked for."""
    builder = DiagramBuilder()
    command = builder.AddSystem(ConstantVectorSource(FIVE))
    slipping = PlantParameters(slip=(0.2, 0.0))
    plant = builder.AddSystem(DiffDrivePlant(plant=slipping))
    odometry = builder.AddSystem(WheelOdometry(plant=EXACT))
    builder.Connect(command.get_output_port(), plant.GetInputPort("wheel_speeds"))
    builder.Connect(command.get_output_port(), odometry.GetInputPort("wheel_speeds"))
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
    with pytest.raises(ValueError, match="pulses_per_revolution is 2600"):
        WheelOdometry().ToAutoDiffXd()


def test_gradient():
    robot = RobotParameters(wheel_radius_m=0.1, wheel_separation_m=0.5)
    block = WheelOdometry(robot=robot, plant=EXACT)
    assert_linearization(
        block,
        state=[0.3, -0.2, 0.9, 4.0, 5.0],
        wheel_angles=[4.3, 5.6],
        wheel_speeds=[3.0, -2.0],
    )
