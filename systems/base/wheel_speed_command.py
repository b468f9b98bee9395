"""From what a law commands to wheel speeds: an acceleration, a velocity or a twist."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from pydrake.systems.framework import LeafSystem_

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.finite import read_lists
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.framework.step_block import Step
from systems.world.geometry import rotate, safe_norm

# Groups of the discrete state; numbers and arrays pass to Drake faster
# than its own indices and lists.
_V_WP, _WHEEL_SPEEDS = range(2)

#: ``turned_off_back`` turns by no more than this.
_ASIDE = math.tan(math.radians(5.0))


@register_jitable
def clamped_velocity(vx: Any, vy: Any, top_speed: Any) -> Any:
    """A velocity in its direction, its magnitude top_speed at most.

    Args:
        vx: m/s; float or AutoDiffXd.
        vy: m/s, in the same axes.
        top_speed: m/s.

    Returns:
        (vx, vy), m/s.
    """
    speed = safe_norm(vx, vy)
    if speed > top_speed:
        vx, vy = vx * (top_speed / speed), vy * (top_speed / speed)
    return vx, vy


@register_jitable
def integrate_velocity(
    v_WP: Any, acceleration_W: Any, period: Any, top_speed: Any
) -> Any:
    """Velocity of the virtual mass after one period, its magnitude clamped.

    The clamp acts on the state: without it v_P would wind up to F_m/D_r,
    2 m/s for each metre to go.

    Args:
        v_WP: (vx, vy), m/s; floats or AutoDiffXd.
        acceleration_W: (ax, ay), m/s^2.
        period: s.
        top_speed: m/s.

    Returns:
        (vx, vy), m/s.
    """
    vx = v_WP[0] + period * acceleration_W[0]
    vy = v_WP[1] + period * acceleration_W[1]
    return clamped_velocity(vx, vy, top_speed)


@register_jitable
def hand_position_twist(v_WP: Any, theta: Any, control_point_m: Any) -> Any:
    """Forward speed and yaw rate that give P the velocity v_WP.

    v = v_P . x_B and omega = v_P . y_B / epsilon: exact, and smooth at
    standstill.

    Args:
        v_WP: (vx, vy), m/s; floats or AutoDiffXd.
        theta: Heading of B in W, rad.
        control_point_m: epsilon, m.

    Returns:
        (v, omega), m/s and rad/s.
    """
    along, across = rotate(-theta, v_WP[0], v_WP[1])
    return along, across / control_point_m


@register_jitable
def hand_position_velocity(twist_B: Any, theta: Any, control_point_m: Any) -> Any:
    """Velocity of P in W that a twist gives it: undoes ``hand_position_twist``.

    Args:
        twist_B: (v, omega), m/s and rad/s; floats or AutoDiffXd.
        theta: Heading of B in W, rad.
        control_point_m: epsilon, m.

    Returns:
        (vx, vy), m/s.
    """
    return rotate(theta, twist_B[0], control_point_m * twist_B[1])


@register_jitable
def turned_off_back(x: Any, y: Any, theta: Any, least: Any) -> Any:
    """A vector along which P is to move, turned aside where it points straight back.

    The heading follows theta' = |v_P| sin(psi - theta)/epsilon, psi the direction of
    v_P: stable where P moves ahead, and an equilibrium, though not a stable one, where
    it moves straight back. There the robot would back for metres, into what it follows,
    until rounding errors have grown. Aim P aside instead, and the body turns round.
    Ours: the papers do not say how an acceleration becomes wheel speeds.

    Args:
        x: Component in W, any unit; float or AutoDiffXd.
        y: See x.
        theta: Heading of B in W, rad.
        least: A shorter vector stays as it is, in that unit.

    Returns:
        (x, y): up to 5 deg off straight back, to the side to which it tends already,
        and to the left if to none. All other vectors stay as they are.
    """
    along, across = rotate(-theta, x, y)
    aside = _ASIDE * (-along - least)
    if abs(across) >= aside:
        return x, y
    return rotate(theta, along, aside if across >= 0.0 else -aside)


@register_jitable
def limited_wheel_speeds(v: Any, omega: Any, robot: RobotParameters) -> Any:
    """Left and right wheel speed, scaled together to the limit.

    Args:
        v: Forward speed, m/s; float or AutoDiffXd.
        omega: Yaw rate, rad/s.
        robot: Its dimensions and top speed.

    Returns:
        (left, right), rad/s. The curvature omega/v is kept.
    """
    half = omega * robot.wheel_separation_m / 2.0
    left = (v - half) / robot.wheel_radius_m
    right = (v + half) / robot.wheel_radius_m
    largest = max(abs(left), abs(right))
    if largest > robot.top_wheel_speed:
        scale = robot.top_wheel_speed / largest
        left, right = left * scale, right * scale
    return left, right


#: Columns of the port ``wheel_speeds`` of every block that commands the wheels.
WHEEL_SPEED_COLUMNS = "wheel_speed_left", "wheel_speed_right"


class CommandNumbers(NamedTuple):
    """What the step of a wheel command depends on."""

    velocity: Callable[..., Any]
    """``velocity(v_WP, command, theta, robot, tick_s)``: the velocity of P from the
    last one, what the port reads, and the heading."""
    robot: RobotParameters
    tick_s: float


def command_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Wheel speeds of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Not used.
        state: Velocity of P, m/s, x and y, and wheel speeds, rad/s, left and right.
        inputs: As the input ports.
        outputs: Left as they are: they are state.
        numbers: ``CommandNumbers``.
    """
    command, pose = inputs
    robot, theta = numbers.robot, pose[2]
    before = state[0], state[1]
    v_WP = numbers.velocity(before, command, theta, robot, numbers.tick_s)
    v, omega = hand_position_twist(v_WP, theta, robot.control_point_m)
    wheels = limited_wheel_speeds(v, omega, robot)
    state[0], state[1], state[2], state[3] = v_WP[0], v_WP[1], wheels[0], wheels[1]


