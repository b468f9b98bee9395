"""A block that changes the velocity of P as little as keeps it off objects."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from pydrake.systems.framework import LeafSystem

from systems.base.robot import RobotParameters, body_radius
from systems.base.wheel_speed_command import (
    hand_position_twist,
    integrate_velocity,
    limited_wheel_speeds,
)
from systems.framework.block_facts import BlockFacts
from systems.framework.finite import read_lists
from systems.framework.signals import TICK_S
from systems.framework.step_block import RunFacts, Step
from systems.planning.parameters import SafetyFilterParameters
from systems.planning.velocity_filter import FilterNumbers, filtered_velocity
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS

#: What moves and has come too near is left within this, s.
_LEAVE_S = 0.1
#: Groups of the discrete state, which are the outputs: wheel speeds, velocity of P, and
#: what was done.
_SIZES = 2, 2, 2


class SafetyNumbers(NamedTuple):
    """What the step of ``SafetyFilter`` depends on."""

    limits: FilterNumbers
    robot: RobotParameters
    tick_s: float


@register_jitable
def safety_filter_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: SafetyNumbers
) -> None:
    """Wheel speeds of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Not used.
        state: Wheel speeds, rad/s, left and right; velocity of P, m/s; slack, m/s, and
            whether the filter acts.
        inputs: As the input ports.
        outputs: Left as they are: they are state.
        numbers: ``SafetyNumbers``.
    """
    acceleration, pose, objects = inputs
    robot, theta = numbers.robot, pose[2]
    before = state[2], state[3]
    wanted = integrate_velocity(
        before, acceleration, numbers.tick_s, robot.top_speed_m_s
    )
    vx, vy, slack = filtered_velocity(
        wanted, before, theta, np.asarray(objects), numbers.limits
    )
    v, omega = hand_position_twist((vx, vy), theta, robot.control_point_m)
    state[0], state[1] = limited_wheel_speeds(v, omega, robot)
    state[2], state[3], state[4] = vx, vy, slack
    changed = abs(vx - wanted[0]) + abs(vy - wanted[1])
    state[5] = 1.0 if changed > 1e-6 else 0.0


def _publish(state: Any, outputs: Any, numbers: SafetyNumbers) -> None:
    """The outputs of ``safety_filter_step``'s state."""
    for port in range(3):
        for k in range(2):
            outputs[port][k] = state[2 * port + k]


class SafetyFilter(LeafSystem):
    """Drives the wheels as a law accelerates P, but for what would lead into objects.

    .. pydrake_system::

        name: SafetyFilter
        input_ports:
        - acceleration_W [m/s^2]
        - pose_WB_estimated [m, m, rad]
        - objects_W [number, m and m/s in eight slots, see systems.ranging.objects]
        output_ports:
        - wheel_speeds [rad/s, left and right]
        - v_WP [m/s, of the virtual mass]
        - filter_report [m/s, 0 or 1]

    It stands in the place of ``WheelSpeedCommand``. The virtual mass moves by what
    comes of the filter, so that it does not wind up. Of all velocities that the wheels
    can do and that lead into nothing, it takes the nearest. Where there is none, what
    moves is let come nearer than it should by as little as can be, but what rests is
    not approached for it; by how much is the first number of ``filter_report``, the
    second says whether it changed anything.

    It knows objects, not space: what no sensor has made an object of, it does not
    know, and it promises less than ``MotionGuard``.

    Discrete state, every tick: the outputs. Rate and latency are those of
    ``WheelSpeedCommand``.

    Args:
        parameters: ``SafetyFilterParameters``.
        robot: Dimensions and top speed.
        tick_s: Period of the command, s.

    Reference: ours; half planes of van den Berg and others (2011). Eq. 6 of
    Engelbrecht, Steyn and Djouani (2021), which only stops the robot, is
    ``TrajectoryImpedanceParameters.block_distance_m``.
    """

    FACTS = BlockFacts(
        "command",
        "control",
        columns={
            "wheel_speeds": ("wheel_speed_left", "wheel_speed_right"),
            "v_WP": ("v_WP_x", "v_WP_y"),
            "filter_report": ("filter_slack", "filter_active"),
        },
    )

    def __init__(
        self,
        *,
        parameters: SafetyFilterParameters | None = None,
        robot: RobotParameters | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        own, robot = parameters or SafetyFilterParameters(), robot or RobotParameters()
        self._tick_s = tick_s
        epsilon = robot.control_point_m
        limits = FilterNumbers(
            body_radius(robot) + epsilon + own.margin_m,
            own.approach_rate,
            own.horizon_s,
            robot.top_speed_m_s,
            robot.wheel_separation_m / (2.0 * epsilon),
            _LEAVE_S,
        )
        numbers = SafetyNumbers(limits, robot, tick_s)
        self.set_name("safety_filter")
        self.step = Step(safety_filter_step, numbers, [0.0] * sum(_SIZES), _publish)
        self._inputs = [
            self.DeclareVectorInputPort(name=name, size=size)
            for name, size in (
                ("acceleration_W", 2),
                ("pose_WB_estimated", 3),
                ("objects_W", OBJECT_SLOTS * OBJECT_SIZE),
            )
        ]
        for name, size in zip(self.FACTS.columns, _SIZES, strict=True):
            self.DeclareStateOutputPort(name, self.DeclareDiscreteState(size))
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=tick_s, offset_sec=0.0, update=self._update
        )

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop."""
        return self.step

    def _update(self, context: Any, discrete_state: Any) -> None:
        inputs, state = read_lists(context, self._inputs), []
        for group in range(len(_SIZES)):
            state += context.get_discrete_state(group).CopyToVector().tolist()
        tick = round(context.get_time() / self._tick_s)
        safety_filter_step(tick, state, inputs, (), self.step.numbers)
        for group in range(len(_SIZES)):
            values = np.array(state[2 * group : 2 * group + 2])
            discrete_state.set_value(group, values)
