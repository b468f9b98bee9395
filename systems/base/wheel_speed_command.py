"""From what a law commands to wheel speeds: an acceleration, a velocity or a twist."""

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
    last one, the command of the law, and the heading."""
    robot: RobotParameters
    tick_s: float


def command_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Velocity of P, m/s, and wheel speeds, rad/s, of the next tick: the state."""
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


#: Output ports by which a law commands, each of size 2, and for each port how the
#: velocity of P follows, as ``CommandNumbers.velocity``.
COMMANDS: Mapping[str, Callable[..., Any]] = {
    "acceleration_W": _accelerated,
    "velocity_W": _at_velocity,
    "twist_B": _at_twist,
}


@define_for_scalars("WheelCommand_", __name__)
def WheelCommand_(T):
    class Impl(Block_[T]):
        """Commands the wheels so that P moves as a law commands.

        An acceleration is integrated: it moves the virtual mass at P. A velocity of P
        and a twist of the body are obeyed at once. Beyond top speed the velocity of P
        keeps its direction, which for a twist is the curvature of the path; beyond a
        wheel's limit the path keeps its curvature.

        Discrete state, every tick: velocity of P and wheel speeds, the outputs. An
        update at t uses the inputs at t and acts from t on: from echo to wheels 0 ms,
        from the end of an audio frame to the wheels one tick (the estimator's). No
        feedthrough.

        Args:
            command: Name of the law's port: ``acceleration_W``, ``velocity_W`` or
                ``twist_B``.
            robot: Dimensions and top speed.
            tick_s: Period of the command, s.

        Reference: ours; the papers do not say how an acceleration becomes
        wheel speeds.
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
#: The command of a law that accelerates P.
WheelSpeedCommand = WheelCommand