def _publish_command(state, outputs, numbers):
    """The outputs of ``command_step``'s state."""
    wheel_speeds, v_WP = outputs
    wheel_speeds[0], wheel_speeds[1] = state[2], state[3]
    v_WP[0], v_WP[1] = state[0], state[1]


def _accelerated(v_WP, acceleration_W, theta, robot, tick_s):
    return integrate_velocity(v_WP, acceleration_W, tick_s, robot.top_speed_m_s)


def _at_velocity(v_WP, velocity_W, theta, robot, tick_s):
    return clamped_velocity(velocity_W[0], velocity_W[1], robot.top_speed_m_s)


def _at_twist(v_WP, twist_B, theta, robot, tick_s):
    vx, vy = hand_position_velocity(twist_B, theta, robot.control_point_m)
    return clamped_velocity(vx, vy, robot.top_speed_m_s)


#: What a law may command, each of size 2, and the velocity of P that comes of it, as of
#: ``CommandNumbers``.
COMMANDS: Mapping[str, Callable[..., Any]] = {
    "acceleration_W": _accelerated,
    "velocity_W": _at_velocity,
    "twist_B": _at_twist,
}


class _WheelCommand:
    """Ports, state and limits of the command, whatever it is that is commanded.

    A mix-in beside ``LeafSystem_[T]``. A twist is a velocity of P as well, whose axes
    turn with B: one limit of speed serves them all.
    """

    FACTS = BlockFacts(
        "command",
        "control",
        columns={
            "wheel_speeds": WHEEL_SPEED_COLUMNS,
            "v_WP": ("v_WP_x", "v_WP_y"),
        },
        states=("v_WP_x", "v_WP_y", "wheel_left", "wheel_right"),
    )

    def _declare_command(self, name, port, velocity, robot, tick_s):
        self._tick_s = tick_s
        self._robot = robot or RobotParameters()
        numbers = CommandNumbers(velocity, self._robot, tick_s)
        self.step = Step(command_step, numbers, [0.0] * 4, _publish_command)
        self.set_name(name)
        self._inputs = [
            self.DeclareVectorInputPort(name=name, size=size)
            for name, size in ((port, 2), ("pose_WB_estimated", 3))
        ]
        v_WP = self.DeclareDiscreteState(2)
        wheel_speeds = self.DeclareDiscreteState(2)
        self.DeclareStateOutputPort("wheel_speeds", wheel_speeds)
        self.DeclareStateOutputPort("v_WP", v_WP)
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=tick_s, offset_sec=0.0, update=self._update
        )

    def step_for(self, run):
        """What the block does in each tick of a compiled loop, ``Step``."""
        return self.step

    def _update(self, context, discrete_state):
        inputs, state = read_lists(context, self._inputs), []
        for group in (_V_WP, _WHEEL_SPEEDS):
            state += context.get_discrete_state(group).CopyToVector().tolist()
        command_step(0, state, inputs, (), self.step.numbers)
        discrete_state.set_value(_V_WP, np.array(state[:2]))
        discrete_state.set_value(_WHEEL_SPEEDS, np.array(state[2:]))


