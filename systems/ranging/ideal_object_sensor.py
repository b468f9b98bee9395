"""A sensor that gives exact positions and velocities of the bodies around the robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, Step
from systems.framework.compiling import njit
from systems.framework.input_error import InputError
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.signals import TICK_S, whole
from systems.ranging.objects import (
    KNOWN,
    OBJECTS_PORT,
    OBJECTS_SIZE,
    RADIUS,
    ROBOT,
    THERE,
    VX,
    VY,
    X,
    Y,
    nearest_objects,
)
from systems.ranging.owners import owners_of
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS, ObjectSensorParameters
from systems.world.geometry import (
    control_point,
    nearest_point_on_rectangle,
    segment_clearance,
)

#: A moving body counts as a disc if its longer side is at most this multiple of its
#: shorter side.
_LONG = 2.0
#: A body whose speed is below this is at rest, m/s.
_RESTS_M_S = 1e-9
#: Bodies at rest nearer to each other than this are parts of one obstacle, m (our
#: choice). No robot fits between them, and steps of a slanted wall of a map count as
#: one wall.
_JOINED_M = 0.12
#: A body blocks a line of sight that passes within this distance, m.
_GRAZE_M = 1e-6


class ObjectNumbers(NamedTuple):
    """Constants of ``ideal_object_step``."""

    maximum_range_m: float
    """Largest distance from P at which bodies are seen, m."""
    noise_m: float
    """Standard deviation of each coordinate of a position, m."""
    velocity_noise_m_s: float
    """Standard deviation of each component of a velocity, m/s."""
    occlusion: bool
    """Whether bodies hide other bodies."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    owners: NDArray[np.int64]
    """(n,) number of the body of each rectangle."""
    robots: NDArray[np.bool_]
    """(n,) true for rectangles of robots."""
    noise: TickNoise
    delay: int
    """Latency, ticks."""
    tick_s: float


@njit(cache=True)
def _see(
    slot: Any,
    p_WP: Any,
    before: Any,
    now: Any,
    size: Any,
    alone: bool,  # noqa: FBT001  # compiled code has no keywords
    tick_s: float,
) -> None:  # pragma: no cover  (compiled)
    """Fills the slot of one rectangle of a body, whose elements are zero before.

    The function reports a body at rest as its nearest point, and a moving body as a
    disc around its center. In three cases, it reports the nearest point of a moving
    rectangle instead: if it is long, if it is not the whole body (``alone``), or if the
    disc contains the control point P. ``tick_s`` is 0 if the velocity is unknown.
    """
    rectangle = now[0], now[1], now[2], size[0], size[1], size[2]
    x, y = nearest_point_on_rectangle(p_WP, rectangle)
    slot[THERE], slot[X], slot[Y] = 1.0, x, y
    if tick_s == 0.0:
        return
    slot[KNOWN] = 1.0
    # Compare the fastest point of the body with the limit of a body at rest.
    vx, vy = (now[0] - before[0]) / tick_s, (now[1] - before[1]) / tick_s
    turn = ((now[2] - before[2] + math.pi) % math.tau - math.pi) / tick_s
    radius = 0.5 * math.hypot(size[0], size[1]) + size[2]
    longer = max(size[0], size[1]) + 2.0 * size[2]
    shorter = min(size[0], size[1]) + 2.0 * size[2]
    if math.hypot(vx, vy) + abs(turn) * radius < _RESTS_M_S:
        return
    # Vector from P to the center of the rectangle.
    cx, cy = now[0] - p_WP[0], now[1] - p_WP[1]
    far = math.hypot(cx, cy)
    if alone and longer <= _LONG * shorter and far > radius:
        slot[X], slot[Y] = cx * (1.0 - radius / far), cy * (1.0 - radius / far)
        slot[VX], slot[VY], slot[RADIUS] = vx, vy, radius
        return
    # Velocity of the nearest point.
    slot[VX], slot[VY] = vx - turn * (y - cy), vy + turn * (x - cx)
    slot[RADIUS] = 0.5 * shorter


@njit(cache=True)
def _is_hidden(
    number: int, p_WP: Any, slot: Any, poses: Any, sizes: Any, owners: Any
) -> bool:  # pragma: no cover  (compiled)
    """Returns whether other bodies hide the rectangle ``number`` from the point P.

    A rectangle is hidden if other bodies block five lines: the line from the control
    point P to the reported point of the rectangle, and the lines from P to its four
    corners. A round corner counts by its middle.
    """
    x, y, theta = poses[3 * number], poses[3 * number + 1], poses[3 * number + 2]
    c, s = 0.5 * math.cos(theta), 0.5 * math.sin(theta)
    round_off = math.sqrt(2.0) * sizes[3 * number + 2]
    length, width = sizes[3 * number] + round_off, sizes[3 * number + 1] + round_off
    for place in range(5):
        end = p_WP[0] + slot[X], p_WP[1] + slot[Y]
        if place > 0:
            # Places 1 to 4 are the corners.
            u = length if place < 3 else -length
            w = width if place % 2 else -width
            end = x + c * u - s * w, y + s * u + c * w
        if not _is_blocked(owners[number], p_WP, end, poses, sizes, owners):
            return False
    return True


