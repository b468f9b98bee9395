"""Half planes of velocities that keep P off objects, and that wheels can do."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.planning.half_planes import nearest_velocity
from systems.ranging.objects import KNOWN, RADIUS, ROBOT, THERE, VX, VY, X, Y
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS

#: What is slower rests, m/s.
_RESTS_M_S = 0.02
#: Of what is nearer to P, there is no telling on which side it is, m.
_TOUCHES_M = 1e-9


class FilterNumbers(NamedTuple):
    """How far P keeps off, and what wheels can do."""

    keep_m: float
    """Of P from objects: radius of the body about the axle, epsilon and margin, m."""
    approach_rate: float
    """alpha, 1/s."""
    horizon_s: float
    """For which velocities are kept from leading into what moves, s."""
    top_speed: float
    """Of each wheel's rim and of P, m/s."""
    turn_share: float
    """L/(2 epsilon)."""
    leave_s: float
    """In which it leaves what moves and has come too near, s."""


@njit(cache=True)
def disc_plane(
    center: Any, radius: float, velocity: Any, horizon_s: float, leave_s: float
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """The nearest way out of the velocities that lead into a disc.

    Args:
        center: (x, y) of the disc from P, m.
        radius: Of both together, m.
        velocity: (x, y) relative to the disc, m/s.
        horizon_s: Contacts later than this do not count, s.
        leave_s: In which one leaves what overlaps, s.

    Returns:
        Outward normal x, y, and by how much the velocity is inside along it, m/s;
        negative: outside by so much.
    """
    x, y = center[0], center[1]
    far = math.hypot(x, y)
    time = horizon_s if far > radius else leave_s
    wx, wy = velocity[0] - x / time, velocity[1] - y / time
    size = math.hypot(wx, wy)
    toward = wx * x + wy * y
    if far <= radius or (toward < 0.0 and toward**2 > (radius * size) ** 2):
        # The round end of the cone.
        if size < 1e-12:
            return -x / max(far, 1e-12), -y / max(far, 1e-12), radius / time
        return wx / size, wy / size, radius / time - size
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
    """|v_xB +- (L/2 epsilon) v_yB| <= top speed: what the wheels can do.

    Args:
        theta: Heading, rad.
        numbers: The limits.

    Returns:
        (4, 3) as of ``nearest_velocity``.
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
def filtered_velocity(
    wanted: Any, v_WP: Any, theta: float, objects: Any, numbers: FilterNumbers
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """The velocity of P nearest to a wanted one that keeps off objects.

    What rests, and what moves in an unknown way, may be approached by alpha times what
    is left of the distance. Of what moves, the way out of the velocities that lead into
    it is the robot's; of another robot, which does the same, half of it.

    Where not all can be had, the demands to get away are broken, all by the same: by
    what moves, and by what rests and is too near. That nothing which rests is
    approached faster is not, nor what the wheels can do: the robot can always stand.
    With one slack for all, what comes faster than the robot can get away drove it
    through walls.

    Args:
        wanted: (x, y) m/s.
        v_WP: (x, y) of P now, m/s.
        theta: Heading, rad.
        objects: As of the port ``objects_W``.
        numbers: Distances and limits.

    Returns:
        x, y, m/s, and by how much the worst half plane is broken, m/s.
    """
    # Those that may be broken come first; rest obeys the others.
    planes, used = np.empty((2 * OBJECT_SLOTS + 4, 3)), 0
    kept, resting = np.empty((OBJECT_SLOTS, 3)), 0
    for slot in range(OBJECT_SLOTS):
        at = slot * OBJECT_SIZE
        x, y, radius = objects[at + X], objects[at + Y], objects[at + RADIUS]
        distance = math.hypot(x, y)
        if objects[at + THERE] < 0.5 or distance < _TOUCHES_M:
            continue
        nx, ny = -x / distance, -y / distance
        vx, vy = objects[at + VX], objects[at + VY]
        is_robot = objects[at + ROBOT] > 0.5
        moves = objects[at + KNOWN] > 0.5 and math.hypot(vx, vy) > _RESTS_M_S
        if moves or is_robot:
            center = x - radius * nx, y - radius * ny
            relative = v_WP[0] - vx, v_WP[1] - vy
            nx, ny, inside = disc_plane(
                center,
                radius + numbers.keep_m,
                relative,
                numbers.horizon_s,
                numbers.leave_s,
            )
            share = 0.5 if is_robot else 1.0
            offset = nx * v_WP[0] + ny * v_WP[1] + share * inside
        else:
            offset = -numbers.approach_rate * (distance - numbers.keep_m)
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
