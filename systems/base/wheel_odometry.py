"""Dead reckoning from the wheel encoders."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable
from pydrake.systems.framework import LeafSystem_

from systems.base.diff_drive_plant import body_twist, saturated
from systems.base.lagged_motion import LaggedMotion, advance_pose, lagged_motion
from systems.base.parameters import OdometryParameters, PlantParameters
from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.finite import check_finite
from systems.framework.input_error import InputError
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.framework.step_block import Step, StepBlock


@register_jitable
def encoder_angle(angle: float, pulses_per_revolution: int) -> float:
    """Wheel angle in whole pulses, rad.

    Args:
        angle: Of the wheel since the start, rad, of either sign.
        pulses_per_revolution: Of the encoder.

    Returns:
        The greatest whole number of pulses that is not above the angle, rad.
    """
    pulse = math.tau / pulses_per_revolution
    return math.floor(angle / pulse) * pulse


class OdometryNumbers(NamedTuple):
    """What the step of ``WheelOdometry`` depends on."""

    robot: RobotParameters
    pulses: int
    """A revolution; 0 where angles are not rounded."""
    motion: LaggedMotion
    """Of the wheels in a tick."""
    lost_tick: int = -1
    """At which the pose is lost; -1: never."""


def odometry_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Pose and velocity of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Its number.
        state: Pose, m and rad, and left and right encoder angle, rad, at the last tick.
        inputs: As the input ports.
        outputs: As the output ports.
        numbers: ``OdometryNumbers``.
    """
    left, right = inputs[0][0], inputs[0][1]
    if numbers.pulses > 0:
        left = encoder_angle(left, numbers.pulses)
        right = encoder_angle(right, numbers.pulses)
    robot, motion = numbers.robot, numbers.motion
    then = state[0], state[1], state[2]
    if tick == numbers.lost_tick:
        then = 0.0 * then[0], 0.0 * then[1], 0.0 * then[2]
    turned = left - state[3], right - state[4]
    travelled = body_twist(turned, robot)
    steady = travelled
    # Right after an update nothing of the present command has been driven.
    if turned[0] != 0.0 or turned[1] != 0.0:
        top = robot.top_wheel_speed
        steady_left = motion.duration_s * saturated(inputs[1][0], top)
        steady_right = motion.duration_s * saturated(inputs[1][1], top)
        steady = body_twist((steady_left, steady_right), robot)
    now = advance_pose(then, travelled, steady, motion)
    pose, velocity = outputs
    for k in range(3):
        pose[k] = now[k]
        velocity[k] = (now[k] - then[k]) / motion.duration_s
        state[k] = now[k]
    state[3], state[4] = left, right


@define_for_scalars("WheelOdometry_", __name__)
def WheelOdometry_(T):
    class Impl(LeafSystem_[T], StepBlock):
        """Estimates pose and velocity from the wheels' encoders.

        .. pydrake_system::

            name: WheelOdometry
            input_ports:
            - wheel_angles [rad, left and right]
            - wheel_speeds [rad/s, left and right, commanded]
            output_ports:
            - pose_WB_estimated [m, m, rad]
            - velocity_WB_estimated [m/s, m/s, rad/s]

        Between two ticks it takes the wheels to approach their command with the
        motors' nominal lag: the encoders give the angles of both ends, command and lag
        the motion in between. With rolling wheels of that lag and exact angles the
        pose at a tick is exact. The mean heading over a tick would not do: forward
        speed in phase with the yaw acceleration gives errors that add up.

        Of angles in whole pulses the place is off by (q/L) s + q at most: q is the way
        of the rim for a pulse, L the wheel separation, s the mean way of both rims
        (docs/guard.md has the proof).

        Discrete state, every tick: pose and encoder angles at the last tick. The
        outputs continue it to the present angles: no latency. The velocity
        is the mean over the tick in progress (at a tick: over the last one).
        Slip goes unseen.

        Args:
            robot: Wheel radius and separation.
            odometry: ``OdometryParameters``.
            plant: Lag of the motors.
            initial_pose: (x, y, theta) at time zero, known.
            tick_s: Period of the update, s.

        Raises:
            InputError: Rounding is on in an AutoDiffXd system.
            ValueError: The initial pose is not finite.
        """

        FACTS = BlockFacts(
            "odometry",
            "robot",
            columns={
                "pose_WB_estimated": (
                    "p_WB_estimated_x",
                    "p_WB_estimated_y",
                    "theta_WB_estimated",
                )
            },
            states=("x", "y", "theta", "angle_left", "angle_right"),
        )

        def _construct(
            self,
            *,
            robot=None,
            odometry=None,
            plant=None,
            initial_pose=(0.0, 0.0, 0.0),
            tick_s=TICK_S,
            converter=None,
        ):
            super().__init__(converter=converter)
            self._tick_s = tick_s
            self._robot = robot or RobotParameters()
            self._odometry = odometry or OdometryParameters()
            self._plant = plant or PlantParameters()
            self._initial_pose = tuple(initial_pose)
            check_finite("WheelOdometry: initial_pose", self._initial_pose)
            if self._odometry.rounding and T is not float:
                raise InputError(
                    "WheelOdometry",
                    "odometry.rounding is true, and a rounded angle "
                    "has no derivative; set odometry.rounding to false",
                )
            self.set_name("wheel_odometry")
            pulses = 0
            if self._odometry.rounding:
                pulses = self._odometry.pulses_per_revolution
            lost_s = self._odometry.lost_at_s
            lost_tick = -1 if lost_s is None else round(lost_s / tick_s)
            motion = lagged_motion(tick_s, self._plant.motor_lag_s)
            numbers = OdometryNumbers(self._robot, pulses, motion, lost_tick)
            self.declare_step(
                T,
                Step(odometry_step, numbers, [*self._initial_pose, 0.0, 0.0]),
                (("wheel_angles", 2), ("wheel_speeds", 2)),
                (("pose_WB_estimated", 3), ("velocity_WB_estimated", 3)),
                tick_s,
            )

        def step_for(self, run):
            """What the block does in each tick of a compiled loop, ``Step``."""
            return self.step._replace(state=[*run.initial_pose, 0.0, 0.0])

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self,
                robot=other._robot,
                odometry=other._odometry,
                plant=other._plant,
                initial_pose=other._initial_pose,
                tick_s=other._tick_s,
                converter=converter,
            )

    return Impl


WheelOdometry = WheelOdometry_[None]
