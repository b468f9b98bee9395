"""A block between a law and the wheels that keeps the robot in free space."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from systems.base.lagged_motion import lagged_motion
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.base.wheel_speed_command import (
    COMMANDS,
    WHEEL_SPEED_COLUMNS,
    hand_position_twist,
    hand_position_velocity,
    limited_wheel_speeds,
)
from systems.framework.block import OBJECT, Block, Port, Step
from systems.framework.signals import TICK_S
from systems.safety.braking import (
    HALTED,
    PASSED,
    chosen,
)
from systems.safety.danger import danger_of
from systems.safety.outline import Outline
from systems.safety.parameters import LEAST_MARGIN_M, MARGIN_M, GuardParameters
from systems.safety.predicted_motion import BrakingNumbers, rolled_speeds
from systems.safety.views import checked_reach, stopping_way, tick_parts

#: Sizes of the four parts of the state: velocity of P, wheel speeds, report, and
#: modeled wheel speeds.
_SIZES = 2, 2, 4, 2


class GuardNumbers(NamedTuple):
    """Constants of the step of ``MotionGuard``."""

    velocity: Callable[..., Any]
    """Function that turns a command into a velocity of P, as in ``CommandNumbers``."""
    robot: RobotParameters
    braking: BrakingNumbers
    kept: float
    """Share of the difference between actual and commanded wheel speed that remains
    after one control period, 0 to 1.
    """
    reach: tuple[float, float]
    """Two distances, m. The guard checks cells within the first distance of the axle.
    Free cells must still count as free after the wheels have rolled the second
    distance.
    """


def guard_step(tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any) -> None:
    """Computes the wheel speeds of one control period.

    ``systems.framework.block.Step`` explains the arguments of all steps.

    Args:
        tick: Number of the control period.
        state: Ten numbers: velocity (x, y) of the control point P, m/s; commanded
            speeds of the left and right wheel, rad/s; report, four numbers; and modeled
            speeds of the left and right wheel, rad/s.
        inputs: Command of the law, pose by the odometry, fault of the sensing, and map
            of free space.
        outputs: Not used, because the outputs are part of the state.
        numbers: ``GuardNumbers``.
    """
    command, pose, fault, space = inputs
    robot, braking = numbers.robot, numbers.braking
    theta, tick_s = pose[2], braking.tick_s
    before = state[0], state[1]
    # Wheel speeds that the law wants. With a fault of the sensing, both are zero.
    v_WP = numbers.velocity(before, command, theta, robot, tick_s)
    v, omega = hand_position_twist(v_WP, theta, robot.control_point_m)
    trusted = fault[0] < 0.5
    wish = limited_wheel_speeds(v, omega, robot) if trusted else (0.0, 0.0)
    here = pose[0], pose[1], pose[2]
    speeds = state[8], state[9]
    # The part of these wheel speeds from which the robot can brake to rest.
    danger = danger_of(space, tick * tick_s, here, numbers.reach, braking)
    done, wheels = chosen(here, speeds, wish, (state[2], state[3]), danger, braking)
    if not trusted:
        done = HALTED
    if done != PASSED:
        # The virtual mass moves with the changed command.
        radius, separation = robot.wheel_radius_m, robot.wheel_separation_m
        v = 0.5 * radius * (wheels[0] + wheels[1])
        omega = radius * (wheels[1] - wheels[0]) / separation
        v_WP = hand_position_velocity((v, omega), theta, robot.control_point_m)
    after = rolled_speeds(speeds, wheels, numbers.kept)
    fastest = max(abs(wheels[0]), abs(wheels[1])) * robot.wheel_radius_m
    state[0], state[1], state[2], state[3] = v_WP[0], v_WP[1], wheels[0], wheels[1]
    # Without cells nearby, report the distance within which cells were checked.
    checked = numbers.reach[0] - braking.outline.radius_m
    seen = min(danger.distance_m, checked)
    viewed = min(danger.view_distance_m - braking.outline.radius_m, checked)
    state[4], state[5] = done, seen - braking.keep_m
    # Stopping distance: the braking distance, and the distance covered during the motor
    # lag and one tick.
    state[6] = fastest * fastest / (2.0 * braking.braking_m_s2)
    state[6] += fastest * (braking.motor_lag_s + tick_s)
    state[7] = viewed - braking.keep_m
    state[8], state[9] = after[0], after[1]


def _publish_guard(state, outputs, numbers):  # type: ignore[no-untyped-def]
    """Copies the state of ``guard_step`` to the outputs."""
    wheel_speeds, v_WP, report = outputs
    for k in range(2):
        v_WP[k], wheel_speeds[k] = state[k], state[2 + k]
    for k in range(4):
        report[k] = state[4 + k]


class MotionGuard(Block):
    """Passes the commands of a law as far as the robot can brake to rest in free space.

    The block replaces ``WheelCommand``: it converts the command of the law to wheel
    speeds. It passes these speeds for one control period if the robot could then brake
    to rest in free space. For this check, the block uses the lane of the body
    (``systems.safety.outline``), or the outline alone while the robot turns on the
    spot. All cells that are not known to be free must stay ``MARGIN_M`` and the
    position error away.

    Otherwise, the block passes lower speeds along the same curve. If these do not help,
    it passes the turn alone or the forward motion alone, or it brakes. The virtual mass
    moves with the command that the block passes.

    If ``obstacle_speed_m_s`` is above zero, the block assumes that obstacles in the
    sensors' view approach at this speed. The smallest disc around the axle that
    contains the body then has to stay as far away from all points that these obstacles
    may reach. This second condition does not apply while the robot withdraws from the
    obstacles.

    If the sensing has a fault, the block brakes the robot to rest, whatever the law
    commands.

    The port ``guard_report`` has four numbers:

    - the action: 0 passed, 1 slowed, 2 turned, 3 braked, 4 halted because of a fault
    - the distance of the lane from non-free space, minus the distance that the lane has
      to keep, m
    - the stopping distance, m
    - the distance of the disc from the end of the sensors' view, minus the distance
      that the disc has to keep, m

    The discrete state contains the velocity of the control point P, the commanded wheel
    speeds, the report, and the modeled wheel speeds. The modeled wheel speeds follow
    the commanded wheel speeds with the lag of the motors. The latency is that of
    ``WheelCommand``.

    Args:
        parameters: ``GuardParameters``.
        robot: Dimensions and top speed.
        plant: Lag of the motors.
        command: Name of the law's port: ``acceleration_W``, ``velocity_W`` or
            ``twist_B``.
        tick_s: Control period, s.

    Reference: our own work; docs/guard.md has theorem and proof. Passive safety:
    Bouraine, Fraichard and Salhi (2012). Passive orientation safety: Mitsch, Ghorbal,
    Vogelbacher and Platzer (2017).
    """

    part = "command"
    inputs = (
        Port("acceleration_W", 2, "m/s^2, or another command of the law"),
        Port("pose_WB_estimated", 3, "m, m, rad"),
        Port("sensing_fault", 2, "number of the fault, and of the sensor, from 1"),
        Port("free_space", OBJECT, "FreeSpace"),
    )
    outputs = (
        Port("wheel_speeds", 2, "rad/s, left and right", WHEEL_SPEED_COLUMNS),
        Port("v_WP", 2, "m/s, of the virtual mass", ("v_WP_x", "v_WP_y")),
        Port(
            "guard_report",
            4,
            "number of the action, m, m, m",
            (
                "guard_action",
                "guard_distance",
                "guard_stopping_distance",
                "guard_view_distance",
            ),
        ),
    )

    def __init__(
        self,
        *,
        parameters: GuardParameters = GuardParameters(),
        robot: RobotParameters = RobotParameters(),
        plant: PlantParameters = PlantParameters(),
        command: str = "acceleration_W",
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("motion_guard")
        self.inputs = (self.inputs[0]._replace(name=command), *self.inputs[1:])
        numbers = _numbers(parameters, robot, plant, COMMANDS[command], tick_s)
        self.declare(
            Step(guard_step, numbers, [0.0] * sum(_SIZES), _publish_guard),
            tick_s=tick_s,
        )


def _numbers(
    own: GuardParameters,
    robot: RobotParameters,
    plant: PlantParameters,
    velocity: Callable[..., Any],
    tick_s: float,
) -> GuardNumbers:
    outline, keep = Outline.of(robot), own.place_error_m + MARGIN_M
    parts = tick_parts(tick_s)
    braking = BrakingNumbers(
        robot.wheel_radius_m,
        robot.wheel_separation_m,
        plant.motor_lag_s,
        own.braking_m_s2,
        tick_s,
        parts,
        lagged_motion(tick_s / parts, plant.motor_lag_s),
        robot.top_wheel_speed,
        outline,
        keep,
        own.place_error_m + LEAST_MARGIN_M,
        own.obstacle_speed_m_s or 0.0,
    )
    stopping = stopping_way(own, robot, plant, tick_s)
    reach = checked_reach(own, robot, plant, tick_s), stopping
    kept = math.exp(-tick_s / plant.motor_lag_s)
    return GuardNumbers(velocity, robot, braking, kept, reach)
