"""The base against closed forms: motor lag, lines, turns, slip, saturation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from diagrams.scenario.run_parameters import RunParameters
from phonotaxis.testing import Bench, assert_linearization
from systems.base.diff_drive_plant import DiffDrivePlant
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.framework.block import RunFacts

pytestmark = pytest.mark.drake

LAG = 0.05


def drive(block, wheel_speeds, duration: float) -> dict[str, np.ndarray]:
    """Outputs after a constant command."""
    simulator = Simulator(block)
    config = SimulatorConfig()
    config.integration_scheme = "runge_kutta5"
    config.max_step_size = 0.005
    config.use_error_control = False
    ApplySimulatorConfig(config, simulator)
    context = simulator.get_mutable_context()
    block.GetInputPort("wheel_speeds").FixValue(context, np.asarray(wheel_speeds))
    simulator.AdvanceTo(duration)
    names = ("pose_WB", "velocity_WB", "wheel_angles")
    return {name: block.GetOutputPort(name).Eval(context) for name in names}


def lagged(duration: float, lag: float = LAG) -> float:
    """Integral of 1 - exp(-t / lag)."""
    return duration - lag * (1.0 - math.exp(-duration / lag))


@pytest.mark.parametrize("duration", [0.02, 0.05, 0.3])
def test_step_response_of_a_straight_line(duration):
    """v (1 - exp(-t/tau)), and its integral, along the heading."""
    block = DiffDrivePlant(initial_pose=(1.0, 2.0, math.radians(30)))
    result = drive(block, (5.0, 5.0), duration)
    direction = np.array([math.cos(math.radians(30)), 0.5])
    speed = 0.3 * (1.0 - math.exp(-duration / LAG))
    np.testing.assert_allclose(
        result["velocity_WB"], [*(speed * direction), 0.0], rtol=1e-6, atol=1e-12
    )
    path = 0.3 * lagged(duration)
    expected = [*(np.array([1.0, 2.0]) + path * direction), math.radians(30)]
    np.testing.assert_allclose(result["pose_WB"], expected, rtol=1e-7)
    angle = 5.0 * lagged(duration)
    np.testing.assert_allclose(result["wheel_angles"], [angle, angle], rtol=1e-6)


def test_pure_turn_stays_in_place():
    result = drive(DiffDrivePlant(), (-5.0, 5.0), 2.0)
    turn = 2 * 0.3 / 0.41 * lagged(2.0)
    np.testing.assert_allclose(result["pose_WB"], [0.0, 0.0, turn], atol=1e-9)
    assert turn > 2.0, "and the heading is not wrapped on its way"


def test_unequal_wheels_drive_a_circle():
    """The ratio of the rims fixes the center, whatever the motors' lag."""
    result = drive(DiffDrivePlant(), (3.0, 6.0), 4.0)
    radius = 0.41 / 2 * (6 + 3) / (6 - 3)
    theta = 0.06 * (6 - 3) / 0.41 * lagged(4.0)
    expected = [radius * math.sin(theta), radius * (1 - math.cos(theta)), theta]
    np.testing.assert_allclose(result["pose_WB"], expected, atol=1e-7)


def test_own_lag():
    plant = PlantParameters(motor_lag_s=0.2)
    result = drive(DiffDrivePlant(plant=plant), (5.0, 5.0), 0.5)
    assert result["pose_WB"][0] == pytest.approx(0.3 * lagged(0.5, 0.2), rel=1e-6)


def test_command_saturates_wheel_by_wheel():
    """12 rad/s is the rim's 0.72 m/s; one wheel at its limit bends the path."""
    result = drive(DiffDrivePlant(), (40.0, 6.0), 1.0)
    forward = 0.06 * (12.0 + 6.0) / 2
    speed = math.hypot(*result["velocity_WB"][:2])
    assert speed == pytest.approx(forward, rel=1e-6)
    assert result["velocity_WB"][2] == pytest.approx(0.06 * (6 - 12) / 0.41, rel=1e-6)
    backwards = drive(DiffDrivePlant(), (-40.0, -40.0), 1.0)
    assert backwards["velocity_WB"][0] == pytest.approx(-0.72, rel=1e-6)


def test_slip_loses_rim_speed_and_no_wheel_angle():
    plant = PlantParameters(slip=(0.2, 0.0))
    result = drive(DiffDrivePlant(plant=plant), (5.0, 5.0), 1.0)
    turn = 0.06 * (5.0 - 4.0) / 0.41 * lagged(1.0)
    assert result["pose_WB"][2] == pytest.approx(turn)
    np.testing.assert_allclose(result["wheel_angles"], 5.0 * lagged(1.0))


def test_larger_wheels_drive_farther_than_they_turn():
    worn = drive(
        DiffDrivePlant(plant=PlantParameters(slip=(-0.02, -0.02))), (5, 5), 1.0
    )
    larger = drive(
        DiffDrivePlant(robot=RobotParameters(wheel_radius_m=0.0612)), (5, 5), 1.0
    )
    np.testing.assert_allclose(worn["pose_WB"], larger["pose_WB"])
    np.testing.assert_allclose(worn["wheel_angles"], 5.0 * lagged(1.0))


