"""Warnings about a scenario: all that its guard takes for granted and does not get."""

from __future__ import annotations

import math

import numpy as np
import pytest

from diagrams import load_scenario, simulate
from diagrams.scenario.warnings.scenario_warning import ScenarioWarning
from diagrams.scenario.warnings.warnings_of import warnings_of
from systems.world.geometry import rectangle_corners

FIELD = "guard.obstacle_speed_m_s"
STILL = "two_static_obstacles"


def warned(*settings, name=STILL):
    return warnings_of(load_scenario(name, [*settings]))


def fields(*settings, name=STILL):
    return [each.field for each in warned(*settings, name=name)]


def with_body(speed, *settings, corner="", size="[0.5, 0.5]"):
    """One body beside the way, straight on or around a corner of 5 cm."""
    way = "[3, -4], [3, 4], [-3, 4]" if corner else "[3, -4], [3, 4]"
    body = (
        f"{{name: cart, size_m: {size}, speed_m_s: {speed}, waypoints_m: [{way}], "
        "corner_radius_m: 0.05}"
    )
    return (f"obstacles=[{body}]", "duration_s=60", *settings)


def test_without_a_guard_nothing_is_told_of_one():
    assert fields(*with_body(2.0), "plant.slip=[0.1, -0.1]") == []


def test_the_audits_cart_names_speed_limit_and_field():
    (warning,) = warned(*with_body(1.2), "law=guarded")
    assert warning.field == FIELD
    assert "A1" in warning.message
    assert "'cart' is 1.2 m/s, above 0.6 m/s" in warning.message
    assert str(warning) == f"{FIELD}: {warning.message}"


@pytest.mark.parametrize(
    ("setting", "field", "told"),
    [
        # 340 m/s are assumed, 319.5 m/s is true: 6.4 % of 3 m.
        (
            "assumed_sound_speed_m_s=340",
            "assumed_sound_speed_m_s",
            "A2",
        ),
        ("ultrasonic.dropout_probability=0.1", "ultrasonic.dropout_probability", "A2"),
        ("faults=[{sensor: ultrasonic, kind: blind}]", "faults", "A2"),
        ("plant.slip=[0.01, -0.01]", "guard.wheel_error", "A4"),
        ("plant.friction=0.6", "plant.friction", "A5"),
    ],
)
def test_every_broken_assumption_is_told(setting, field, told):
    cold = "sound_speed_m_s=319.5"
    (warning,) = warned("guard={}", cold, setting)
    assert warning.field == field
    assert told in warning.message


def test_what_is_true_or_reckoned_with_is_not_told():
    known = "guard={wheel_error: 0.01, place_error_m: 0.1}"
    faults = "faults=[{sensor: ultrasonic, kind: silent}]"
    assert warned("guard={}") == ()
    assert warned("guard={}", "plant.slip=[0.01, -0.01]", known) == ()
    assert warned("guard={}", "assumed_sound_speed_m_s=300") == ()
    assert warned("guard={}", faults) == ()


@pytest.mark.parametrize("speed", [0.1, 0.3, 0.7, 1.1])
def test_a_body_as_fast_as_is_reckoned_with_is_not_told(speed):
    """Differences of places gave 0.30000000000000025 m/s for 0.3."""
    assert warned(*with_body(speed), "guard={}", f"{FIELD}={speed}") == ()
    told = warned(*with_body(speed), "guard={}", f"{FIELD}={speed - 1e-4}")
    assert [each.field for each in told] == [FIELD]


def test_a_bar_is_as_fast_as_its_ends_in_a_corner():
    """0.3 m/s about 5 cm are 6 rad/s; an outer corner is 5 + 5 cm and 1.5 m away."""
    end = 6.0 * math.hypot(0.05 + 0.05, 1.5)
    bar = with_body(0.3, corner="yes", size="[3.0, 0.1]")
    assert FIELD not in fields(*bar, "guard={}", f"{FIELD}={end + 1e-6}")
    assert FIELD in fields(*bar, "guard={}", f"{FIELD}={end - 1e-6}")
    (warning,) = warned(*bar, "guard={}", f"{FIELD}=0.31")
    assert f"is {end:.3g} m/s, above 0.31 m/s" in warning.message


@pytest.mark.parametrize(
    ("name", "settings"),
    [(STILL, with_body(0.3, corner="yes", size="[0.8, 0.3]")), ("default", ())],
)
def test_speeds_of_corners_are_those_of_places(name, settings):
    """By differences of all corners over 1 ms: of drawn bodies and of driven ones."""
    scenario = load_scenario(name, [*settings])
    moving = [
        body for body in scenario.surroundings().bodies.values() if body.path.moves
    ]
    (body,) = moving
    times = np.arange(0.0, scenario.duration_s, 0.001)
    corners = np.array([rectangle_corners(r) for r in body.rectangles_over(times)[0]])
    steps = np.linalg.norm(np.diff(corners, axis=0), axis=2)
    fastest = float(steps.max()) / 0.001
    assert fastest > 0.5
    near = f"{FIELD}={0.998 * fastest}", f"{FIELD}={1.002 * fastest}"
    told = [fields(*settings, "guard={}", each, name=name) for each in near]
    assert told == [[FIELD], []]


def test_only_what_happens_in_the_run_counts():
    """From 5 s on it gains 0.1 m/s^2: 0.1 m/s after 6 s."""
    body = (
        "{name: cart, size_m: [0.5, 0.5], speed_m_s: 2.0, start_time_s: 5, "
        "acceleration_m_s2: 0.1, waypoints_m: [[3, -9], [3, 9]]}"
    )
    scene = f"obstacles=[{body}]", "guard={}"
    assert warned(*scene, "duration_s=4.9") == ()
    assert warned(*scene, "duration_s=6", f"{FIELD}=0.1001") == ()
    assert fields(*scene, "duration_s=6", f"{FIELD}=0.0999") == [FIELD]


def test_other_robots_are_as_fast_as_their_wheels_let_them():
    """One wheel ahead, one back: 0.72 m/s at 0.205 m are 1.566 m/s at 0.446 m."""
    scene = {"name": "two_followers"}
    (warning,) = warned("robots.near.guard={}", **scene)
    assert warning.field == f"robots.near.{FIELD}"
    assert "a corner of 'far' is 1.57 m/s" in warning.message
    corner = 0.72 / 0.205 * 0.5 * math.hypot(0.35, 0.82)
    for speed, told in ((corner - 1e-6, 1), (corner + 1e-6, 0)):
        guard = f"robots.near.guard={{obstacle_speed_m_s: {speed}}}"
        assert len(warned(guard, **scene)) == told


def test_a_result_has_those_of_its_scenario():
    scenario = load_scenario(
        STILL, ["guard={}", "plant.friction=0.6", "hearing=ideal", "duration_s=0.1"]
    )
    result = simulate(scenario)
    assert [each.field for each in result.warnings] == ["plant.friction"]
    assert all(isinstance(each, ScenarioWarning) for each in result.warnings)
