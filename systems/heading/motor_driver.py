"""From duties to wheel speeds."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable
from pydrake.systems.framework import LeafSystem

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.signals import TICK_S
from systems.framework.state_block import StateOutputs
from systems.framework.step_block import Step
from systems.heading.parameters import MotorDriverParameters


class MotorNumbers(NamedTuple):
    """What the step of ``MotorDriver`` depends on."""

    full_speed: float
    """rad/s."""


@register_jitable
def motor_driver_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: MotorNumbers
) -> None:
    """Wheel speeds of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Not used.
        state: Wheel speeds, rad/s, left and right.
        inputs: As the input ports.
        outputs: Left as they are: they are state.
        numbers: ``MotorNumbers``.
    """
    duty = inputs[0]
    state[0], state[1] = numbers.full_speed * duty[0], numbers.full_speed * duty[1]


@register_jitable
def _publish(state: Any, outputs: Any, numbers: MotorNumbers) -> None:
    """The outputs of ``motor_driver_step``'s state."""
    outputs[0][0], outputs[0][1] = state[0], state[1]


class MotorDriver(LeafSystem, StateOutputs):
    """Commands the wheels by the duties of their motors.

    .. pydrake_system::

        name: MotorDriver
        input_ports:
        - duty [1, left and right, -1 to 1]
        output_ports:
        - wheel_speeds [rad/s, left and right]

    Discrete state, every tick: the output, which acts from the update on. The motors'
    lag is the plant's.

    Args:
        parameters: ``MotorDriverParameters``.
        robot: Radius and top speed of the wheels; no duty goes beyond that.
        tick_s: Period of the update, s.

    Reference: Song 2011, 2.3.2.
    """

    FACTS = BlockFacts(
        "command",
        "control",
        columns={"wheel_speeds": ("wheel_speed_left", "wheel_speed_right")},
    )

    def __init__(
        self,
        *,
        parameters: MotorDriverParameters | None = None,
        robot: RobotParameters | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        own, robot = parameters or MotorDriverParameters(), robot or RobotParameters()
        full = min(own.full_speed_m_s / robot.wheel_radius_m, robot.top_wheel_speed)
        self.set_name("motor_driver")
        self.declare_state_outputs(
            Step(motor_driver_step, MotorNumbers(full), [0.0, 0.0], _publish),
            (("duty", 2),),
            (("wheel_speeds", 2),),
            tick_s,
        )
