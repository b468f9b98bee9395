"""Which theorem of the guard holds in a scenario, and with which margins."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from diagrams import Scenario
from diagrams.bodies import Body
from diagrams.checks.guard_checks import top_speed
from systems.base.robot import body_radius
from systems.base.tyre_grip import GRAVITY_M_S2
from systems.framework.input_error import InputError
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.views import sensor_sectors
from systems.world.geometry import beyond_rectangle

__all__ = ["Assumption", "Guarantees", "clear_way", "guarantees", "seen_angle_deg"]

#: What the rims still move after the commanded speed is 0, in lags.
_LAGS = 6.0
#: Directions in which the view is looked at, deg apart.
_STEP_DEG = 0.25
#: A view that lacks less is one all round, deg.
_GAP_DEG = 1.0


@dataclass(frozen=True)
class Assumption:
    """What a theorem takes for granted, in numbers."""

    name: str
    """As in docs/safety.md."""
    text: str
    """What is assumed of the value, in words."""
    value: float
    limit: float
    """The greatest value with which it holds; for ``at_least`` the least."""
    unit: str
    at_least: bool = False

    @property
    def margin(self) -> float:
        """How far the value is on the right side of the limit; negative: it is not."""
        least, most = self.limit, self.value
        if not self.at_least:
            least, most = most, least
        return most - least

    @property
    def holds(self) -> bool:
        """Whether the scenario keeps it."""
        return self.margin >= 0.0


@dataclass(frozen=True)
class Guarantees:
    """What a guard promises in a scenario."""

    obstacle_speed_m_s: float
    """Up to which bodies may move, m/s; 0: all has to rest."""
    seen_angle_deg: float
    """Of the round, in view of the sensors, deg."""
    seen_way_m: float
    """How far ahead of the axle floor can be seen free, m."""
    needed_way_m: float
    """How far ahead of the axle it has to be so at top speed, m."""
    assumptions: tuple[Assumption, ...]

    @property
    def promise(self) -> str:
        """The theorem that holds, in words; what is broken, where none does."""
        broken = [each.name for each in self.assumptions if not each.holds]
        if broken:
            return f"nothing, for {', '.join(dict.fromkeys(broken))} does not hold"
        if self.obstacle_speed_m_s == 0.0:
            return "static safety: it touches nothing that rests"
        kind = "passive orientation safety"
        if self.seen_angle_deg > 360.0 - _GAP_DEG:
            kind += " with a view all round"
        return (
            f"static safety, and {kind} against bodies of up to "
            f"{self.obstacle_speed_m_s:g} m/s"
        )


def clear_way(scenario: Scenario, speed: float, body_speed: float) -> float:
    """How far ahead of the axle floor has to be clear so that a command passes.

    Args:
        scenario: Of one robot; its guard gives braking and margin.
        speed: Of the robot, m/s.
        body_speed: Up to which it is guarded against bodies, m/s.

    Returns:
        m: the disc and its margin, the way of a tick and of braking with the lag, the
        error of ranges, and what bodies come nearer by meanwhile.

    Raises:
        InputError: The robot has no guard.
    """
    guard = scenario.own_guard
    if guard is None:
        raise InputError("guard", "is unset, so that nothing is promised; set it")
    known, tick_s = scenario.free_space, scenario.tick_s
    keep = body_radius(scenario.robot) + known.place_error_m + guard.margin_m
    error, lag = known.range_error(scenario.ultrasonic), scenario.plant.motor_lag_s
    # A sensor's reading is so old at most, and its rows of cells come by turns.
    age = scenario.ultrasonic.round_ticks(tick_s) * tick_s
    way = speed**2 / (2.0 * guard.braking_m_s2) + speed * (lag + 2.0 * tick_s)
    if body_speed == 0.0:
        # A cell counts as a whole, and rows of cells are entered by turns.
        cells = math.sqrt(2.0) * known.cell_m + 4.0 * age * speed
        return keep + way + error + cells
    time = speed / guard.braking_m_s2 + 2.0 * tick_s + _LAGS * lag
    return keep + way + error + body_speed * (age + time)


def seen_angle_deg(sensors: UltrasonicParameters, control_point_m: float) -> float:
    """How much of the round range sensors see.

    Args:
        sensors: Any.
        control_point_m: Distance of P ahead of the axle, m.

    Returns:
        deg, of 360.
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
    """What the guard of a scenario's robot promises.

    Args:
        scenario: Of one robot.

    Returns:
        The promise, and each assumption with its margin.

    Raises:
        InputError: The robot has no guard.
    """
    guard, sensors = scenario.own_guard, scenario.ultrasonic
    speed = 0.0 if guard is None else guard.obstacle_speed_m_s
    top = scenario.robot.top_speed_m_s
    needed = clear_way(scenario, top, speed)
    ahead = scenario.robot.control_point_m
    axes, places, half_angle = sensors.beams
    forward = np.abs(np.remainder(axes + np.pi, 2.0 * np.pi) - np.pi) <= half_angle
    far = ahead + np.max(np.reshape(places, (-1, 2))[forward, 0], initial=-np.inf)
    seen = float(far) + sensors.maximum_range_m
    return Guarantees(
        speed,
        seen_angle_deg(sensors, ahead),
        seen,
        needed,
        (
            _of_speeds(scenario, speed),
            *_of_ranges(scenario),
            _of_the_start(scenario),
            *_of_motion(scenario),
            Assumption(
                "view",
                "clear way that top speed needs, seen at the farthest range",
                needed,
                seen,
                "m",
            ),
        ),
    )


