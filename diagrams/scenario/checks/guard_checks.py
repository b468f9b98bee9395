"""Checks whether a guard can keep its guarantees, before a run."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from diagrams.scenario.bodies import Body
from diagrams.scenario.participants import Follower
from systems.base.robot import body_radius
from systems.framework.input_error import InputError
from systems.safety.parameters import GuardParameters
from systems.safety.views import (
    PlaceError,
    place_error,
    sensor_sectors,
    stopping_way,
)


def check_guard(
    prefix: str, robot: Follower, bodies: Mapping[str, Body], tick_s: float
) -> None:
    """Raises an error if a robot's guard would never let it start or drive ahead.

    The guard limits the commands so that the robot stays in free space. At the start,
    it assumes that a disc around the robot, the start bubble, is free.

    Args:
        prefix: Prefix of the robot's fields in messages.
        robot: The robot. Without a guard, there is no check.
        bodies: All bodies that the robot could touch, by name.
        tick_s: Control period, s.

    Raises:
        InputError: The sensors or the grid are unsuitable.
        InputError: A body is within the start bubble.
    """
    guard = robot.own_guard
    if guard is None:
        return
    if robot.obstacle_sensing != "ultrasonic":
        raise InputError(
            f"{prefix}obstacle_sensing",
            f"is {robot.obstacle_sensing}, but the guard needs ranges; set it to "
            "ultrasonic, or leave guard out",
        )
    _check_view(prefix, robot)
    _check_memory(prefix, robot, guard, tick_s)
    x, y = robot.start.position_m
    for name, body in bodies.items():
        distance = body.distance((x, y), 0.0)
        if distance < guard.start_bubble_m:
            raise InputError(
                f"{prefix}start.position_m",
                f"{name!r} is {distance:.3g} m from the axle, but the guard assumes "
                f"that a disc of {guard.start_bubble_m:g} m around the axle is free; "
                "move one of them, or lower guard.start_bubble_m",
            )


def _check_view(prefix: str, robot: Follower) -> None:
    sectors = sensor_sectors(robot.ultrasonic, robot.robot.control_point_m)
    turns = sectors.right[:, :1] + np.array([-math.tau, 0.0, math.tau])
    ahead = (turns < 0.0) & (turns + sectors.left - sectors.right > 0.0)
    if not np.any(ahead.any(axis=1) & sectors.seen_by.any(axis=1)):
        raise InputError(
            f"{prefix}ultrasonic.sensors",
            "no sensor looks straight ahead, so that the guard would never let the "
            "robot drive there; add one with axis_deg 0, or leave guard out",
        )


def _check_memory(
    prefix: str, robot: Follower, guard: GuardParameters, tick_s: float
) -> None:
    """Raises an error if ``place_error_m`` is too small for the braking distance.

    A body at the braking distance ahead must stay on the map until the robot has
    stopped. Meanwhile, odometry adds an error to the position of the body on the map,
    and ``place_error_m`` must be at least this error.
    """
    body = robot.robot
    stopping = stopping_way(guard, body, robot.plant, tick_s)
    error = PlaceError.of(guard, body, robot.plant)
    distance = body_radius(body) + stopping
    needed = place_error(distance, stopping, error)
    if needed > guard.place_error_m:
        raise InputError(
            f"{prefix}guard.place_error_m",
            f"is {guard.place_error_m:g} m, but by the time the robot stops, "
            f"{stopping:.2g} m on, what was {distance:.3g} m away may be off by "
            f"{needed:.2g} m, by encoder pulses of {error.pulse_m * 1e3:.2g} mm "
            f"and a wheel_error of {guard.wheel_error:g}; raise it, or use an "
            "encoder with more pulses or a smaller wheel_error",
        )