@njit(cache=True)
def _is_blocked(
    owner: int, p_WP: Any, end: Any, poses: Any, sizes: Any, owners: Any
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether a body other than ``owner`` is on the line from P to a point."""
    for k in range(len(sizes) // 3):
        x, y, theta = poses[3 * k], poses[3 * k + 1], poses[3 * k + 2]
        box = x, y, theta, sizes[3 * k], sizes[3 * k + 1], sizes[3 * k + 2]
        if owners[k] != owner and segment_clearance(p_WP, end, box) < _GRAZE_M:
            return True
    return False


@njit(cache=True)
def _rests(slot: Any) -> bool:  # pragma: no cover  (compiled)
    """Returns whether an object has no velocity and is not a robot."""
    return bool(slot[VX] == 0.0 and slot[VY] == 0.0 and slot[ROBOT] == 0.0)


@njit(cache=True)
def _join_rests(
    slots: Any, p_WP: Any, poses: Any, sizes: Any
) -> None:  # pragma: no cover  (compiled)
    """Leaves one object where rectangles at rest meet.

    The function removes an object whose nearest point is within ``_JOINED_M`` of a
    rectangle that is nearer to P. The other objects are the points at which the
    distance from all obstacles at rest has a local minimum. They do not depend on how a
    wall is cut into rectangles. ``slots`` is modified in place.
    """
    order, away = np.empty(len(slots), dtype=np.int64), np.empty(len(slots))
    count = 0
    for k in range(len(slots)):
        if slots[k, THERE] > 0.5 and _rests(slots[k]):
            order[count] = k
            away[count] = math.hypot(slots[k, X], slots[k, Y])
            count += 1
    order = order[:count][np.argsort(away[:count], kind="mergesort")]
    left = 0
    for a in range(count):
        slot = slots[order[a]]
        # The port has no room for farther objects.
        joined = left >= OBJECT_SLOTS
        x, y = p_WP[0] + slot[X], p_WP[1] + slot[Y]
        for b in range(a):
            if joined:
                break
            k = order[b]
            dx, dy = poses[3 * k] - x, poses[3 * k + 1] - y
            length, width, radius = sizes[3 * k], sizes[3 * k + 1], sizes[3 * k + 2]
            reach = 0.5 * (length + width) + radius + _JOINED_M
            if dx * dx + dy * dy < reach * reach:
                box = poses[3 * k], poses[3 * k + 1], poses[3 * k + 2]
                near = nearest_point_on_rectangle((x, y), (*box, length, width, radius))
                joined = math.hypot(near[0], near[1]) < _JOINED_M
        if joined:
            slot[THERE] = 0.0
        else:
            left += 1


@njit(cache=True)
def _seen(
    state: Any, pose: Any, poses: Any, sizes: Any, numbers: ObjectNumbers
) -> Any:  # pragma: no cover  (compiled)
    """Returns the objects in range without noise and latency, nearest first.

    The function also stores the present poses for the next control period. The first
    element of the state is 1 if poses are stored, otherwise 0. The poses of one control
    period ago follow.
    """
    count, owners = len(sizes) // 3, numbers.owners
    p_WP = control_point(pose, numbers.control_point_m)
    slots = np.zeros((count, OBJECT_SIZE))
    tick_s = numbers.tick_s if state[0] > 0.0 else 0.0
    nearest, first = np.inf, -1
    for k in range(count):
        now, size = poses[3 * k : 3 * k + 3], sizes[3 * k : 3 * k + 3]
        slot = slots[k]
        goes_on = k > 0 and owners[k - 1] == owners[k]
        alone = not goes_on and (k + 1 == count or owners[k + 1] != owners[k])
        _see(slot, p_WP, state[1 + 3 * k : 4 + 3 * k], now, size, alone, tick_s)
        slot[ROBOT] = 1.0 if numbers.robots[k] else 0.0
        away = math.hypot(slot[X], slot[Y])
        hidden = numbers.occlusion and _is_hidden(k, p_WP, slot, poses, sizes, owners)
        # Only the nearest visible rectangle of each moving body remains.
        if not goes_on:
            nearest, first = np.inf, -1
        if hidden or away > numbers.maximum_range_m:
            slot[:] = 0.0
            continue
        if _rests(slot):
            continue
        if away >= nearest:
            slot[:] = 0.0
            continue
        if first >= 0:
            slots[first] = 0.0
        nearest, first = away, k
    state[0] = 1.0
    state[1 : 1 + 3 * count] = poses
    _join_rests(slots, p_WP, poses, sizes)
    return nearest_objects(slots)


def ideal_object_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: ObjectNumbers
) -> None:
    """Computes the objects that the sensor reports in one control period.

    The state has these parts, in this order:

    - a flag that is 1 after the first period;
    - the poses of the rectangles one period ago;
    - with a latency, the objects that are not reported yet, oldest first.
    """
    pose, poses, sizes = inputs
    seen = _seen(state, pose, poses, sizes, numbers)
    normals = tick_normals(numbers.noise, tick, OBJECT_SLOTS, 4)
    for k in range(OBJECT_SLOTS):
        if seen[k, THERE] > 0.5:
            for j in range(2):
                seen[k, X + j] += numbers.noise_m * normals[k, j]
                if seen[k, KNOWN] > 0.5:
                    seen[k, VX + j] += numbers.velocity_noise_m_s * normals[k, 2 + j]
    # The end of the state is a queue: report the oldest objects, append the new ones.
    first = len(state) - numbers.delay * OBJECTS_SIZE
    last = len(state) - OBJECTS_SIZE
    for k in range(OBJECTS_SIZE):
        value = seen[k // OBJECT_SIZE, k % OBJECT_SIZE]
        outputs[0][k] = state[first + k] if numbers.delay > 0 else value
        for at in range(first + k, last, OBJECTS_SIZE):
            state[at] = state[at + OBJECTS_SIZE]
        if numbers.delay > 0:
            state[last + k] = value


class IdealObjectSensor(Block):
    """Gives the positions and velocities of the bodies around the robot.

    Let P be the control point of the robot. The output has the eight nearest bodies
    within the range of the sensor, in all directions. ``X`` and ``Y`` of a slot are the
    vector from P to a point, which depends on the body:

    - Body at rest: the point is the nearest point of the body. The velocity is zero.
      Bodies at rest, and parts of them, that are less than 12 cm apart count as one
      obstacle. This obstacle has an object wherever its distance from P has a local
      minimum. Therefore the objects do not depend on how a wall is cut into pieces.
    - Moving body: the block replaces the body by the smallest disc that contains it and
      has the same center. The point is the nearest point of the disc. The velocity is
      that of the center.
    - Moving body that is long, or whose disc contains P, or that is a wall or a
      polygon: the point is the nearest point of the body. The velocity is that of this
      point. ``RADIUS`` is half of the width of the body, or of the wall.

    The block computes velocities from the present and the previous poses. Therefore
    velocities are known from the second control period on.

    The discrete state has the poses of the bodies in the previous period. With
    ``latency_s``, the state also has the objects that are not reported yet. Their
    positions are relative to P at the time of the measurement. Without ``latency_s``
    there is no latency. The block draws noise once per period.

    Args:
        parameters: Range, errors and latency.
        robot: Distance of P ahead of the axle.
        bodies: Number of rectangles on the ports ``poses_WO`` and ``sizes``.
        owners: Number of the body of each rectangle, ascending from 0. None: each
            rectangle is a body.
        robots: Numbers of the bodies that are robots.
        seed: Seed of the noise.
        tick_s: Control period, s.

    Raises:
        InputError: The latency is not a multiple of the control period.

    Reference: our own work. The block replaces the scan of Engelbrecht, Steyn and
    Djouani (2021). Their paper states neither how beams become obstacles nor how
    velocities are measured.
    """

    part, stage = "objects", "obstacle sensing"
    inputs = (
        Port("pose_WB", 3, "m, m, rad"),
        Port("poses_WO", "3 rectangles", "m, m, rad each"),
        Port("sizes", "3 rectangles", "m, m, m each"),
    )
    outputs = (OBJECTS_PORT,)

    def __init__(
        self,
        *,
        parameters: ObjectSensorParameters = ObjectSensorParameters(),
        robot: RobotParameters = RobotParameters(),
        bodies: int = 0,
        owners: Sequence[int] | None = None,
        robots: Sequence[int] = (),
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("ideal_object_sensor")
        own = parameters
        if own.latency_s > 0.0 and not whole(own.latency_s / tick_s):
            raise InputError(
                "objects.latency_s",
                f"{own.latency_s:g} s is not a multiple of a tick of {tick_s:g} "
                f"s; use {round(own.latency_s / tick_s) * tick_s:g}",
            )
        delay = round(own.latency_s / tick_s)
        numbers = ObjectNumbers(
            own.maximum_range_m,
            own.noise_m,
            own.velocity_noise_m_s,
            own.occlusion,
            robot.control_point_m,
            owners_of(bodies, owners),
            np.isin(owners_of(bodies, owners), list(robots)),
            tick_noise(seed),
            delay,
            tick_s,
        )
        state = [0.0] * (1 + 3 * bodies + delay * OBJECTS_SIZE)
        self.declare(
            Step(ideal_object_step, numbers, state),
            tick_s=tick_s,
            sizes={"rectangles": bodies},
            arrays=True,
        )
