"""From the law's acceleration of P to wheel speeds."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import LeafSystem_

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.finite import read_lists
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import FRAME_PERIOD_S
from systems.world.geometry import rotate, safe_norm

__all__ = [
    "WheelSpeedCommand",
    "WheelSpeedCommand_",
    "hand_position_twist",
    "integrate_velocity",
    "limited_wheel_speeds",
]

# Groups of the discrete state; numbers and arrays pass to Drake faster
# than its own indices and lists.
_V_WP, _WHEEL_SPEEDS = range(2)


def integrate_velocity(v_WP, acceleration_W, period, top_speed):
    """Velocity of the virtual mass after one period, its magnitude clamped.

    The clamp acts on the state: without it v_P would wind up to F_m/D_r,
    2 m/s for each metre to go.

    Args:
        v_WP: (vx, vy), m/s; floats or AutoDiffXd.
        acceleration_W: (ax, ay), m/s^2.
        period: s.
        top_speed: m/s.
    """
    vx = v_WP[0] + period * acceleration_W[0]
    vy = v_WP[1] + period * acceleration_W[1]
    speed = safe_norm(vx, vy)
    if speed > top_speed:
        vx, vy = vx * (top_speed / speed), vy * (top_speed / speed)
    return vx, vy


def hand_position_twist(v_WP, theta, control_point_m):
    """Forward speed and yaw rate that give P the velocity v_WP.

    v = v_P . x_B and omega = v_P . y_B / epsilon: exact, and smooth at
    standstill.
    """
    along, across = rotate(-theta, v_WP[0], v_WP[1])
    return along, across / control_point_m


def limited_wheel_speeds(v, omega, robot: RobotParameters):
    """Left and right wheel speed, rad/s, scaled together to the limit."""
    half = omega * robot.wheel_separation_m / 2.0
    left = (v - half) / robot.wheel_radius_m
    right = (v + half) / robot.wheel_radius_m
    largest = abs(left)
    largest = max(largest, abs(right))
    if largest > robot.top_wheel_speed:
        scale = robot.top_wheel_speed / largest
        left, right = left * scale, right * scale
    return left, right


@define_for_scalars("WheelSpeedCommand_", __name__)
def WheelSpeedCommand_(T):
    class Impl(LeafSystem_[T]):
        """Integrates the virtual mass at P and commands the wheels.

        .. pydrake_system::

            name: WheelSpeedCommand
            input_ports:
            - acceleration_W [m/s^2]
            - pose_WB_estimated [m, m, rad]
            output_ports:
            - wheel_speeds [rad/s, left and right]
            - v_WP [m/s]

        Discrete state, 25 ms: the outputs, a group each.
        An update at t uses the acceleration at t and acts from t on: from
        echo to wheels 0 ms, from the end of an audio frame to the wheels
        25 ms (the estimator's tick). Outputs are state; no feedthrough.

        Args:
            robot: Dimensions and top speed.

        Reference: ours; the papers do not say how an acceleration becomes
        wheel speeds.
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

        def _construct(self, *, robot=None, converter=None):
            super().__init__(converter=converter)
            self._robot = robot or RobotParameters()
            self.set_name("wheel_speed_command")
            self._inputs = [
                self.DeclareVectorInputPort(name=name, size=size)
                for name, size in (("acceleration_W", 2), ("pose_WB_estimated", 3))
            ]
            v_WP = self.DeclareDiscreteState(2)
            wheel_speeds = self.DeclareDiscreteState(2)
            self.DeclareStateOutputPort("wheel_speeds", wheel_speeds)
            self.DeclareStateOutputPort("v_WP", v_WP)
            self.DeclarePeriodicDiscreteUpdateEvent(
                period_sec=FRAME_PERIOD_S, offset_sec=0.0, update=self._update
            )

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, robot=other._robot, converter=converter)

        def _update(self, context, discrete_state):
            robot = self._robot
            acceleration_W, (_, _, theta) = read_lists(context, self._inputs)
            v_WP = integrate_velocity(
                context.get_discrete_state(_V_WP).CopyToVector().tolist(),
                acceleration_W,
                FRAME_PERIOD_S,
                robot.top_speed_m_s,
            )
            twist = hand_position_twist(v_WP, theta, robot.control_point_m)
            wheels = limited_wheel_speeds(*twist, robot)
            discrete_state.set_value(_V_WP, np.array(v_WP))
            discrete_state.set_value(_WHEEL_SPEEDS, np.array(wheels))

    return Impl


WheelSpeedCommand = WheelSpeedCommand_[None]