def test_own_dimensions():
    robot = RobotParameters(wheel_radius_m=0.1, wheel_separation_m=0.5)
    result = drive(DiffDrivePlant(robot=robot), (1.0, 2.0), 1.0)
    assert result["pose_WB"][2] == pytest.approx(0.1 / 0.5 * lagged(1.0))


@pytest.mark.parametrize("command", [[math.nan, 0.0], [0.0, math.inf]])
def test_a_command_that_is_not_finite_is_an_error(command):
    at = Bench(DiffDrivePlant(), wheel_speeds=command)
    with pytest.raises(ValueError, match=r"DiffDrivePlant: .* block upstream"):
        at.rates()


@pytest.mark.parametrize("wheel_speeds", [[4.0, -3.0], [20.0, -15.0]])
def test_gradient(wheel_speeds):
    """Derivatives and outputs, free and saturated."""
    robot = RobotParameters(wheel_radius_m=0.1, wheel_separation_m=0.5)
    plant = PlantParameters(motor_lag_s=0.1, slip=(0.1, 0.3))
    block = DiffDrivePlant(robot=robot, plant=plant)
    state = [0.5, -0.2, 0.7, 3.0, 2.0, 1.5, -0.8]
    assert_linearization(block, state=state, wheel_speeds=wheel_speeds)


def test_initial_pose_survives_conversion():
    block = DiffDrivePlant(initial_pose=(1.0, 2.0, 3.0)).ToAutoDiffXd()
    state = block.CreateDefaultContext().get_continuous_state_vector()
    values = [x.value() for x in state.CopyToVector()]
    assert values == [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("hz", [3.2, 6.4, 9.9])
@pytest.mark.parametrize("tick_s", [0.025, 0.05])
def test_the_default_integrator_stays_within_a_micrometer_of_the_path(tick_s, hz):
    """20 s of swinging at full speed and full turns, against quadrature.

    Third order with a step of 25 ms would leave this path by 4 mm and more.
    """
    step_s = RunParameters().integration_step_s
    facts = RunFacts(0, tick_s, (0.0,) * 3, step_s, len, {})
    step = DiffDrivePlant().step_for(facts)
    state = np.array(step.state)
    x, heading = np.zeros(2), 0.0
    speeds = np.zeros(2)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    times, weights = tick_s * (nodes + 1.0) / 2.0, tick_s * weights / 2.0
    for tick in range(round(20.0 / tick_s)):
        at = math.tau * hz * tick * tick_s
        v, turn = 0.5 * math.cos(at), 0.5 * math.sin(at)
        command = 12.0 * np.array([v - turn, v + turn])
        step.step(tick, state, (command,), (), step.numbers)
        # The closed form of the wheels, and quadrature of the way along the heading.
        off = speeds - command
        decay = np.exp(-times / LAG)[:, None]
        turned = (command * times[:, None] + off * LAG * (1.0 - decay)) @ [-1.0, 1.0]
        headings = heading + 0.06 / 0.41 * turned
        forward = 0.03 * (command + off * decay).sum(axis=1) * weights
        x += forward @ np.column_stack([np.cos(headings), np.sin(headings)])
        kept = math.exp(-tick_s / LAG)
        whole = command * tick_s + off * LAG * (1.0 - kept)
        heading += 0.06 / 0.41 * (whole[1] - whole[0])
        speeds = command + off * kept
    assert math.hypot(*(state[:2] - x)) < 1e-6
    assert state[2] == pytest.approx(heading, abs=5e-8)


@pytest.mark.parametrize("step_s", [0.00625, 0.01, 0.0125, 0.025])
def test_a_compiled_tick_is_drakes_to_the_last_bit(step_s):
    """Random commands, each held for a tick."""
    tick_s, ticks = 0.025, 60
    commands = np.random.default_rng(0).uniform(-12.0, 12.0, (ticks, 2))

    class Commands(LeafSystem):
        def __init__(self):
            super().__init__()
            self.DeclareStateOutputPort("held", self.DeclareDiscreteState(2))
            self.DeclarePeriodicDiscreteUpdateEvent(tick_s, 0.0, self.hold)

        def hold(self, context, state):
            state.set_value(0, commands[round(context.get_time() / tick_s) % ticks])

    builder = DiagramBuilder()
    held, plant = builder.AddSystem(Commands()), builder.AddSystem(DiffDrivePlant())
    builder.Connect(held.get_output_port(), plant.get_input_port())
    simulator = Simulator(builder.Build())
    config = SimulatorConfig(
        integration_scheme="runge_kutta5",
        max_step_size=step_s,
        use_error_control=False,
    )
    ApplySimulatorConfig(config, simulator)
    simulator.Initialize()
    context = plant.GetMyContextFromRoot(simulator.get_context())
    facts = RunFacts(0, tick_s, (0.0,) * 3, step_s, len, {})
    step = DiffDrivePlant().step_for(facts)
    state = np.array(step.state)
    for tick, command in enumerate(commands):
        simulator.AdvanceTo((tick + 1) * tick_s)
        step.step(tick, state, (command,), (), step.numbers)
        drakes = context.get_continuous_state_vector().CopyToVector()
        np.testing.assert_array_equal(state, drakes)
