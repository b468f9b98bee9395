"""Finds which theorem about the guard holds in a scenario, and with which margins.

The guard is the block that keeps a robot in free space (docs/guard.md). The stability
report and the warnings of a run use the same list of assumptions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from diagrams.scenario.bodies import Body
from diagrams.scenario.scenario import Scenario
from diagrams.scenario.warnings.corner_speeds import corner_speeds
from systems.base.robot import body_radius
from systems.base.tire_grip import GRAVITY_M_S2
from systems.framework.input_error import InputError, shortened
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.parameters import LEAST_MARGIN_M, MARGIN_M
from systems.safety.views import (
    RANGE_MARGIN_M,
    PlaceError,
    place_error,
    range_errors,
    sensor_sectors,
    stopping_way,
    unseen_approach,
)

#: Time that the wheels take to stop after the command is 0, in motor lags.
_LAGS = 6.0
#: Spacing of the directions that sample the view, deg.
_STEP_DEG = 0.25
#: Greatest gap in a view that still counts as a view in all directions, deg.
_GAP_DEG = 1.0
#: Tolerance for rounding errors, in the units of the values.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Assumption:
    """An assumption of a theorem, as a value and its limit."""

    name: str
    """Name in docs/guard.md."""
    text: str
    """The value in words."""
    value: float
    limit: float
    """Greatest value at which the assumption holds. If ``at_least`` is set, it is the
    least value at which the assumption holds.
    """
    unit: str
    at_least: bool = False
    field: str = "guard"
    """Field of the robot to change if the assumption does not hold."""

    @property
    def margin(self) -> float:
        """Distance of the value from the limit; negative if the assumption fails."""
        least, most = self.limit, self.value
        if not self.at_least:
            least, most = most, least
        return most - least

    @property
    def holds(self) -> bool:
        """Whether the scenario satisfies the assumption, apart from rounding."""
        return self.margin >= -_ROUNDING

    @property
    def complaint(self) -> str:
        """Message that the assumption does not hold, with value and limit."""
        value, limit = _told_apart(self.value, self.limit)
        unit = "" if self.unit == "of 1" else f" {self.unit}".rstrip()
        return (
            f"the guard's assumption {self.name} does not hold: {self.text} is "
            f"{value}{unit}, {'below' if self.at_least else 'above'} {limit}{unit} "
            "(docs/guard.md)"
        )


@dataclass(frozen=True)
class Guarantees:
    """The guarantees of a guard in a scenario."""

    obstacle_speed_m_s: float
    """Greatest speed of bodies, m/s; 0: all bodies must be at rest."""
    seen_angle_deg: float
    """Total angle that the sensors see, deg, 0 to 360."""
    seen_way_m: float
    """Distance ahead of the axle up to which the floor can be seen as free, m."""
    needed_way_m: float
    """Free distance ahead of the axle that the guard needs for top speed, m."""
    assumptions: tuple[Assumption, ...]

    @property
    def promise(self) -> str:
        """The theorem that holds, in words, or the assumptions that fail."""
        broken = [each.name for each in self.assumptions if not each.holds]
        if broken:
            return (
                "nothing, because these assumptions do not hold: "
                f"{', '.join(dict.fromkeys(broken))}"
            )
        if self.obstacle_speed_m_s == 0.0:
            return "static safety: the robot touches no obstacle at rest"
        kind = "passive orientation safety"
        if self.seen_angle_deg > 360.0 - _GAP_DEG:
            kind += " with a view in all directions"
        return (
            f"static safety, and {kind} against bodies of up to "
            f"{self.obstacle_speed_m_s:g} m/s"
        )


def clear_way(scenario: Scenario, speed: float, body_speed: float) -> float:
    """Returns the free distance ahead of the axle that the guard needs for a speed.

    The distance is the sum of these parts:

    - body radius, margin of the guard, place error, and range error
    - motion of the robot during two control periods, during the motor lag, and while it
      brakes
    - if all bodies are at rest: the diagonal of a map cell, and the motion of the robot
      during four rounds of sensor readings
    - if bodies move: their motion during one round of sensor readings, and until the
      robot has stopped

    Args:
        scenario: Scenario of one robot. Its guard defines braking and margin.
        speed: Speed of the robot, m/s.
        body_speed: Greatest speed of bodies, m/s. 0: all bodies are at rest.

    Returns:
        The distance, m.

    Raises:
        InputError: The robot has no guard.
    """
    guard = scenario.follower.own_guard
    if guard is None:
        raise InputError(
            "guard", "is unset, so that there is no guard to promise anything; set it"
        )
    tick_s = scenario.tick_s
    keep = body_radius(scenario.only.robot) + guard.place_error_m + MARGIN_M
    sensors, lag = scenario.follower.ultrasonic, scenario.only.plant.motor_lag_s
    # The range error of the noisiest sensor counts for all sensors.
    error = float(max(range_errors(sensors)))
    # A reading of a sensor is at most one round of readings old.
    age = sensors.round_ticks(tick_s) * tick_s
    way = speed**2 / (2.0 * guard.braking_m_s2) + speed * (lag + 2.0 * tick_s)
    if body_speed == 0.0:
        # A cell is free only as a whole. One reading updates only every fourth row.
        cells = math.sqrt(2.0) * guard.cell_m + 4.0 * age * speed
        return keep + way + error + cells
    time = speed / guard.braking_m_s2 + 2.0 * tick_s + _LAGS * lag
    return keep + way + error + body_speed * (age + time)


def seen_angle_deg(sensors: UltrasonicParameters, control_point_m: float) -> float:
    """Returns the total angle around a robot that its range sensors see, 0 to 360 deg.

    ``control_point_m`` is the distance of the control point P ahead of the axle, m.
    """
    sectors = sensor_sectors(sensors, control_point_m)
    turns = np.arange(-180.0, 180.0, _STEP_DEG) + 0.5 * _STEP_DEG
    seen = np.zeros(len(turns), dtype=bool)
    for k, by in enumerate(sectors.seen_by):
        if by.any():
            right, left = np.degrees([sectors.right[k, 0], sectors.left[k, 0]])
            seen |= (turns - right) % 360.0 <= left - right
    return _STEP_DEG * float(seen.sum())


def guarantees(scenario: Scenario) -> Guarantees:
    """Returns the guarantees that the guard of a scenario's only robot gives.

    The guard is the block that limits all commands so that the robot stays in free
    space.

    Args:
        scenario: Scenario of one robot.

    Returns:
        The guarantees, with each assumption and its margin.

    Raises:
        InputError: The robot has no guard.
    """
    (name,), robot = scenario.robots, scenario.follower
    found = assumptions(scenario, name)
    assert robot.own_guard is not None
    (view,) = (each for each in found if each.name == "view")
    return Guarantees(
        robot.own_guard.obstacle_speed_m_s or 0.0,
        seen_angle_deg(robot.ultrasonic, robot.robot.control_point_m),
        view.limit,
        view.value,
        found,
    )


def assumptions(scenario: Scenario, robot: str) -> tuple[Assumption, ...]:
    """Returns the assumptions of the theorems about the guard of a robot.

    The guard is the block that limits all commands so that the robot stays in free
    space.

    Args:
        scenario: Any scenario.
        robot: Name of a robot in the scenario.

    Returns:
        All assumptions, whether they hold or not.

    Raises:
        InputError: The robot has no guard.
    """
    alone = scenario.of_robot(robot)
    own = alone.follower
    guard, sensors, body = own.own_guard, own.ultrasonic, own.robot
    speed = (guard and guard.obstacle_speed_m_s) or 0.0
    needed = clear_way(alone, body.top_speed_m_s, speed)
    axes, places, half_angles = sensors.beams
    forward = np.abs(np.remainder(axes + np.pi, 2.0 * np.pi) - np.pi) <= half_angles
    # Only the sensor that sees farthest ahead counts.
    reach = body.control_point_m + places[:, 0] + sensors.each("maximum_range_m")
    seen = float(np.max(reach[forward], initial=-np.inf))
    return (
        _of_speeds(corner_speeds(scenario, robot), speed),
        *_of_ranges(alone),
        _of_the_start(alone, tuple(scenario.surroundings(robot).bodies.values())),
        *_of_motion(alone),
        Assumption(
            "view",
            "clear floor that top speed needs",
            needed,
            seen,
            "m",
            field="ultrasonic.maximum_range_m",
        ),
    )


def _of_speeds(speeds: Mapping[str, float], speed: float) -> Assumption:
    """Returns assumption A1: no body is faster than the guard expects."""
    text, fastest = "speed of the fastest body", 0.0
    if speeds:
        name = max(speeds, key=speeds.__getitem__)
        text = f"greatest speed of a corner of {shortened(name, 60)!r}"
        fastest = speeds[name]
    field = "guard.obstacle_speed_m_s"
    return Assumption("A1", text, fastest, speed, "m/s", field=field)


def _of_the_start(scenario: Scenario, bodies: tuple[Body, ...]) -> Assumption:
    """Returns assumption A3: no body is within the start bubble."""
    place, guard = scenario.only.start.position_m, scenario.follower.own_guard
    assert guard is not None
    nearest = min((body.distance(place, 0.0) for body in bodies), default=math.inf)
    field, text = "start.position_m", "nearest body at the start"
    return Assumption(
        "A3", text, nearest, guard.start_bubble_m, "m", at_least=True, field=field
    )


def _of_ranges(scenario: Scenario) -> tuple[Assumption, ...]:
    """Returns the conditions of assumption A2 for a robot with a guard.

    A2 states that no body is nearer than a range reading minus the margin. The
    conditions limit the share of missed echoes, the number of blind sensors, and the
    error of ranges due to the assumed speed of sound. If the sensors differ, the worst
    sensor counts.
    """
    sensors = scenario.follower.ultrasonic
    stretch = scenario.believed_sound_speed_m_s / scenario.sound_speed_m_s
    excess = max(stretch - 1.0, 0.0) * sensors.maximum_range_m
    blind = sum(
        fault.sensor == "ultrasonic" and fault.kind == "blind"
        for fault in scenario.only.faults
    )
    return (
        Assumption(
            "A2",
            "share of missed echoes",
            sensors.dropout_probability,
            0.0,
            "of 1",
            field="ultrasonic.dropout_probability",
        ),
        Assumption("A2", "number of blind sensors", blind, 0.0, "", field="faults"),
        Assumption(
            "A2",
            "excess of the farthest range due to the assumed speed of sound",
            excess,
            RANGE_MARGIN_M,
            "m",
            field="assumed_sound_speed_m_s",
        ),
    )


def _of_motion(scenario: Scenario) -> tuple[Assumption, ...]:
    """Returns A4 and A5: position and wheel errors are bounded, and the tires grip."""
    own, tick_s = scenario.follower, scenario.tick_s
    guard, robot, plant = own.own_guard, own.robot, own.plant
    assert guard is not None
    stopping = stopping_way(guard, robot, plant, tick_s)
    error = PlaceError.of(guard, robot, plant)
    lost = place_error(body_radius(robot) + stopping, stopping, error)
    slip = max(map(abs, plant.slip))
    grip = math.inf if plant.friction is None else plant.friction
    hardest = robot.top_speed_m_s / max(plant.motor_lag_s, tick_s)
    return (
        Assumption(
            "A4",
            "unknown share of a wheel's travel",
            slip,
            guard.wheel_error,
            "of 1",
            field="guard.wheel_error",
        ),
        Assumption(
            "A4",
            "error of a position due to encoder pulses and wheels, until the "
            "robot stops",
            lost,
            guard.place_error_m,
            "m",
            field="guard.place_error_m",
        ),
        Assumption(
            "A5",
            "approach to a cell while coasting",
            unseen_approach(robot),
            LEAST_MARGIN_M,
            "m",
            field="robot.wheel_separation_m",
        ),
        Assumption(
            "A5",
            "friction, for the certified braking",
            grip,
            guard.braking_m_s2 / GRAVITY_M_S2,
            "",
            at_least=True,
            field="plant.friction",
        ),
        Assumption(
            "A5",
            "friction, for a stop as hard as the lag allows",
            grip,
            hardest / GRAVITY_M_S2,
            "",
            at_least=True,
            field="plant.friction",
        ),
    )


def _told_apart(value: float, limit: float) -> tuple[str, str]:
    """Formats two numbers with enough digits to show that they differ."""
    pairs = [(f"{value:.{k}g}", f"{limit:.{k}g}") for k in (3, 6, 12)]
    return next((pair for pair in pairs if pair[0] != pair[1]), pairs[-1])
