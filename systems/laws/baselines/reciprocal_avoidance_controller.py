"""Baseline: optimal collision avoidance with perfect knowledge of all bodies (ORCA)."""

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
from systems.laws.baselines.baseline_controller import (
    BaselineController,
)
from systems.laws.parameters import AttractionParameters
from systems.laws.reciprocal_avoidance import ReciprocalAvoidanceParameters
from systems.laws.repulsion import RepulsionParameters
from systems.planning.following import FollowNumbers, approach
from systems.planning.half_planes import nearest_velocity
from systems.planning.parameters import FollowingParameters
from systems.planning.turning import turn_towards, wrapped

#: A velocity that does not lead out of a contact at once does so in this time, s.
_OUT_S = 0.1
#: Slower rests, and by less a velocity is not changed, m/s.
_RESTS_M_S, _UNCHANGED_M_S = 0.05, 1e-6


class AvoidanceNumbers(NamedTuple):
    """What the step of ``ReciprocalAvoidanceController`` depends on."""

    own: ReciprocalAvoidanceParameters
    follow: FollowNumbers
    radius_m: float
    """Of the disc about the point ``offset_m`` ahead that holds the body, with what is
    kept off, m."""
    tick_s: float


@njit(cache=True)
def _beyond(
    u: float, w: float, a: float, b: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """From the nearest place of a rectangle about the origin to (u, w)."""
    return u - min(max(u, -a), a), w - min(max(w, -b), b)


@njit(cache=True)
def avoid_body(
    relative: Any, half: Any, radius: float, velocity: Any, horizon: float
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """The half plane of relative velocities that ORCA permits (van den Berg, eq. 3).

    The velocity obstacle is the set of velocities that lead to a contact of a disc with
    a rectangle within the horizon: a cone, cut off by the rounded rectangle divided by
    the horizon. The plane touches it where it is nearest to the present velocity.

    Args:
        relative: Place of the body from the disc's centre, m, and its direction, rad.
        half: Half of its length and width, m.
        radius: Of the disc, m.
        velocity: Of the disc relative to the body, m/s.
        horizon: s.

    Returns:
        Unit normal (x, y) and offset, m/s, of n . v >= offset.
    """
    # In the axes of the rectangle, which is about (px, py).
    c, s = math.cos(relative[2]), math.sin(relative[2])
    px = c * relative[0] + s * relative[1]
    py = c * relative[1] - s * relative[0]
    vx, vy = c * velocity[0] + s * velocity[1], c * velocity[1] - s * velocity[0]
    a, b = half[0], half[1]
    gx, gy = _beyond(-px, -py, a, b)
    gap = math.hypot(gx, gy)
    inside = gap <= radius
    time = _OUT_S if inside else horizon
    # The cut-off: nearest place of its rim to the velocity.
    fx, fy = _beyond(vx * time - px, vy * time - py, a, b)
    far = math.hypot(fx, fy)
    if far > 1e-9:
        nx, ny = fx / far, fy / far
        signed = (far - radius) / time
    else:
        # The middle of the disc would be in the rectangle: the nearest side out.
        dx, dy = vx * time - px, vy * time - py
        left_x, left_y = a - abs(dx), b - abs(dy)
        nx, ny = (
            (math.copysign(1.0, dx), 0.0)
            if left_x < left_y
            else (
                0.0,
                math.copysign(1.0, dy),
            )
        )
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
    """Of the cut-off and the legs of the cone, what a velocity is nearest to.

    Returns:
        Signed distance, m/s, negative inside, and unit normal.
    """
    (px, py), (vx, vy) = place, velocity
    middle = math.atan2(py, px)
    best, found = np.inf, front
    on_leg = False
    for side in (1.0, -1.0):
        # The corner that reaches farthest to this side, and the tangent past its round.
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
        # Away from the cone.
        nx, ny = -side * dy, side * dx
        signed = vx * nx + vy * ny
        if along >= tangent / horizon and abs(signed) < best:
            best, found, on_leg = abs(signed), (signed, nx, ny), True
    # The rim of the cut-off counts where it faces the robot.
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
    """Computes the twist.

    The state is the velocity of the point, m/s, and the poses of the bodies a tick ago.
    """
    own, pose, poses, sizes = numbers.own, inputs[4], inputs[5], inputs[6]
    twist, count = outputs[0], len(inputs[6]) // 2
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
        if math.hypot(x - qx, y - qy) - sizes[2 * k] > own.farthest_m:
            continue
        relative = x - qx, y - qy, theta
        half = 0.5 * sizes[2 * k], 0.5 * sizes[2 * k + 1]
        velocity = state[0] - ux, state[1] - uy
        nx, ny, offset = avoid_body(
            relative, half, numbers.radius_m, velocity, own.horizon_s
        )
        # All of the change is the robot's: the bodies do not look.
        planes[used, 0], planes[used, 1] = nx, ny
        planes[used, 2] = offset + nx * ux + ny * uy
        used += 1
    preferred = turned_off_back(
        wanted * math.cos(bearing),
        wanted * math.sin(bearing),
        pose[2],
        _RESTS_M_S,
    )
    vx, vy, _ = nearest_velocity(
        planes[:used], preferred, numbers.follow.own.cruise_speed_m_s, 0
    )
    state[0], state[1] = vx, vy
    turn = (c * vy - s * vx) / own.offset_m
    limit = numbers.follow.own.turn_rate_rad_s
    twist[0], twist[1] = c * vx + s * vy, min(max(turn, -limit), limit)
    # At rest, and where it backs off with nothing in the way, it faces the target. The
    # twist above would turn it away, until it rests and turns back: it would chatter.
    changed = math.hypot(vx - preferred[0], vy - preferred[1])
    backs = wanted < 0.0 and changed < _UNCHANGED_M_S
    if inputs[2][0] > 0.5 and (backs or math.hypot(vx, vy) < _RESTS_M_S):
        twist[1] = turn_towards(0.0, bearing, pose[2], numbers.follow.own)[1]


class ReciprocalAvoidanceController(BaselineController):
    """Takes the velocity nearest to the wanted one that hits nobody for a while.

    It knows places, sizes and velocities of all bodies but that of the target: what a
    robot can do that sees everything, but plans no way. Bodies are rectangles, and all
    of a change of velocity is the robot's (the paper's non-cooperative agents). A point
    ahead of the axle moves as the velocity says; the disc about it holds the body. With
    no room the velocity that breaks the constraints by least.

    Discrete state: the point's velocity and the poses of the bodies a tick ago, for
    their velocities. No latency.

    Args:
        robot: Its body, and place of P.
        attraction: The follow distance.
        repulsion: ``RepulsionParameters``; uses ``orca``.
        following: How fast it drives and turns.
        bodies: Number of bodies.
        tick_s: Period of the controller, s.

    Reference: van den Berg, Guy, Lin and Manocha, Reciprocal n-body collision
    avoidance, Robotics Research, 2011; for differential drives Snape et al., IROS 2010.
    """

    inputs = (
        *BaselineController.inputs,
        Port("pose_WB", 3, "m, m, rad"),
        Port("poses_WO", "3 bodies", "m, m, rad each"),
        Port("sizes", "2 bodies", "m, m each"),
    )

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(),
        attraction: AttractionParameters = AttractionParameters(),
        repulsion: RepulsionParameters = RepulsionParameters(),
        following: FollowingParameters = FollowingParameters(),
        bodies: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("reciprocal_avoidance_controller")
        own = repulsion.orca
        numbers = AvoidanceNumbers(
            own,
            FollowNumbers(
                following, attraction.follow_distance_m, robot.control_point_m
            ),
            body_radius(robot) + own.offset_m + own.clearance_m,
            tick_s,
        )
        state = [0.0] * (2 + 3 * bodies)
        self.declare(
            Step(reciprocal_avoidance_step, numbers, state),
            tick_s=tick_s,
            sizes={"bodies": bodies},
        )
