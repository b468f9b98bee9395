"""Half planes of the velocities that avoid objects and that the wheels can produce."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.half_planes import nearest_velocity
from systems.ranging.objects import (
    RADIUS,
    ROBOT,
    THERE,
    VX,
    VY,
    X,
    Y,
    is_moving,
    is_on_map,
)
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS

#: Constant alpha, 1/s (our choice). P may approach an obstacle at rest at most at alpha
#: times the remaining distance.
_APPROACH_RATE = 1.0
#: Duration of the prediction, s (our choice). During this time, the velocity must not
#: lead into a moving object.
_HORIZON_S = 4.0
#: Time within which the robot leaves a moving object that has come too near, s (our
#: choice).
_LEAVE_S = 0.1
#: An object nearer to P than this distance, m, has no defined direction and is ignored.
_TOUCHES_M = 1e-9


class FilterNumbers(NamedTuple):
    """Distances that the control point P keeps, and limits of the wheels."""

    keep_m: float
    """Distance that the control point P keeps from objects, m. It is the sum of the
    radius of the body around the axle, the distance epsilon of P ahead of the axle, and
    the margin.
    """
    top_speed: float
    """Top speed of each wheel's rim and of P, m/s."""
    turn_share: float
    """Ratio L/(2 epsilon) of the wheel separation L to twice the distance epsilon of
    the control point P ahead of the axle.
    """


