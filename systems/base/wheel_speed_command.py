"""Wheel speeds from the command of a law: an acceleration, a velocity, or a twist."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.robot import RobotParameters
from systems.framework.block import Block_, Port, Step
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.world.geometry import rotate, safe_norm

#: Tangent of the largest angle by which ``turned_off_back`` turns a vector.
_ASIDE = math.tan(math.radians(5.0))


@register_jitable
def clamped_velocity(vx: Any, vy: Any, top_speed: Any) -> Any:
    """Limits the magnitude of a velocity (vx, vy), and keeps its direction.

    The components are floats or AutoDiffXd. All arguments and results are in m/s.
    """
    speed = safe_norm(vx, vy)
    if speed > top_speed:
        vx, vy = vx * (top_speed / speed), vy * (top_speed / speed)
    return vx, vy


@register_jitable
def integrate_velocity(
    v_WP: Any, acceleration_W: Any, period: Any, top_speed: Any
) -> Any:
    """Integrates an acceleration command over one period to a velocity command.

    The function limits the velocity to ``top_speed``. Without this limit, the integral
    would wind up: it would grow until the damping of the control law balances the pull
    of the target. With the default gains, this is a speed of 2 m/s per meter of
    distance to the target.

    Args:
        v_WP: Velocity (vx, vy) of the control point P in the world frame W, m/s; floats
            or AutoDiffXd.
        acceleration_W: Acceleration (ax, ay) in W, m/s^2.
        period: Period, s.
        top_speed: Largest magnitude of the velocity, m/s.

    Returns:
        New velocity (vx, vy) of P in W, m/s.
    """
    vx = v_WP[0] + period * acceleration_W[0]
    vy = v_WP[1] + period * acceleration_W[1]
    return clamped_velocity(vx, vy, top_speed)


@register_jitable
def hand_position_twist(v_WP: Any, theta: Any, control_point_m: Any) -> Any:
    """Computes the twist of the body that gives the control point P a velocity.

    The twist is the forward speed v and the yaw rate omega. P is at the distance
    epsilon ahead of the axle. Let v_P be the velocity of P, and let x_B (ahead) and y_B
    (left) be the axes of the body. The exact result is v = v_P . x_B and omega = v_P .
    y_B / epsilon. It is smooth at standstill.

    Args:
        v_WP: Velocity v_P = (vx, vy) in the world frame W, m/s; floats or AutoDiffXd.
        theta: Heading of the body in W, rad.
        control_point_m: Distance epsilon, m.

    Returns:
        (v, omega), m/s and rad/s.
    """
    along, across = rotate(-theta, v_WP[0], v_WP[1])
    return along, across / control_point_m


@register_jitable
def hand_position_velocity(twist_B: Any, theta: Any, control_point_m: Any) -> Any:
    """Computes the velocity of the control point P from a twist of the body.

    This function is the inverse of ``hand_position_twist``.

    Args:
        twist_B: (v, omega): forward speed and yaw rate of the body, m/s and rad/s;
            floats or AutoDiffXd.
        theta: Heading of the body in the world frame W, rad.
        control_point_m: Distance of P ahead of the axle, m.

    Returns:
        Velocity (vx, vy) of P in W, m/s.
    """
    return rotate(theta, twist_B[0], control_point_m * twist_B[1])


@register_jitable
def turned_off_back(x: Any, y: Any, theta: Any, least: Any) -> Any:
    """Turns a vector aside if the vector points almost straight backward.

    The vector is the wanted velocity v_P of the control point P, or the vector from P
    to the target. P is at the distance epsilon ahead of the axle.

    The heading follows theta' = |v_P| sin(psi - theta)/epsilon, where psi is the
    direction of v_P. A heading opposite to v_P is an unstable equilibrium. There, the
    robot would drive backward for meters, even into its target, until rounding errors
    grow. This function points the vector aside, so that the body turns around. The
    papers do not state how a law drives the wheels, so this method is our own.

    Args:
        x: First component in the world frame W, any unit; float or AutoDiffXd.
        y: Second component in W, in the same unit.
        theta: Heading of the body in W, rad.
        least: Threshold of the backward component, in the unit of x. A vector does not
            change if its backward component is at or below this threshold.

    Returns:
        (x, y) in W. A vector almost straight backward turns to the side to which it
        already points, up to 5 deg from straight backward. A vector exactly backward
        turns to the left. All other vectors do not change.
    """
    along, across = rotate(-theta, x, y)
    aside = _ASIDE * (-along - least)
    if abs(across) >= aside:
        return x, y
    return rotate(theta, along, aside if across >= 0.0 else -aside)


@register_jitable
def limited_wheel_speeds(v: Any, omega: Any, robot: RobotParameters) -> Any:
    """Computes the wheel speeds for a forward speed and a yaw rate.

    If a wheel speed exceeds the limit, the function scales down both wheel speeds by
    the same factor. The curvature omega/v of the path therefore does not change.

    Args:
        v: Forward speed, m/s; float or AutoDiffXd.
        omega: Yaw rate, rad/s.
        robot: Dimensions and top speed.

    Returns:
        (left, right) wheel speed, rad/s.
    """
    half = omega * robot.wheel_separation_m / 2.0
    left = (v - half) / robot.wheel_radius_m
    right = (v + half) / robot.wheel_radius_m
    largest = max(abs(left), abs(right))
    if largest > robot.top_wheel_speed:
        scale = robot.top_wheel_speed / largest
        left, right = left * scale, right * scale
    return left, right


#: Table columns of the port ``wheel_speeds`` of every block that commands the wheels.
WHEEL_SPEED_COLUMNS = "wheel_speed_left", "wheel_speed_right"


class CommandNumbers(NamedTuple):
    """Constants of the step of a wheel command."""

    velocity: Callable[..., Any]
    """Function ``velocity(v_WP, command, theta, robot, tick_s)`` that returns the new
    velocity of the control point P. Its arguments include the last velocity ``v_WP`` of
    P, the command of the control law, and the heading ``theta``."""
    robot: RobotParameters
    tick_s: float


def command_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Computes the state: velocity of P, m/s, and wheel speeds, rad/s."""
    command, pose = inputs
    robot, theta = numbers.robot, pose[2]
    before = state[0], state[1]
    v_WP = numbers.velocity(before, command, theta, robot, numbers.tick_s)
    v, omega = hand_position_twist(v_WP, theta, robot.control_point_m)
    wheels = limited_wheel_speeds(v, omega, robot)
    state[0], state[1], state[2], state[3] = v_WP[0], v_WP[1], wheels[0], wheels[1]


