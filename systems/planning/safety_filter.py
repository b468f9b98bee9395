"""A block that changes the velocity of P as little as possible to avoid objects.

P is the control point of the robot, ahead of the axle.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike, NDArray

from systems.base.robot import RobotParameters, body_radius
from systems.base.wheel_speed_command import (
    WHEEL_SPEED_COLUMNS,
    hand_position_twist,
    integrate_velocity,
    limited_wheel_speeds,
)
from systems.framework.block import Block, Port, RunFacts, Step
from systems.framework.signals import TICK_S
from systems.planning.outline_planes import BodyOutline, outline_planes
from systems.planning.velocity_filter import (
    FilterNumbers,
    filtered_velocity,
    without_known,
)
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS
from systems.world.geometry import control_point

#: Distance between objects and the disc around the axle that contains the body, m (our
#: choice). The lag of the motors uses up to 1 cm of this distance.
_MARGIN_M = 0.05
#: The route is narrow if its clearance exceeds the distance that P keeps from objects
#: by less than this, m (our choice).
_NARROW_M = 0.05


class SafetyNumbers(NamedTuple):
    """Constants of the step of ``SafetyFilter``."""

    limits: FilterNumbers
    outline: BodyOutline
    known: NDArray[np.float64]
    """(k, 6) rectangles of known obstacles in W."""
    robot: RobotParameters
    tick_s: float


def turning_distance_m(robot: RobotParameters) -> float:
    """Returns the distance of P from objects at which the body can turn freely, m."""
    return body_radius(robot) + robot.control_point_m + _MARGIN_M


@register_jitable
def safety_filter_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: SafetyNumbers
) -> None:
    """Computes the wheel speeds, the velocity of P, the slack, and the action.

    P is the control point of the robot. The slack is the speed by which the velocity
    violates constraints, m/s. The action is 1 if the filter has changed the velocity,
    otherwise 0. The results are the state of the block, and apply to the next control
    period.
    """
    acceleration, pose, objects, route_clearance = inputs
    robot, theta = numbers.robot, pose[2]
    before = state[2], state[3]
    wanted = integrate_velocity(
        before, acceleration, numbers.tick_s, robot.top_speed_m_s
    )
    objects = np.asarray(objects)
    planes = np.empty((0, 3))
    if route_clearance[0] < numbers.limits.keep_m + _NARROW_M:
        p_WP = control_point((pose[0], pose[1], theta), robot.control_point_m)
        objects = without_known(objects, p_WP, numbers.known)
        here = pose[0], pose[1], theta
        planes = outline_planes(here, numbers.known, numbers.outline)
    vx, vy, slack = filtered_velocity(
        wanted, before, theta, objects, planes, numbers.limits
    )
    v, omega = hand_position_twist((vx, vy), theta, robot.control_point_m)
    state[0], state[1] = limited_wheel_speeds(v, omega, robot)
    state[2], state[3], state[4] = vx, vy, slack
    changed = abs(vx - wanted[0]) + abs(vy - wanted[1])
    state[5] = 1.0 if changed > 1e-6 else 0.0


def _publish(state: Any, outputs: Any, numbers: SafetyNumbers) -> None:
    """Copies the state of ``safety_filter_step`` to the outputs."""
    for port in range(3):
        for k in range(2):
            outputs[port][k] = state[2 * port + k]


class SafetyFilter(Block):
    """Moves the control point P as a law commands, but keeps P away from objects.

    From all velocities that the wheels can produce and that lead into no object, the
    filter chooses the velocity nearest to the commanded velocity. If there is no such
    velocity, the filter violates the constraints of moving objects as little as
    possible. It never violates the limits on the approach to objects at rest.

    The block replaces ``WheelCommand``. The virtual mass moves with the velocity that
    the filter returns, which prevents windup.

    Usually P keeps from objects at rest the distance at which the body can turn freely.
    Where the clearance of the route is hardly more or even less, the outline of the
    body keeps 2 cm from known obstacles instead. The planner takes such routes only
    through passages that are wide enough for the body.

    The port ``filter_report`` has two numbers. The first is the slack: the speed by
    which the velocity violates constraints, m/s. The second is 1 if the filter has
    changed the velocity, and 0 otherwise.

    The filter knows the objects that sensors have detected, but it does not know where
    space is free. Therefore it guarantees less than ``MotionGuard``.

    The outputs are the discrete state. The latency is that of ``WheelCommand``.

    Args:
        robot: Dimensions and top speed.
        known: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in the world frame W, m and rad.
        tick_s: Control period, s.

    Reference: our own work; half planes of van den Berg and others (2011). Eq. 6 of
    Engelbrecht, Steyn and Djouani (2021) only stops the robot (see
    ``TrajectoryImpedanceParameters.block_distance_m``).
    """

    part = "command"
    inputs = (
        Port("acceleration_W", 2, "m/s^2"),
        Port("pose_WB_estimated", 3, "m, m, rad"),
        Port(
            "objects_W",
            OBJECT_SLOTS * OBJECT_SIZE,
            "number, m and m/s in eight slots, see systems.ranging.objects",
        ),
        Port("route_clearance", 1, "m"),
    )
    outputs = (
        Port("wheel_speeds", 2, "rad/s, left and right", WHEEL_SPEED_COLUMNS),
        Port("v_WP", 2, "m/s, of the virtual mass", ("v_WP_x", "v_WP_y")),
        Port("filter_report", 2, "m/s, 0 or 1", ("filter_slack", "filter_active")),
    )

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(),
        known: ArrayLike = (),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("safety_filter")
        epsilon = robot.control_point_m
        limits = FilterNumbers(
            turning_distance_m(robot),
            robot.top_speed_m_s,
            robot.wheel_separation_m / (2.0 * epsilon),
        )
        outline = BodyOutline(robot.length_m, robot.width_m, epsilon)
        rectangles: NDArray[np.float64] = np.array(known, dtype=float).reshape(-1, 6)
        numbers = SafetyNumbers(limits, outline, rectangles, robot, tick_s)
        step = Step(safety_filter_step, numbers, [0.0] * 6, _publish)
        self._step = step
        self.declare(step, tick_s=tick_s)

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step with the map of the run."""
        known: NDArray[np.float64] = np.array(run.mapped, dtype=float).reshape(-1, 6)
        return self._step._replace(numbers=self._step.numbers._replace(known=known))
