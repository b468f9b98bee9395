"""Whether a guard can keep what it promises, asked before anything runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from diagrams.bodies import Body
from diagrams.participants import FollowerParameters
from systems.base.robot import body_radius
from systems.framework.input_error import InputError
from systems.safety.parameters import GuardParameters
from systems.safety.views import lasting, sensor_sectors, stopping_way
from systems.world.plane import beyond_rectangle

__all__ = ["check_guard", "guard_note", "top_speed"]

#: Instants at which paths are looked at for the speeds along them, s apart.
_STEP_S = 0.05


def check_guard(
    prefix: str, robot: FollowerParameters, bodies: Mapping[str, Body], tick_s: float
) -> None:
    """Refuses a guarded robot that could never start, or not drive ahead.

    Args:
        prefix: What the robot's fields begin with in a message.
        robot: The robot; without a guard nothing is asked.
        bodies: All that it could touch, by name.
        tick_s: Period of control, s.

    Raises:
        InputError: Its sensors do not serve, its grid does not, or something stands
            in its bubble.
    """
    if robot.own_guard is None:
        return
    if robot.obstacle_sensing != "ultrasonic":
        raise InputError(
            f"{prefix}obstacle_sensing",
            f"is {robot.obstacle_sensing}, but the guard needs ranges; set it to "
            "ultrasonic, or leave guard out",
        )
    try:
        robot.free_space.check(robot.robot)
    except InputError as error:
        field = f"{prefix}free_space.{error.field}"
        raise InputError(field, error.message) from None
    _check_view(prefix, robot)
    _check_memory(prefix, robot, robot.own_guard, tick_s)
    bubble, (x, y) = robot.free_space.start_bubble_m, robot.start.position_m
    for name, body in bodies.items():
        distance = math.hypot(*beyond_rectangle((x, y), body.rectangle(0.0)))
        if distance < bubble:
            raise InputError(
                f"{prefix}start.position_m",
                f"{name!r} is {distance:.3g} m from the axle, within "
                f"{prefix}free_space.start_bubble_m, {bubble:g} m, which the guard "
                "takes to be free; move one, or lower that",
            )


def _check_view(prefix: str, robot: FollowerParameters) -> None:
    sectors = sensor_sectors(robot.ultrasonic, robot.robot.control_point_m)
    turns = sectors.right[:, :1] + np.array([-math.tau, 0.0, math.tau])
    ahead = (turns < 0.0) & (turns + sectors.left - sectors.right > 0.0)
    if not np.any(ahead.any(axis=1) & sectors.seen_by.any(axis=1)):
        raise InputError(
            f"{prefix}ultrasonic.axes_deg",
            "no sensor looks straight ahead, so that the guard would never let the "
            "robot drive there; add the direction 0, or leave guard out",
        )


def _check_memory(
    prefix: str, robot: FollowerParameters, guard: GuardParameters, tick_s: float
) -> None:
    """What is a braking ahead has to stay known until the robot has stopped."""
    known, body = robot.free_space, robot.robot
    stopping = stopping_way(guard, body, robot.plant, tick_s)
    drift = known.wheel_error, known.place_error_m, body.wheel_separation_m
    distance = body_radius(body) + stopping
    lasts = lasting(distance, drift)
    if lasts < stopping:
        raise InputError(
            f"{prefix}free_space.place_error_m",
            f"{known.place_error_m:g} m: with wheel_error {known.wheel_error:g} what "
            f"is {distance:.3g} m away stays known for {lasts:.2g} m, less than the "
            f"{stopping:.2g} m in which the robot stops; raise it",
        )


def guard_note(
    name: str, robot: FollowerParameters, bodies: Mapping[str, Body], duration_s: float
) -> str:
    """What a user should know of what a guard does not promise.

    Args:
        name: Of the robot.
        robot: The robot.
        bodies: All that it could touch, by name.
        duration_s: Of the run, s.

    Returns:
        A line where one of them moves faster than the guard reckons with; else empty.
    """
    guard = robot.own_guard
    if guard is None or not bodies:
        return ""
    speeds = {each: top_speed(body, duration_s) for each, body in bodies.items()}
    bound, fastest = guard.obstacle_speed_m_s, max(speeds, key=speeds.__getitem__)
    if speeds[fastest] <= bound:
        return ""
    return (
        f"guard: {fastest!r} moves at up to {speeds[fastest]:.3g} m/s, but "
        f"guard.obstacle_speed_m_s is {bound:g}: against what moves faster {name!r} "
        "is not guarded"
    )


def top_speed(body: Body, duration_s: float) -> float:
    """Of a body along its path.

    Args:
        body: Any.
        duration_s: Of the run, s.

    Returns:
        m/s, over steps of 50 ms.
    """
    if not body.path.moves:
        return 0.0
    times = np.arange(0.0, duration_s + _STEP_S, _STEP_S)
    places = body.path.poses(times)[:, :2]
    steps: Iterable[float] = np.hypot(*np.diff(places, axis=0).T)
    return float(max(steps)) / _STEP_S
