"""Baseline: optimal reciprocal collision avoidance (ORCA) with perfect knowledge."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from systems.base.robot import RobotParameters, body_radius
from systems.base.wheel_speed_command import turned_off_back
from systems.framework.block import Port, Step
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.laws.baselines.baseline_controller import BaselineController
from systems.laws.parameters import AttractionParameters
from systems.laws.reciprocal_avoidance import ReciprocalAvoidanceParameters
from systems.planning.following import CRUISE_SPEED_M_S, FollowNumbers, approach
from systems.planning.half_planes import nearest_velocity
from systems.planning.turning import TURN_RATE_RAD_S, turn_toward, wrapped

# ``_CLEARANCE_M``: distance that the robot keeps from all bodies, m.
# ``_FARTHEST_M``: distance beyond which bodies do not count, m.
_CLEARANCE_M, _FARTHEST_M = 0.02, 5.0
#: Time within which the robot must leave a contact, s.
_OUT_S = 0.1
# ``_RESTS_M_S``: speed below which the robot is at rest, m/s.
# ``_UNCHANGED_M_S``: difference below which two velocities are equal, m/s.
_RESTS_M_S, _UNCHANGED_M_S = 0.05, 1e-6


class AvoidanceNumbers(NamedTuple):
    """Constants of the step of ``ReciprocalAvoidanceController``."""

    own: ReciprocalAvoidanceParameters
    follow: FollowNumbers
    radius_m: float
    """Radius of the disc around the point ``offset_m`` ahead of the axle, m. The disc
    covers the body and the clearance.
    """
    tick_s: float


@njit(cache=True)
def _beyond(
    u: float, w: float, a: float, b: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Returns the vector to (u, w) from the nearest point of a centered rectangle."""
    return u - min(max(u, -a), a), w - min(max(w, -b), b)


