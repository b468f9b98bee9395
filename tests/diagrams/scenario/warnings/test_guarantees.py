"""What a guard promises: by hand, and one broken assumption at a time."""

from __future__ import annotations

import math

import pytest

from diagrams import load_scenario
from diagrams.scenario.warnings.guarantees import clear_way, guarantees, seen_angle_deg
from systems.framework.input_error import InputError
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.views import range_errors


def facts(name="two_static_obstacles", *settings):
    return guarantees(load_scenario(name, ["guard={}", *settings]))


def broken(*settings, name="two_static_obstacles"):
    return {each.name for each in facts(name, *settings).assumptions if not each.holds}


def test_by_default_nothing_that_rests_is_touched():
    found = facts()
    assert broken() == set()
    assert found.promise == "static safety: the robot touches no obstacle at rest"
    assert found.seen_angle_deg == pytest.approx(90.0, abs=0.6)


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        (["ultrasonic.dropout_probability=0.1"], "A2"),
        (["assumed_sound_speed_m_s=400"], "A2"),
        (["faults=[{sensor: ultrasonic, kind: blind}]"], "A2"),
        (["plant.slip=[0.01, -0.01]"], "A4"),
        (["plant.friction=0.15"], "A5"),
        (["plant.friction=0.6"], "A5"),
        (["ultrasonic.maximum_range_m=0.6"], "view"),
    ],
)
def test_one_broken_assumption_is_named(settings, name):
    assert broken(*settings) == {name}
    assert facts("two_static_obstacles", *settings).promise.startswith(
        f"nothing, because these assumptions do not hold: {name}"
    )


def test_bodies_may_be_as_fast_as_is_reckoned_with():
    """One that drives at 0.3 m/s (its scenario)."""
    assert broken(name="one_moving_obstacle") == {"A1"}
    slow, fast = (f"guard.obstacle_speed_m_s={v}" for v in (0.2, 0.6))
    assert broken(slow, name="one_moving_obstacle") == {"A1"}
    assert broken(fast, name="one_moving_obstacle") == set()
    promise = facts("one_moving_obstacle", fast).promise
    assert "passive orientation safety against bodies of up to 0.6 m/s" in promise
    ring = facts("one_moving_obstacle", fast, "ultrasonic.preset=ring_12").promise
    assert "with a view in all directions" in ring


def test_a5_is_the_friction_that_the_braking_and_the_lag_need():
    """1.5/9.81, and 0.72 m/s within a lag of 60 ms, 12 m/s^2."""
    limits = [each.limit for each in facts().assumptions if "friction" in each.text]
    assert limits == pytest.approx([1.5 / 9.81, 12.0 / 9.81])


@pytest.mark.parametrize(("separation", "names"), [(0.07, set()), (0.055, {"A5"})])
def test_the_least_margin_has_to_hold_what_a_corner_coasts(separation, names):
    """0.2 mm of the rims by 0.446 m over half their distance: 2.5 and 3.2 of 3 mm."""
    fields = f"robot.wheel_separation_m={separation}", "guard.place_error_m=0.02"
    assert broken(*fields) == names


def test_a4_counts_the_pulses_of_the_encoder_until_the_robot_stops():
    """(q/L) (s + d) + q by hand; 100 pulses are too few for 6 mm and are refused."""
    stopping = 0.72**2 / 3.0 + 0.72 * 0.1
    distance = 0.5 * math.hypot(0.35, 0.82) + stopping
    for pulses in (2600, 400):
        q = 0.06 * math.tau / pulses
        (pulse, *_) = [
            each
            for each in facts(
                "two_static_obstacles",
                "robot.top_speed_m_s=0.72",
                f"plant.pulses_per_revolution={pulses}",
            ).assumptions
            if "pulses" in each.text
        ]
        assert pulse.value == pytest.approx(q / 0.41 * (stopping + distance) + q)
        assert pulse.limit == 0.006
    with pytest.raises(InputError, match="encoder with more pulses"):
        facts("two_static_obstacles", "plant.pulses_per_revolution=100")


def test_sensors_on_the_axle_see_less_far_ahead():
    """3 m from P, 0.175 m ahead of the axle; the ring stands over it."""
    assert facts().seen_way_m == pytest.approx(3.175)
    ring = facts("two_static_obstacles", "ultrasonic.preset=ring_12")
    assert ring.seen_way_m == pytest.approx(3.0)


def test_old_readings_need_more_clear_way():
    """Three cones in turn: two ticks older, and what bodies do meanwhile."""
    settings = "guard.obstacle_speed_m_s=0.6"
    turns = "ultrasonic.firing=sequential"
    more = facts("one_moving_obstacle", settings, turns).needed_way_m
    assert more - facts("one_moving_obstacle", settings).needed_way_m == (
        pytest.approx(0.6 * 0.05)
    )


def test_the_clear_way_by_hand():
    """R 0.446 and 12 mm, v^2/2a, lag and two ticks, margins of ranges, bodies' way."""
    scenario = load_scenario("two_static_obstacles", ["guard={}"])
    lag, error = (
        scenario.only.plant.motor_lag_s,
        range_errors(scenario.follower.ultrasonic).max(),
    )
    disc = 0.5 * math.hypot(0.35, 0.82) + 0.012
    way = 0.6**2 / 3.0 + 0.6 * (lag + 0.05) + error
    time = 0.6 / 1.5 + 0.075 + 6.0 * lag
    assert clear_way(scenario, 0.6, 0.5) == pytest.approx(disc + way + 0.5 * time)
    cells = math.sqrt(2.0) * 0.05 + 0.06
    assert clear_way(scenario, 0.6, 0.0) == pytest.approx(disc + way + cells)


@pytest.mark.parametrize(
    ("preset", "degrees"),
    [("three", 90.0), ("six", 180.0), ("ring_12", 360.0), ("lidar", 360.0)],
)
def test_what_sensors_see_of_the_round(preset, degrees):
    """Cones of 30 deg side by side: three, twice three, and rings without a gap."""
    sensors = UltrasonicParameters.model_validate({"preset": preset})
    assert seen_angle_deg(sensors, 0.175) == pytest.approx(degrees, abs=0.6)


def test_without_a_guard_nothing_is_promised():
    with pytest.raises(InputError, match="no guard to promise"):
        guarantees(load_scenario("default"))
