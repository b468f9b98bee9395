"""The motor driver: wheel speeds from the duties of the motors."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.base.wheel_speed_command import WHEEL_SPEED_COLUMNS
from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.heading.parameters import MotorDriverParameters


class MotorNumbers(NamedTuple):
    """Constants of the step of ``MotorDriver``."""

    full_speed: float
    """Wheel speed at full duty, rad/s."""


@register_jitable
def motor_driver_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: MotorNumbers
) -> None:
    """Computes the wheel speeds. The state is the left and right wheel speed, rad/s."""
    duty = inputs[0]
    state[0], state[1] = numbers.full_speed * duty[0], numbers.full_speed * duty[1]


@register_jitable
def _publish(state: Any, outputs: Any, numbers: MotorNumbers) -> None:
    """Copies the outputs from the state of ``motor_driver_step``."""
    outputs[0][0], outputs[0][1] = state[0], state[1]


class MotorDriver(Block):
    """Computes the commanded wheel speeds from the duties of the motors.

    The output is the discrete state, which the block updates at every tick (control
    period). A new output is valid after the update. The model of the robot (plant)
    contains the lag of the motors, so this block does not.

    Args:
        parameters: Rim speed of a wheel at full duty.
        robot: Radius and top speed of the wheels. The top speed limits the command.
        tick_s: Control period, s.

    Reference: Song 2011, 2.3.2.
    """

    part = "command"
    inputs = (Port("duty", 2, "1, left and right, -1 to 1"),)
    outputs = (Port("wheel_speeds", 2, "rad/s, left and right", WHEEL_SPEED_COLUMNS),)

    def __init__(
        self,
        *,
        parameters: MotorDriverParameters = MotorDriverParameters(),
        robot: RobotParameters = RobotParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("motor_driver")
        full_speed = parameters.full_speed_m_s / robot.wheel_radius_m
        numbers = MotorNumbers(min(full_speed, robot.top_wheel_speed))
        self.declare(
            Step(motor_driver_step, numbers, [0.0, 0.0], _publish), tick_s=tick_s
        )