@njit(cache=True)
def disc_plane(
    center: Any, radius: float, velocity: Any, horizon_s: float, leave_s: float
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Computes the smallest change of a velocity that prevents contact with a disc.

    The velocities that lead to contact within the horizon form a cone with a round end:
    the velocity obstacle of van den Berg and others. The function finds the point on
    the border of the cone that is nearest to the given velocity. This point is on the
    round end or on one of the two legs of the cone.

    Args:
        center: Position (x, y) of the disc relative to the control point P, m.
        radius: Sum of the radius of the disc and the radius of the robot, m.
        velocity: Velocity (x, y) of P relative to the disc, m/s.
        horizon_s: Time after which contacts do not count, s.
        leave_s: Time in which the robot has to end an overlap with the disc, s.

    Returns:
        x and y of the outward unit normal, and the depth of the velocity inside the
        cone, m/s. The depth is negative outside the cone.
    """
    x, y = center[0], center[1]
    far = math.hypot(x, y)
    time = horizon_s if far > radius else leave_s
    wx, wy = velocity[0] - x / time, velocity[1] - y / time
    size = math.hypot(wx, wy)
    toward = wx * x + wy * y
    if far <= radius or (toward < 0.0 and toward**2 > (radius * size) ** 2):
        # The nearest border is the round end of the cone.
        if size < 1e-12:
            return -x / max(far, 1e-12), -y / max(far, 1e-12), radius / time
        return wx / size, wy / size, radius / time - size
    # The nearest border is a leg: a tangent from P to the disc.
    leg = math.sqrt(far * far - radius * radius)
    if x * wy - y * wx > 0.0:
        dx, dy = (x * leg - y * radius) / far**2, (x * radius + y * leg) / far**2
    else:
        dx, dy = -(x * leg + y * radius) / far**2, (x * radius - y * leg) / far**2
    nx, ny = -dy, dx
    return nx, ny, -(velocity[0] * nx + velocity[1] * ny)


@njit(cache=True)
def wheel_planes(
    theta: float, numbers: FilterNumbers
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the half planes of the velocities that the wheels can produce.

    The limits are, for both signs::

        |v_xB +- L/(2 epsilon) v_yB| <= top speed

    v_xB and v_yB are the velocity of the control point P in the axes of the body. L is
    the wheel separation. epsilon is the distance of P ahead of the axle.

    Args:
        theta: Heading of the robot, rad.
        numbers: Limits of the wheels.

    Returns:
        (4, 3) half planes in the format of ``nearest_velocity``.
    """
    planes = np.empty((4, 3))
    length = math.hypot(1.0, numbers.turn_share)
    c, s = math.cos(theta), math.sin(theta)
    for k in range(4):
        ahead = 1.0 if k < 2 else -1.0
        aside = numbers.turn_share if k % 2 == 0 else -numbers.turn_share
        planes[k, 0] = -(c * ahead - s * aside) / length
        planes[k, 1] = -(s * ahead + c * aside) / length
        planes[k, 2] = -numbers.top_speed / length
    return planes


@njit(cache=True)
def without_known(
    objects: Any, p_WP: Any, rectangles: Any
) -> Any:  # pragma: no cover  (compiled)
    """Returns the objects that are not on the map (``is_on_map``).

    Args:
        objects: (64,) value of the port ``objects_W``.
        p_WP: (x, y) of the control point P in the world frame W, m.
        rectangles: (k, 6) rectangles of known obstacles (x, y, theta, length, width,
            radius) in W, m and rad.

    Returns:
        (64,) copy without the objects at rest that are part of a known obstacle.
    """
    others = objects.copy()
    for slot in range(OBJECT_SLOTS):
        at = slot * OBJECT_SIZE
        if objects[at + ROBOT] > 0.5 or is_moving(objects, at):
            continue
        x, y = p_WP[0] + objects[at + X], p_WP[1] + objects[at + Y]
        if is_on_map(x, y, rectangles):
            others[at + THERE] = 0.0
    return others


@njit(cache=True)
def filtered_velocity(
    wanted: Any,
    v_WP: Any,
    theta: float,
    objects: Any,
    outline: Any,
    numbers: FilterNumbers,
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Changes a wanted velocity of P as little as possible to avoid objects.

    P is the control point of the robot. Each object adds one half plane of permitted
    velocities:

    - Object at rest or with unknown motion: the speed of approach is at most a constant
      times the remaining distance.
    - Moving object: the velocity of P must not lead into the object. ``disc_plane``
      computes the smallest change that prevents the contact.
    - Other robot: P makes only half of this change, because the other robot uses the
      same filter.

    If these constraints contradict each other, the function relaxes all soft
    constraints by the same slack. The constraints of moving objects and robots are
    soft. The limits of the wheels and of the approach to objects at rest are hard.
    Therefore a fast object cannot push the robot through walls. A robot that stands
    still satisfies all hard constraints. For an object at rest that is too near, an
    additional soft constraint moves P away.

    Args:
        wanted: Wanted velocity (x, y), m/s.
        v_WP: Present velocity (x, y) of P in the world frame W, m/s.
        theta: Heading of the robot, rad.
        objects: Objects in the format of the port ``objects_W``.
        outline: (n, 3) half planes of ``outline_planes``, in addition to those of the
            objects.
        numbers: Distances and limits.

    Returns:
        Velocity x, m/s; velocity y, m/s; and slack, m/s.
    """
    # Soft planes come first, then hard planes. A robot at rest obeys all hard planes.
    most = OBJECT_SLOTS + len(outline)
    planes, used = np.empty((2 * most + 4, 3)), 0
    kept, resting = np.empty((most, 3)), 0
    for k in range(len(outline)):
        kept[resting] = outline[k]
        kept[resting, 2] = min(outline[k, 2], 0.0)
        resting += 1
        if outline[k, 2] > 0.0:
            planes[used] = outline[k]
            used += 1
    for slot in range(OBJECT_SLOTS):
        at = slot * OBJECT_SIZE
        x, y, radius = objects[at + X], objects[at + Y], objects[at + RADIUS]
        distance = math.hypot(x, y)
        if objects[at + THERE] < 0.5 or distance < _TOUCHES_M:
            continue
        nx, ny = -x / distance, -y / distance
        vx, vy = objects[at + VX], objects[at + VY]
        is_robot = objects[at + ROBOT] > 0.5
        if is_robot or is_moving(objects, at):
            # A moving object or a robot counts as a disc behind its nearest point.
            center = x - radius * nx, y - radius * ny
            relative = v_WP[0] - vx, v_WP[1] - vy
            nx, ny, inside = disc_plane(
                center,
                radius + numbers.keep_m,
                relative,
                _HORIZON_S,
                _LEAVE_S,
            )
            share = 0.5 if is_robot else 1.0
            offset = nx * v_WP[0] + ny * v_WP[1] + share * inside
        else:
            # An object at rest. A hard plane limits the approach. If the object is too
            # near, a soft plane also requires P to move away.
            offset = -_APPROACH_RATE * (distance - numbers.keep_m)
            kept[resting, 0], kept[resting, 1] = nx, ny
            kept[resting, 2] = min(offset, 0.0)
            resting += 1
            if offset <= 0.0:
                continue
        planes[used, 0], planes[used, 1], planes[used, 2] = nx, ny, offset
        used += 1
    hard = resting + 4
    limits = wheel_planes(theta, numbers)
    for k in range(hard):
        for j in range(3):
            planes[used + k, j] = kept[k, j] if k < resting else limits[k - resting, j]
    return nearest_velocity(planes[: used + hard], wanted, numbers.top_speed, hard)
