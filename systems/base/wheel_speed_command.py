"""From what a law commands to wheel speeds: an acceleration, a velocity or a twist."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import LeafSystem_

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.finite import read_lists
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.world.geometry import rotate, safe_norm

__all__ = [
    "TwistWheelCommand",
    "TwistWheelCommand_",
    "VelocityWheelCommand",
    "VelocityWheelCommand_",
    "WheelSpeedCommand",
    "WheelSpeedCommand_",
    "clamped_velocity",
    "hand_position_twist",
    "hand_position_velocity",
    "integrate_velocity",
    "limited_wheel_speeds",
]

# Groups of the discrete state; numbers and arrays pass to Drake faster
# than its own indices and lists.
_V_WP, _WHEEL_SPEEDS = range(2)


def clamped_velocity(vx, vy, top_speed):
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


def integrate_velocity(v_WP, acceleration_W, period, top_speed):
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


def hand_position_twist(v_WP, theta, control_point_m):
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


def hand_position_velocity(twist_B, theta, control_point_m):
    """Velocity of P in W that a twist gives it: undoes ``hand_position_twist``.

    Args:
        twist_B: (v, omega), m/s and rad/s; floats or AutoDiffXd.
        theta: Heading of B in W, rad.
        control_point_m: epsilon, m.

    Returns:
        (vx, vy), m/s.
    """
    return rotate(theta, twist_B[0], control_point_m * twist_B[1])


def limited_wheel_speeds(v, omega, robot: RobotParameters):
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
    largest = abs(left)
    largest = max(largest, abs(right))
    if largest > robot.top_wheel_speed:
        scale = robot.top_wheel_speed / largest
        left, right = left * scale, right * scale
    return left, right


class _WheelCommand:
    """Ports, state and limits of the command, whatever it is that is commanded.

    A mix-in beside ``LeafSystem_[T]``: a block adds ``_velocity(v_WP, command,
    theta)``, the velocity of P from the last one, what its port reads, and the
    heading. A twist is a velocity of P as well, whose axes turn with B: one limit
    of speed serves them all.
    """

    FACTS = BlockFacts(
        "command",
        "control",
        columns={
            "wheel_speeds": ("wheel_speed_left", "wheel_speed_right"),
            "v_WP": ("v_WP_x", "v_WP_y"),
        },
        states=("v_WP_x", "v_WP_y", "wheel_left", "wheel_right"),
    )

    def _declare_command(self, name, port, robot, tick_s):
        self._tick_s = tick_s
        self._robot = robot or RobotParameters()
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

    def _update(self, context, discrete_state):
        robot = self._robot
        command, (_, _, theta) = read_lists(context, self._inputs)
        before = context.get_discrete_state(_V_WP).CopyToVector().tolist()
        v_WP = self._velocity(before, command, theta)
        twist = hand_position_twist(v_WP, theta, robot.control_point_m)
        wheels = limited_wheel_speeds(*twist, robot)
        discrete_state.set_value(_V_WP, np.array(v_WP))
        discrete_state.set_value(_WHEEL_SPEEDS, np.array(wheels))


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
                "wheel_speed_command", "acceleration_W", robot, tick_s
            )

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self, robot=other._robot, tick_s=other._tick_s, converter=converter
            )

        def _velocity(self, v_WP, acceleration_W, theta):
            top_speed = self._robot.top_speed_m_s
            return integrate_velocity(v_WP, acceleration_W, self._tick_s, top_speed)

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
            self._declare_command("velocity_wheel_command", "velocity_W", robot, tick_s)

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self, robot=other._robot, tick_s=other._tick_s, converter=converter
            )

        def _velocity(self, v_WP, velocity_W, theta):
            return clamped_velocity(*velocity_W, self._robot.top_speed_m_s)

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
            self._declare_command("twist_wheel_command", "twist_B", robot, tick_s)

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self, robot=other._robot, tick_s=other._tick_s, converter=converter
            )

        def _velocity(self, v_WP, twist_B, theta):
            epsilon = self._robot.control_point_m
            velocity_W = hand_position_velocity(twist_B, theta, epsilon)
            return clamped_velocity(*velocity_W, self._robot.top_speed_m_s)

    return Impl


WheelSpeedCommand = WheelSpeedCommand_[None]
VelocityWheelCommand = VelocityWheelCommand_[None]
TwistWheelCommand = TwistWheelCommand_[None]
