"""What a controller commands, by its output ports, and what the robot makes of it.

The blocks here know no obstacles: what they command is constant, and the motion has
a closed form once the motors have settled.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.systems.framework import LeafSystem

from diagrams import build_sound_follower, load_scenario, make_simulator
from diagrams.building.laws import make_command, make_controller
from diagrams.scenario.scenario import Scenario
from systems.base.robot import RobotParameters
from systems.framework.input_error import InputError
from systems.world.geometry import control_point, control_point_velocity

pytestmark = pytest.mark.drake

MODULE = """
from pydrake.systems.framework import LeafSystem


class Constant(LeafSystem):
    command: dict = {}

    def __init__(self, robot, attraction, laws):
        super().__init__()
        self.set_name("constant")
        for name, value in self.command.items():
            self.DeclareVectorOutputPort(name, len(value), self.writer(value))

    @staticmethod
    def writer(value):
        return lambda context, output: output.SetFromVector(value)


class Velocity(Constant):
    command = {"velocity_W": [0.2, 0.3]}


class TooFast(Constant):
    command = {"velocity_W": [-3.0, 4.0]}


class Twist(Constant):
    command = {"twist_B": [0.3, -0.4]}


class Spin(Constant):
    command = {"twist_B": [0.9, 9.0]}


class Nothing(Constant):
    command = {"forces_W": [0.0] * 4}


class Both(Constant):
    command = {"twist_B": [0.3, -0.4], "velocity_W": [0.2, 0.3]}


class Wide(Constant):
    command = {"velocity_W": [0.2, 0.3, 0.0]}


class OddForces(Constant):
    command = {"velocity_W": [0.2, 0.3], "forces_W": [0.0, 0.0]}
"""


@pytest.fixture
def constants(tmp_path: Path) -> str:
    path = tmp_path / "constants.py"
    path.write_text(MODULE, "utf-8")
    return str(path)


def settled(law: str) -> tuple[Any, Any]:
    """A run's plant and its simulator after 6 s: 100 lags of the motors."""
    settings = ["hearing=ideal", "obstacle_sensing=ideal", f"law={law}"]
    scenario = load_scenario("obstacle_free", settings)
    follower = build_sound_follower(scenario)
    simulator = make_simulator(follower)
    simulator.Initialize()
    simulator.AdvanceTo(6.0)
    return follower.blocks["plant"], simulator


def motion(plant: Any, simulator: Any) -> tuple[Any, Any]:
    """Pose and velocity (vx, vy, omega) of B in W."""
    context = plant.GetMyContextFromRoot(simulator.get_context())
    ports = ("pose_WB", "velocity_WB")
    pose, velocity = (plant.GetOutputPort(name).Eval(context).copy() for name in ports)
    return pose, velocity


def test_constant_velocity_drives_the_control_point(constants):
    plant, simulator = settled(f"{constants}:Velocity")
    pose, velocity = motion(plant, simulator)
    v_WP = control_point_velocity(pose[2], velocity, 0.175)
    np.testing.assert_allclose(v_WP, [0.2, 0.3], atol=1e-3)
    simulator.AdvanceTo(8.0)
    later, _ = motion(plant, simulator)
    gone = np.subtract(control_point(later, 0.175), control_point(pose, 0.175))
    np.testing.assert_allclose(gone, [0.4, 0.6], atol=1e-3)


def test_velocity_beyond_top_speed_keeps_its_direction(constants):
    pose, velocity = motion(*settled(f"{constants}:TooFast"))
    v_WP = control_point_velocity(pose[2], velocity, 0.175)
    np.testing.assert_allclose(v_WP, [-0.6 * 0.72, 0.8 * 0.72], atol=1e-3)


@pytest.mark.parametrize(
    ("law", "radius", "omega"),
    # 9 rad/s: P's 1.81 m/s to 0.72 m/s, and its outer wheel's 1.09 m/s to 0.72 m/s.
    [("Twist", 0.75, -0.4), ("Spin", 0.1, 0.72 / (0.1 + 0.205))],
)
def test_twist_drives_a_circle(constants, law, radius, omega):
    plant, simulator = settled(f"{constants}:{law}")
    (x, y, theta), velocity = motion(plant, simulator)
    turn = math.copysign(radius, omega)
    center = np.array([x - turn * math.sin(theta), y + turn * math.cos(theta)])
    assert velocity[2] == pytest.approx(omega, abs=1e-6)
    for time in (7.0, 8.0, 9.0):
        simulator.AdvanceTo(time)
        pose, _ = motion(plant, simulator)
        assert np.linalg.norm(pose[:2] - center) == pytest.approx(radius, abs=1e-6)
        assert pose[2] - theta == pytest.approx(omega * (time - 6.0), abs=1e-6)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ("Nothing", "acceleration_W, velocity_W, twist_B, and has none; add one"),
        (
            "Both",
            "has velocity_W of size 2, twist_B of size 2; leave one of size 2",
        ),
        ("Wide", "has velocity_W of size 3; leave one of size 2"),
        ("OddForces", "has an output port forces_W of size 2; make it 4, or leave"),
    ],
)
def test_controllers_that_command_nothing_or_too_much(constants, law, message):
    with pytest.raises(InputError, match=message) as error:
        make_controller(Scenario(law=f"{constants}:{law}"))
    assert error.value.field == "law"
    assert f":{law}'" in error.value.message


def test_a_block_that_commands_nothing_gets_no_wheels():
    block = LeafSystem()
    block.set_name("idle")
    with pytest.raises(InputError, match="'idle' needs one output port"):
        make_command(block, RobotParameters())


@pytest.mark.parametrize("law", ["none", "active"])
def test_our_laws_command_an_acceleration(law):
    scenario = Scenario(law=law)
    command = make_command(make_controller(scenario), scenario.only.robot)
    assert command.get_name() == "wheel_command"


def test_linear_models_are_refused(constants):
    from analysis.loops.ideal_loop import ideal_loop
    from analysis.loops.ideal_scenarios import ideal_scenario
    from analysis.loops.law_curves import law_curves

    scenario = ideal_scenario(Scenario(law=f"{constants}:Twist"))
    with pytest.raises(InputError, match="no output port acceleration_W"):
        ideal_loop(scenario)
    with pytest.raises(InputError, match=r"is a block without a force f\(c, s\)"):
        law_curves(scenario, [scenario.only.law])