def _publish_command(state, outputs, numbers):
    """Copies the outputs from the state of ``command_step``."""
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


#: Functions ``CommandNumbers.velocity`` by the name of the control law's command port.
#: Each port has size 2.
COMMANDS: Mapping[str, Callable[..., Any]] = {
    "acceleration_W": _accelerated,
    "velocity_W": _at_velocity,
    "twist_B": _at_twist,
}


@define_for_scalars("WheelCommand_", __name__)
def WheelCommand_(T):
    class Impl(Block_[T]):
        """Computes the wheel speeds from the command of a control law.

        The law moves the control point P, which is at a fixed distance ahead of the
        axle. The command has one of three kinds:

        - Acceleration of P: the block integrates the command to a velocity of P.
        - Velocity of P: the command acts at once.
        - Twist (forward speed and yaw rate) of the body: the command acts at once.

        If P would exceed its top speed, the block reduces the speed of P and keeps its
        direction. If a wheel would exceed its top speed, the block scales down both
        wheel speeds. Both reductions keep the curvature of the body's path.

        The discrete state has the velocity of P and the wheel speeds. The wheel speeds
        are the outputs, so there is no feedthrough. The block updates the state every
        control period (tick). An update at the time t uses the inputs at t and acts
        from t on. The latency from an echo to the wheels is 0 ms. The latency from the
        end of an audio frame to the wheels is one tick, because the sound-source
        estimator needs one tick.

        Args:
            command: Name of the law's port: ``acceleration_W``, ``velocity_W`` or
                ``twist_B``.
            robot: Dimensions and top speed.
            tick_s: Control period, s.

        Reference: ours. The papers do not say how an acceleration becomes wheel speeds.
        """

        part = "command"
        inputs = (
            Port("acceleration_W", 2, "m/s^2, or another command of the law"),
            Port("pose_WB_estimated", 3, "m, m, rad"),
        )
        outputs = (
            Port("wheel_speeds", 2, "rad/s, left and right", WHEEL_SPEED_COLUMNS),
            Port("v_WP", 2, "m/s", ("v_WP_x", "v_WP_y")),
        )
        states = "v_WP_x", "v_WP_y", "wheel_left", "wheel_right"

        def _construct(
            self,
            *,
            command: str = "acceleration_W",
            robot: RobotParameters = RobotParameters(),
            tick_s: float = TICK_S,
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            self.set_name("wheel_command")
            self.inputs = (self.inputs[0]._replace(name=command), *self.inputs[1:])
            numbers = CommandNumbers(COMMANDS[command], robot, tick_s)
            self.declare(
                Step(command_step, numbers, [0.0] * 4, _publish_command), tick_s=tick_s
            )

    return Impl


WheelCommand = WheelCommand_[None]
#: Name of the block for laws that command an acceleration of P.
WheelSpeedCommand = WheelCommand