def _bodies(scenario: Scenario) -> tuple[Body, ...]:
    """All that the robot could touch."""
    (name,) = scenario.all_robots
    return tuple(scenario.surroundings(name).bodies.values())


def _of_speeds(scenario: Scenario, speed: float) -> Assumption:
    """A1: bodies rest, or are no faster than is reckoned with."""
    duration_s = scenario.duration_s
    speeds = (top_speed(body, duration_s) for body in _bodies(scenario))
    fastest = max(speeds, default=0.0)
    return Assumption("A1", "speed of the fastest body", fastest, speed, "m/s")


def _of_the_start(scenario: Scenario) -> Assumption:
    """A3: nothing stands in the bubble."""
    place = scenario.start.position_m
    nearest = min(
        (
            math.hypot(*beyond_rectangle(place, body.rectangle(0.0)))
            for body in _bodies(scenario)
        ),
        default=math.inf,
    )
    bubble = scenario.free_space.start_bubble_m
    text = "nearest body at the start"
    return Assumption("A3", text, nearest, bubble, "m", at_least=True)


def _of_ranges(scenario: Scenario) -> tuple[Assumption, ...]:
    """A2: nothing is nearer than a reading, less the margin and the noise."""
    sensors, c = scenario.ultrasonic, scenario.acoustics.c
    stretch = (sensors.assumed_sound_speed_m_s or c) / c
    excess = max(stretch - 1.0, 0.0) * sensors.maximum_range_m
    margin = scenario.free_space.range_margin_m
    return (
        Assumption("A2", "echoes missed", sensors.dropout_probability, 0.0, "of 1"),
        Assumption(
            "A2", "farthest range too long by the speed of sound", excess, margin, "m"
        ),
    )


def _of_motion(scenario: Scenario) -> tuple[Assumption, ...]:
    """A4 and A5: wheels as believed, and tyres that hold."""
    guard, plant = scenario.own_guard, scenario.plant
    assert guard is not None
    slip = max(map(abs, plant.slip))
    grip = math.inf if plant.friction is None else plant.friction
    hardest = scenario.robot.top_speed_m_s / max(plant.motor_lag_s, scenario.tick_s)
    return (
        Assumption(
            "A4",
            "share of a wheel's way that is not known",
            slip,
            scenario.free_space.wheel_error,
            "of 1",
        ),
        Assumption(
            "A5",
            "friction, for the certified braking",
            grip,
            guard.braking_m_s2 / GRAVITY_M_S2,
            "",
            at_least=True,
        ),
        Assumption(
            "A5",
            "friction, for a stop as hard as the lag allows",
            grip,
            hardest / GRAVITY_M_S2,
            "",
            at_least=True,
        ),
    )
