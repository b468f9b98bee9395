"""Dead reckoning from the wheel encoders."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.base.diff_drive_plant import body_twist, saturated
from systems.base.lagged_motion import LaggedMotion, advance_pose, lagged_motion
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.framework.block import Block_, Port, RunFacts, Step
from systems.framework.faults import Fault, fault_ticks
from systems.framework.finite import check_finite
from systems.framework.input_error import InputError
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S


@register_jitable
def encoder_angle(angle: float, pulses_per_revolution: int) -> float:
    """Rounds a wheel angle, rad, down to whole encoder pulses, even below zero."""
    pulse = math.tau / pulses_per_revolution
    return math.floor(angle / pulse) * pulse


class OdometryNumbers(NamedTuple):
    """Constants of the step of ``WheelOdometry``."""

    robot: RobotParameters
    pulses: int
    """Pulses per revolution; 0: angles are not rounded."""
    motion: LaggedMotion
    """Constants of the motion of the wheels in a tick."""
    lost_tick: int = -1
    """Tick at which the pose restarts at zero; -1: never."""


def odometry_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """Advances the estimated pose to the present wheel angles.

    The state has five numbers: the pose and the two encoder angles at the last control
    period. The step computes the actual path length and turn from the new angles. It
    also computes the path length and turn that the held command would give without
    motor lag. From these values, ``advance_pose`` computes the new pose.
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
    traveled = body_twist(turned, robot)
    steady = traveled
    # If the wheels have not moved since the update, the motion is zero.
    if turned[0] != 0.0 or turned[1] != 0.0:
        top = robot.top_wheel_speed
        steady_left = motion.duration_s * saturated(inputs[1][0], top)
        steady_right = motion.duration_s * saturated(inputs[1][1], top)
        steady = body_twist((steady_left, steady_right), robot)
    now = advance_pose(then, traveled, steady, motion)
    pose, velocity = outputs
    for k in range(3):
        pose[k] = now[k]
        velocity[k] = (now[k] - then[k]) / motion.duration_s
        state[k] = now[k]
    state[3], state[4] = left, right


@define_for_scalars("WheelOdometry_", __name__)
def WheelOdometry_(T):
    class Impl(Block_[T]):
        """Estimates the pose and the velocity from the encoders of the wheels.

        The encoders give the wheel angles at each control period (tick). Between two
        ticks, the block assumes that the wheel speeds approach their commands with the
        nominal motor lag. If this is true and the angles are exact, the pose at each
        tick is exact. A simpler method would move the robot along its mean heading in
        each tick. Its errors would add up if the forward speed varied in phase with the
        yaw acceleration.

        If the angles are rounded to whole pulses, the position error is at most (q/L) s
        + q. Here q is the path of the rim per pulse, L is the wheel separation, and s
        is the mean path of both rims. The proof is in docs/results_guard.md.

        The discrete state has the pose and the encoder angles of the last tick. The
        block updates the state every tick. The outputs advance the pose of the state to
        the present angles, without latency. The output velocity is the mean velocity
        since the last tick. The block does not measure slip.

        Args:
            robot: Wheel radius and separation.
            faults: Faults of the robot. The block uses only the fault of ``odometry``.
            plant: Lag of the motors, and pulses of the encoders.
            initial_pose: Known pose (x, y, theta) in the world frame W at time zero, m
                and rad.
            tick_s: Period of the update, s.

        Raises:
            InputError: The angles are rounded to pulses in an AutoDiffXd system.
            ValueError: The initial pose is not finite.
        """

        part, stage = "odometry", "robot"
        inputs = (
            Port("wheel_angles", 2, "rad, left and right"),
            Port("wheel_speeds", 2, "rad/s, left and right, commanded"),
        )
        outputs = (
            Port(
                "pose_WB_estimated",
                3,
                "m, m, rad",
                ("p_WB_estimated_x", "p_WB_estimated_y", "theta_WB_estimated"),
            ),
            Port("velocity_WB_estimated", 3, "m/s, m/s, rad/s"),
        )
        states = "x", "y", "theta", "angle_left", "angle_right"

        def _construct(
            self,
            *,
            robot: RobotParameters = RobotParameters(),
            faults: Sequence[Fault] = (),
            plant: PlantParameters = PlantParameters(),
            initial_pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
            tick_s: float = TICK_S,
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            check_finite("WheelOdometry: initial_pose", initial_pose)
            pulses = plant.pulses_per_revolution
            if pulses is not None and T is not float:
                raise InputError(
                    "WheelOdometry",
                    f"plant.pulses_per_revolution is {pulses}, and an angle that is "
                    "rounded to pulses has no derivative; set it to null",
                )
            self.set_name("wheel_odometry")
            ((kind, begin),) = fault_ticks(faults, "odometry", 1, tick_s).tolist()
            numbers = OdometryNumbers(
                robot,
                pulses or 0,
                lagged_motion(tick_s, plant.motor_lag_s),
                begin if kind else -1,
            )
            self.declare(
                Step(odometry_step, numbers, [*initial_pose, 0.0, 0.0]), tick_s=tick_s
            )

        def step_for(self, run: RunFacts) -> Step:
            """Returns the step with the initial pose of the run."""
            return self.step._replace(state=[*run.initial_pose, 0.0, 0.0])

    return Impl


WheelOdometry = WheelOdometry_[None]