@define_for_scalars("WheelSpeedCommand_", __name__)
def WheelSpeedCommand_(T):
    class Impl(LeafSystem_[T], _WheelCommand):
        """Integrates the virtual mass at P and commands the wheels.

        .. pydrake_system::

            name: WheelSpeedCommand
            input_ports:
            - acceleration_W [m/s^2]
            - pose_WB_estimated [m, m, rad]
            output_ports:
            - wheel_speeds [rad/s, left and right]
            - v_WP [m/s]

        Discrete state, every tick: the outputs, a group each.
        An update at t uses the acceleration at t and acts from t on: from
        echo to wheels 0 ms, from the end of an audio frame to the wheels
        one tick (the estimator's). Outputs are state; no feedthrough.

        Args:
            robot: Dimensions and top speed.
            tick_s: Period of the command, s.

        Reference: ours; the papers do not say how an acceleration becomes
        wheel speeds.
        """

        def _construct(self, *, robot=None, tick_s=TICK_S, converter=None):
            super().__init__(converter=converter)
            self._declare_command(
                "wheel_speed_command", "acceleration_W", _accelerated, robot, tick_s
            )

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self, robot=other._robot, tick_s=other._tick_s, converter=converter
            )

    return Impl


@define_for_scalars("VelocityWheelCommand_", __name__)
def VelocityWheelCommand_(T):
    class Impl(LeafSystem_[T], _WheelCommand):
        """Commands the wheels so that P moves at the velocity that a law wants.

        .. pydrake_system::

            name: VelocityWheelCommand
            input_ports:
            - velocity_W [m/s, of P]
            - pose_WB_estimated [m, m, rad]
            output_ports:
            - wheel_speeds [rad/s, left and right]
            - v_WP [m/s, the wanted one, limited]

        State, latency and limits are those of ``WheelSpeedCommand``: faster than
        top speed, the velocity keeps its direction; beyond a wheel's limit, the
        path its curvature.

        Args:
            robot: Dimensions and top speed.
            tick_s: Period of the command, s.
        """

        def _construct(self, *, robot=None, tick_s=TICK_S, converter=None):
            super().__init__(converter=converter)
            self._declare_command(
                "velocity_wheel_command", "velocity_W", _at_velocity, robot, tick_s
            )

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self, robot=other._robot, tick_s=other._tick_s, converter=converter
            )

    return Impl


@define_for_scalars("TwistWheelCommand_", __name__)
def TwistWheelCommand_(T):
    class Impl(LeafSystem_[T], _WheelCommand):
        """Commands the wheels so that the body moves with the twist of a law.

        .. pydrake_system::

            name: TwistWheelCommand
            input_ports:
            - twist_B [m/s, rad/s]
            - pose_WB_estimated [m, m, rad]
            output_ports:
            - wheel_speeds [rad/s, left and right]
            - v_WP [m/s, the wanted one, limited]

        State, latency and limits are those of ``WheelSpeedCommand``: either limit
        scales forward speed and yaw rate together, and keeps the curvature.

        Args:
            robot: Dimensions and top speed.
            tick_s: Period of the command, s.
        """

        def _construct(self, *, robot=None, tick_s=TICK_S, converter=None):
            super().__init__(converter=converter)
            self._declare_command(
                "twist_wheel_command", "twist_B", _at_twist, robot, tick_s
            )

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self, robot=other._robot, tick_s=other._tick_s, converter=converter
            )

    return Impl


WheelSpeedCommand = WheelSpeedCommand_[None]
VelocityWheelCommand = VelocityWheelCommand_[None]
TwistWheelCommand = TwistWheelCommand_[None]