@njit(cache=True)
def avoid_body(
    relative: Any, half: Any, radius: float, velocity: Any, horizon: float
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Computes the half plane of velocities that ORCA permits near one body.

    ORCA is optimal reciprocal collision avoidance (van den Berg, eq. 3). The robot is a
    disc, and the other body is a rectangle. Some relative velocities make the disc
    touch the rectangle within the horizon. These velocities form the velocity obstacle:
    a cone with two straight legs and a rounded end instead of a tip. The rounded end,
    called the cut-off, is the rectangle, enlarged by the radius of the disc and divided
    by the horizon.

    The function finds the point on the border of the velocity obstacle that is nearest
    to the present relative velocity. The tangent at this point bounds the half plane.

    Args:
        relative: Position (x, y) of the body relative to the center of the disc, m, and
            heading theta of the body, rad.
        half: Half of the body's length and half of its width, m.
        radius: Radius of the disc, m.
        velocity: Velocity of the disc relative to the body, m/s.
        horizon: Time in which no contact may occur, s.

    Returns:
        Unit normal n (x and y) and an offset, m/s. A relative velocity v is permitted
        if n . v >= offset.
    """
    # In the axes of the rectangle. Its center is at (px, py), the disc at (0, 0).
    c, s = math.cos(relative[2]), math.sin(relative[2])
    px = c * relative[0] + s * relative[1]
    py = c * relative[1] - s * relative[0]
    vx, vy = c * velocity[0] + s * velocity[1], c * velocity[1] - s * velocity[0]
    a, b = half[0], half[1]
    gx, gy = _beyond(-px, -py, a, b)
    gap = math.hypot(gx, gy)
    inside = gap <= radius
    time = _OUT_S if inside else horizon
    # Find the point of the rim of the cut-off that is nearest to the velocity.
    fx, fy = _beyond(vx * time - px, vy * time - py, a, b)
    far = math.hypot(fx, fy)
    if far > 1e-9:
        nx, ny = fx / far, fy / far
        signed = (far - radius) / time
    else:
        # The center of the disc would be in the rectangle. Leave by the nearest side.
        dx, dy = vx * time - px, vy * time - py
        left_x, left_y = a - abs(dx), b - abs(dy)
        nx, ny = 0.0, math.copysign(1.0, dy)
        if left_x < left_y:
            nx, ny = math.copysign(1.0, dx), 0.0
        signed = -(min(left_x, left_y) + radius) / time
    best = signed, nx, ny
    if not inside:
        best = _legs((px, py), half, radius, (vx, vy), horizon, best)
    signed, nx, ny = best
    offset = nx * vx + ny * vy - signed
    return c * nx - s * ny, s * nx + c * ny, offset


@njit(cache=True)
def _legs(
    place: tuple[float, float],
    half: Any,
    radius: float,
    velocity: tuple[float, float],
    horizon: float,
    front: tuple[float, float, float],
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Finds the part of a velocity obstacle's border that is nearest to a velocity.

    The border consists of the rounded end (``front``) and two legs, which start where
    they touch the rounded end (see ``avoid_body``).

    Returns:
        Signed distance of the velocity from the border, m/s, negative inside the
        velocity obstacle, and x and y of the unit normal.
    """
    (px, py), (vx, vy) = place, velocity
    middle = math.atan2(py, px)
    best, found = np.inf, front
    on_leg = False
    for side in (1.0, -1.0):
        # The leg is the tangent to the disc around the outermost corner on this side.
        widest, tangent = -np.inf, 0.0
        for k in range(4):
            cx = px + (half[0] if k % 2 else -half[0])
            cy = py + (half[1] if k > 1 else -half[1])
            far = math.hypot(cx, cy)
            off = math.atan2(cy, cx) - middle
            angle = side * wrapped(off) + math.asin(min(radius / far, 1.0))
            if angle > widest:
                widest = angle
                tangent = math.sqrt(max(far * far - radius * radius, 0.0))
        direction = middle + side * widest
        dx, dy = math.cos(direction), math.sin(direction)
        along = vx * dx + vy * dy
        # The normal points away from the cone.
        nx, ny = -side * dy, side * dx
        signed = vx * nx + vy * ny
        if along >= tangent / horizon and abs(signed) < best:
            best, found, on_leg = abs(signed), (signed, nx, ny), True
    # The rim of the cut-off counts only where its normal points to zero velocity.
    rim_x = vx - front[0] * front[1]
    rim_y = vy - front[0] * front[2]
    faces = rim_x * front[1] + rim_y * front[2] < 0.0
    if faces and (not on_leg or abs(front[0]) < best):
        found = front
    return found


@register_jitable
def reciprocal_avoidance_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: AvoidanceNumbers
) -> None:
    """Computes speed and yaw rate of the robot for one control period.

    The state contains the velocity of the point ``offset_m`` ahead of the axle, in the
    world frame W, m/s. It also contains the pose of each body one period ago. The step
    has four stages:

    1. Estimate the velocity of each body from its last two poses.
    2. Compute one half plane of permitted velocities for each near body.
    3. Among the velocities that all half planes permit, choose the velocity nearest to
       the preferred velocity.
    4. Convert this velocity of the point to speed and yaw rate.
    """
    own, pose, poses, sizes = numbers.own, inputs[4], inputs[5], inputs[6]
    twist, count = outputs[0], len(inputs[6]) // 3
    wanted, bearing = approach(inputs, numbers.follow)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    qx, qy = pose[0] + own.offset_m * c, pose[1] + own.offset_m * s
    planes, used = np.empty((count, 3)), 0
    for k in range(count):
        x, y, theta = poses[3 * k], poses[3 * k + 1], poses[3 * k + 2]
        ux = uy = 0.0
        if tick > 0:
            ux = (x - state[2 + 3 * k]) / numbers.tick_s
            uy = (y - state[3 + 3 * k]) / numbers.tick_s
        for i in range(3):
            state[2 + 3 * k + i] = poses[3 * k + i]
        length, width, radius = sizes[3 * k], sizes[3 * k + 1], sizes[3 * k + 2]
        if math.hypot(x - qx, y - qy) - length - radius > _FARTHEST_M:
            continue
        relative = x - qx, y - qy, theta
        half = 0.5 * length, 0.5 * width
        velocity = state[0] - ux, state[1] - uy
        nx, ny, offset = avoid_body(
            relative, half, numbers.radius_m + radius, velocity, own.horizon_s
        )
        # The bodies do not avoid the robot, so the robot makes the whole change.
        planes[used, 0], planes[used, 1] = nx, ny
        planes[used, 2] = offset + nx * ux + ny * uy
        used += 1
    preferred = turned_off_back(
        wanted * math.cos(bearing),
        wanted * math.sin(bearing),
        pose[2],
        _RESTS_M_S,
    )
    vx, vy, _ = nearest_velocity(planes[:used], preferred, CRUISE_SPEED_M_S, 0)
    state[0], state[1] = vx, vy
    turn = (c * vy - s * vx) / own.offset_m
    limit = TURN_RATE_RAD_S
    twist[0], twist[1] = c * vx + s * vy, min(max(turn, -limit), limit)
    # The robot turns to the target if it is at rest, or if it backs off without an
    # obstacle. While the robot backs off, the twist above would turn the robot away
    # from the target. At rest, the robot would turn back, and the motion would repeat.
    changed = math.hypot(vx - preferred[0], vy - preferred[1])
    backs = wanted < 0.0 and changed < _UNCHANGED_M_S
    if inputs[2][0] > 0.5 and (backs or math.hypot(vx, vy) < _RESTS_M_S):
        twist[1] = turn_toward(0.0, bearing, pose[2])[1]


