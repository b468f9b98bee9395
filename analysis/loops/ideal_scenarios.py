"""Scenarios that can be linearized: exact sensors, and bodies at rest."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from diagrams.scenario.scenario import Scenario
from systems.base.driven_path import DrivenPath
from systems.base.parameters import PlantParameters
from systems.framework.input_error import InputError
from systems.world.paths import WaypointPath

_ALL_IDEAL: dict[str, Any] = {
    "hearing": "ideal_always",
    "obstacle_sensing": "ideal",
    "plant": {"pulses_per_revolution": None},
    # A guard that passes the law's commands unchanged does not affect the loop.
    "guard": None,
}

#: Fields of a body's schedule, which belong to its waypoints.
_NO_SCHEDULE = {"pauses_s": [], "waypoint_times_s": [], "at_end": "stop"}


def ideal_scenario(scenario: Scenario) -> Scenario:
    """Returns a copy with exact sensors, a sound without pauses, and no guard.

    Raises InputError if the wheels can slip.
    """
    require_rolling(scenario.only.plant)
    return changed(scenario, _ALL_IDEAL)


def frozen_scenario(scenario: Scenario, time_s: float = 0.0) -> Scenario:
    """Returns a copy in which all bodies rest where they are at ``time_s``."""
    obstacles = [
        obstacle.model_dump() | _resting(obstacle.path(), time_s)
        for obstacle in scenario.obstacles
    ]
    source = _resting(scenario.source.path(), time_s)
    return changed(scenario, {"source": source, "obstacles": obstacles})


def _resting(path: DrivenPath | WaypointPath, time_s: float) -> dict[str, Any]:
    """Fields of a body that rests where its path is at a time."""
    x, y, theta = path.pose(time_s)
    return {
        **_NO_SCHEDULE,
        "waypoints_m": [[x, y]],
        "heading_deg": math.degrees(theta),
    }


def moving_bodies(scenario: Scenario) -> tuple[str, ...]:
    """Names of the bodies that move. If the source moves, it is the last."""
    moving = [body.name for body in scenario.obstacles if body.path().moves]
    moving += ["source"] if scenario.source.path().moves else []
    return tuple(moving)


def changed(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Returns a validated copy in which ``changes`` replace fields of the scenario.

    If the value of a change is a mapping, it replaces single fields of a group. Any
    other value replaces the whole field. New waypoints have no pauses and times.
    """
    data = scenario.model_dump()
    for key, value in changes.items():
        if not isinstance(value, dict):
            data[key] = value
        elif "waypoints_m" in value:
            data[key] = data[key] | _NO_SCHEDULE | value
        else:
            data[key] = data[key] | value
    return Scenario.model_validate(data)


def require_single_rectangles(scenario: Scenario) -> None:
    """Raises InputError if a body is a wall with a corner, or a polygon.

    The models that add the pushes of bodies add those of all rectangles, but such a
    body pushes with its nearest rectangle only.
    """
    for name, body in scenario.bodies().items():
        if len(body.shape.rectangles) > 1:
            raise InputError(
                "collision_vector.aggregation",
                f"'sum' has no model with {name!r}, which consists of several edges; "
                "use 'paper' or 'nearest', or a box or a disc instead",
            )


def require_rolling(plant: PlantParameters) -> None:
    """Raises InputError if the wheels can slip (``plant.friction`` is set)."""
    if plant.friction is not None:
        raise InputError(
            "plant.friction",
            f"is {plant.friction:g}, and linear models need rolling wheels; set "
            "plant.friction to null, which gives equal motion below the limit of "
            "friction",
        )


def require_ideal(scenario: Scenario) -> None:
    """Raises InputError if a scenario cannot be linearized.

    A linear model needs one robot, one sample rate, exact sensors, rolling wheels, and
    no guard.
    """
    scenario.require_one_robot("a linear model")
    scenario.require_one_rate("a linear model")
    require_rolling(scenario.only.plant)
    checks = (
        (
            not scenario.follower.listens,
            "hearing",
            "'audio' has no linear model, because a waveform has no equilibrium",
        ),
        (
            scenario.follower.obstacle_sensing == "ideal",
            "obstacle_sensing",
            "'ultrasonic' has no linear model, because ranges of cones jump",
        ),
        (
            scenario.only.plant.pulses_per_revolution is None,
            "plant.pulses_per_revolution",
            "a rounded wheel angle has no derivative",
        ),
        (
            scenario.follower.guard is None,
            "guard",
            (
                "the decisions of a guard have no derivative, and a guard that "
                "passes a command does not change it"
            ),
        ),
    )
    for holds, field, reason in checks:
        if not holds:
            raise InputError(
                field,
                f"{reason}; linearize ideal_scenario(scenario), which differs in "
                "sensing only",
            )
