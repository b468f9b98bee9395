"""Exact places and velocities of objects about the robot, in the place of a scan."""

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
from systems.ranging.parameters import OBJECT_SIZE, OBJECT_SLOTS, ObjectSensorParameters
from systems.world.geometry import (
    control_point,
    nearest_point_on_rectangle,
    segment_clearance,
)

#: A body that moves is taken for a disc unless it is longer than this many times its
#: width.
_LONG = 2.0
#: A body that is slower rests, m/s.
_RESTS_M_S = 1e-9
#: One body hides another where the line to it passes this near, m.
_GRAZE_M = 1e-6


class ObjectNumbers(NamedTuple):
    """What the step of ``IdealObjectSensor`` depends on."""

    maximum_range_m: float
    noise_m: float
    velocity_noise_m_s: float
    occlusion: bool
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    robots: NDArray[np.bool_]
    """(n,) which of the bodies are robots."""
    noise: TickNoise
    delay: int
    """Ticks."""
    tick_s: float


@njit(cache=True)
def _see(
    slot: Any, p_WP: Any, before: Any, now: Any, size: Any, tick_s: float
) -> None:  # pragma: no cover  (compiled)
    """Fills a slot with one body.

    Args:
        slot: (OBJECT_SIZE,) of zeros.
        p_WP: (x, y) m.
        before: (3,) pose of the body a tick before, m and rad.
        now: (3,) pose now.
        size: Length and width, m.
        tick_s: s; 0: the velocity is not known.
    """
    rectangle = now[0], now[1], now[2], size[0], size[1]
    x, y = nearest_point_on_rectangle(p_WP, rectangle)
    slot[THERE], slot[X], slot[Y] = 1.0, x, y
    if tick_s == 0.0:
        return
    slot[KNOWN] = 1.0
    vx, vy = (now[0] - before[0]) / tick_s, (now[1] - before[1]) / tick_s
    turn = ((now[2] - before[2] + math.pi) % math.tau - math.pi) / tick_s
    radius = 0.5 * math.hypot(size[0], size[1])
    if math.hypot(vx, vy) + abs(turn) * radius < _RESTS_M_S:
        return
    cx, cy = now[0] - p_WP[0], now[1] - p_WP[1]
    far = math.hypot(cx, cy)
    if max(size) <= _LONG * min(size) and far > radius:
        slot[X], slot[Y] = cx * (1.0 - radius / far), cy * (1.0 - radius / far)
        slot[VX], slot[VY], slot[RADIUS] = vx, vy, radius
        return
    slot[VX], slot[VY] = vx - turn * (y - cy), vy + turn * (x - cx)
    slot[RADIUS] = 0.5 * min(size)


@njit(cache=True)
def _is_hidden(
    number: int, p_WP: Any, slot: Any, poses: Any, sizes: Any
) -> bool:  # pragma: no cover  (compiled)
    """Whether other bodies stand on the lines from P to a place and all corners."""
    x, y, theta = poses[3 * number], poses[3 * number + 1], poses[3 * number + 2]
    c, s = 0.5 * math.cos(theta), 0.5 * math.sin(theta)
    length, width = sizes[2 * number], sizes[2 * number + 1]
    for place in range(5):
        end = p_WP[0] + slot[X], p_WP[1] + slot[Y]
        if place > 0:
            u = length if place < 3 else -length
            w = width if place % 2 else -width
            end = x + c * u - s * w, y + s * u + c * w
        if not _is_blocked(number, p_WP, end, poses, sizes):
            return False
    return True


@njit(cache=True)
def _is_blocked(
    number: int, p_WP: Any, end: Any, poses: Any, sizes: Any
) -> bool:  # pragma: no cover  (compiled)
    """Whether a body other than one stands on the line from P to a place."""
    for k in range(len(sizes) // 2):
        x, y, theta = poses[3 * k], poses[3 * k + 1], poses[3 * k + 2]
        box = x, y, theta, sizes[2 * k], sizes[2 * k + 1]
        if k != number and segment_clearance(p_WP, end, box) < _GRAZE_M:
            return True
    return False


@njit(cache=True)
def _seen(
    state: Any, pose: Any, poses: Any, sizes: Any, numbers: ObjectNumbers
) -> Any:  # pragma: no cover  (compiled)
    """(n, OBJECT_SIZE) all bodies in range; and the poses kept for the next tick."""
    count = len(sizes) // 2
    p_WP = control_point(pose, numbers.control_point_m)
    slots = np.zeros((count, OBJECT_SIZE))
    tick_s = numbers.tick_s if state[0] > 0.0 else 0.0
    for k in range(count):
        now, size = poses[3 * k : 3 * k + 3], sizes[2 * k : 2 * k + 2]
        slot = slots[k]
        _see(slot, p_WP, state[1 + 3 * k : 4 + 3 * k], now, size, tick_s)
        slot[ROBOT] = 1.0 if numbers.robots[k] else 0.0
        hidden = numbers.occlusion and _is_hidden(k, p_WP, slot, poses, sizes)
        if hidden or math.hypot(slot[X], slot[Y]) > numbers.maximum_range_m:
            slot[:] = 0.0
    state[0] = 1.0
    state[1 : 1 + 3 * count] = poses
    return nearest_objects(slots)


def ideal_object_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: ObjectNumbers
) -> None:
    """The objects that the sensor reports.

    State: whether there was a tick before, the poses of the bodies then, and the
    objects that are not reported yet, oldest first.
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
    """Gives positions and velocities of the bodies around P, in all directions.

    The output has the eight nearest bodies within the range. A body at rest is its
    rectangle: x and y lead to its nearest point. A moving body is the disc around its
    center that contains it, of ``RADIUS``, with the velocity of its center. A long
    moving body, or one whose disc contains P, is its nearest point with the velocity of
    this point, and a disc of half its width behind it. Velocities are known from the
    second tick on, from the poses of the tick before.

    Discrete state: poses of the tick before and, with ``latency_s``, the objects since
    then; their positions are relative to P at their tick. Without ``latency_s`` there
    is no latency. Noise is drawn once per tick.

    Args:
        parameters: ``ObjectSensorParameters``.
        robot: Place of P.
        bodies: Number of bodies on ``poses_WO`` and ``sizes``.
        robots: Numbers of the bodies that are robots.
        seed: Seed of the noise.
        tick_s: Period of the robot, s.

    Raises:
        InputError: The latency is no multiple of the tick.

    Reference: ours. It replaces the scan of Engelbrecht, Steyn and Djouani (2021), who
    print neither how beams become obstacles nor how they get the velocities.
    """

    part, stage = "objects", "obstacle sensing"
    inputs = (
        Port("pose_WB", 3, "m, m, rad"),
        Port("poses_WO", "3 bodies", "m, m, rad each"),
        Port("sizes", "2 bodies", "m, m each"),
    )
    outputs = (OBJECTS_PORT,)

    def __init__(
        self,
        *,
        parameters: ObjectSensorParameters = ObjectSensorParameters(),
        robot: RobotParameters = RobotParameters(),
        bodies: int = 0,
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
            np.isin(np.arange(bodies), list(robots)),
            tick_noise(seed),
            delay,
            tick_s,
        )
        state = [0.0] * (1 + 3 * bodies + delay * OBJECTS_SIZE)
        self.declare(
            Step(ideal_object_step, numbers, state),
            tick_s=tick_s,
            sizes={"bodies": bodies},
            arrays=True,
        )