class ReciprocalAvoidanceController(BaselineController):
    """Changes the wanted velocity as little as needed to avoid contacts (ORCA).

    ORCA is optimal reciprocal collision avoidance. The block knows the exact positions,
    sizes, and velocities of all bodies except the body of the target. It therefore
    shows how well a robot can drive with perfect sensing but without a planned route.

    The other bodies are rectangles that do not avoid the robot (the paper calls them
    non-cooperative agents). Therefore the robot makes the whole change of velocity.

    The block controls the velocity of a point ahead of the axle. A disc around this
    point covers the body of the robot. If no velocity satisfies all constraints, the
    block takes the velocity with the least violation.

    The discrete state contains the velocity of the point and the previous poses of the
    bodies. There is no latency.

    Args:
        robot: Size of the body, and position of the control point P ahead of the axle.
        attraction: ``AttractionParameters``. The block uses only the follow distance.
        gains: ``ReciprocalAvoidanceParameters``.
        bodies: Number of rectangles on the ports ``poses_WO`` and ``sizes``.
        tick_s: Control period, s.

    Reference: van den Berg, Guy, Lin and Manocha, Reciprocal n-body collision
    avoidance, Robotics Research, 2011. For differential drives: Snape et al., IROS
    2010.
    """

    inputs = (
        *BaselineController.inputs,
        Port("pose_WB", 3, "m, m, rad"),
        Port("poses_WO", "3 rectangles", "m, m, rad each"),
        Port("sizes", "3 rectangles", "m, m, m each"),
    )

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(),
        attraction: AttractionParameters = AttractionParameters(),
        gains: ReciprocalAvoidanceParameters = ReciprocalAvoidanceParameters(),
        bodies: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("reciprocal_avoidance_controller")
        numbers = AvoidanceNumbers(
            gains,
            FollowNumbers(attraction.follow_distance_m, robot.control_point_m),
            body_radius(robot) + gains.offset_m + _CLEARANCE_M,
            tick_s,
        )
        state = [0.0] * (2 + 3 * bodies)
        self.declare(
            Step(reciprocal_avoidance_step, numbers, state),
            tick_s=tick_s,
            sizes={"rectangles": bodies},
        )
