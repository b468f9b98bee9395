"""Range sensors of different kinds in one array: records, short forms, and runs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagrams import dump_scenario, load_scenario, simulate
from diagrams.scenario.warnings.guarantees import guarantees
from phonotaxis.testing import Bench
from systems import FreeSpaceMap, SensingMonitor, UltrasonicArray
from systems.framework.input_error import InputError
from systems.ranging.parameters import RangeSensorParameters, UltrasonicParameters
from systems.ranging.ultrasonic_array import cone_ranges
from systems.safety.views import sensor_sectors

WIDE = {"axis_deg": 0.0, "beam_half_angle_deg": 40.0, "maximum_range_m": 1.0}
#: Three sensors, the middle one wide and short-sighted.
MIXED: dict[str, Any] = {
    "sensors": [{"axis_deg": 30.0}, WIDE, {"axis_deg": -30.0, "noise_m": 0.02}]
}
KINDS = UltrasonicParameters.model_validate(MIXED)


def of(*settings: str) -> UltrasonicParameters:
    return load_scenario("default", settings).follower.ultrasonic


def test_one_value_for_all_and_one_for_one():
    sensors = of("ultrasonic.noise_m=0.01", "ultrasonic.sensors.1.noise_m=0.05")
    assert sensors.each("noise_m").tolist() == [0.01, 0.05, 0.01]
    assert sensors.axes_deg == (30.0, 0.0, -30.0)
    assert sensors.noise_m == 0.05


def test_a_record_wins_over_the_group_and_the_group_over_a_preset():
    sensors = UltrasonicParameters.model_validate(
        {**MIXED, "preset": "lidar", "maximum_range_m": 4.0}
    )
    assert sensors.each("maximum_range_m").tolist() == [4.0, 1.0, 4.0]
    assert sensors.each("noise_m").tolist() == [0.01, 0.01, 0.02]
    assert sensors.each("position_m").tolist() == [[-0.175, 0.0]] * 3


def test_the_fields_of_earlier_versions_are_understood():
    places = [[0.0, 0.3], [0.02, 0.0], [0.0, -0.3]]
    old = {"axes_deg": [25.0, 0.0, -12.0], "positions_m": places}
    sensors = UltrasonicParameters.model_validate(old)
    assert sensors.axes_deg == (25.0, 0.0, -12.0)
    assert np.array(sensors.places).tolist() == places
    ring = UltrasonicParameters.model_validate(
        {"axes_deg": 8, "positions_m": [[-0.1, 0.0]]}
    )
    new = {"sensors": 8, "position_m": [-0.1, 0.0]}
    assert ring == UltrasonicParameters.model_validate(new)


@pytest.mark.parametrize(
    "settings",
    [
        {},
        MIXED,
        {"preset": "six", "noise_m": 0.002},
        {"preset": "ring_12", "sensors": {"3": {"dropout_probability": 0.5}}},
    ],
)
def test_a_saved_scenario_gives_the_same_sensors(tmp_path: Path, settings):
    scenario = load_scenario("default", {"ultrasonic": settings})
    path = tmp_path / "saved.yaml"
    path.write_text(dump_scenario(scenario), "utf-8")
    assert load_scenario(path) == scenario
    # What all sensors have in common can still be changed at once.
    quiet = load_scenario(path, ["ultrasonic.minimum_range_m=0.2"]).follower.ultrasonic
    assert set(quiet.each("minimum_range_m")) == {0.2}
    one = load_scenario(
        path, ["ultrasonic.sensors.1.minimum_range_m=0.2"]
    ).follower.ultrasonic
    assert one.each("minimum_range_m").tolist()[:3] == [0.03, 0.2, 0.03]


def test_a_robot_changes_some_sensors_of_the_scenario():
    robots = {
        "one": {"ultrasonic": {"sensors": {"1": {"noise_m": 0.3}}}},
        "two": {"start": {"position_m": [-2, -1]}, "ultrasonic": {"noise_m": 0.4}},
    }
    settings = {"robots": robots, "ultrasonic": {**MIXED, "minimum_range_m": 0.1}}
    scenario = load_scenario("default", settings)
    one, two = (scenario.of_robot(n).sensing.ultrasonic for n in ("one", "two"))
    assert one.each("noise_m").tolist() == [0.001, 0.3, 0.02]
    assert set(one.each("minimum_range_m")) == {0.1}
    # The third sensor has a value of its own.
    assert two.each("noise_m").tolist() == [0.4, 0.4, 0.02]


@pytest.mark.parametrize(
    ("setting", "field"),
    [
        ("ultrasonic.sensors.2.noise_m=-1", "ultrasonic.sensors.2.noise_m"),
        ("ultrasonic.sensors.2.noise=1", "ultrasonic.sensors.2.noise"),
        ("ultrasonic.sensors.3.noise_m=1", "ultrasonic.sensors.3"),
        ("ultrasonic.sensors.1.maximum_range_m=0.01", "minimum_range_m"),
        ("ultrasonic.sensors.1.axis_deg=40", "ultrasonic.sensors.1.axis_deg"),
        ("ultrasonic.noise_m=-1", "ultrasonic.noise_m"),
        ("ultrasonic.sensors=0", "ultrasonic.sensors"),
    ],
)
def test_errors_name_the_field_of_the_sensor(setting, field):
    with pytest.raises(InputError) as error:
        of(setting)
    assert error.value.field.endswith(field)


def test_each_cone_has_its_own_width():
    """A post 38 deg to the left, 0.8 m from P: within the wide cone alone."""
    angle = math.radians(38.0)
    post = np.array(
        [[0.8 * math.cos(angle), 0.8 * math.sin(angle), angle, 0.02, 0.02, 0.0]]
    )
    wide = RangeSensorParameters(axis_deg=-1.0, beam_half_angle_deg=40.0)
    both = UltrasonicParameters(sensors=(RangeSensorParameters(), wide))
    found = cone_ranges([0.0, 0.0, 0.0], post, both, 0.0)
    assert math.isinf(found[0])
    assert found[1] == pytest.approx(0.79, abs=1e-9)


def test_each_sensor_has_its_own_noise_and_limits():
    """Closed forms: a wall 0.5 m ahead, and standard deviations of 1, 1 and 20 mm."""
    block = UltrasonicArray(parameters=KINDS, obstacle_count=1, seed=3)
    at = Bench(
        block,
        pose_WB=[0.0, 0.0, 0.0],
        poses_WO=[0.175 + 0.55, 0.0, 0.0],
        sizes=[0.1, 9.0, 0.0],
        pose_WS=[-50.0, 0.0, 0.0],
    )
    rows = []
    for tick in range(1500):
        at.context.SetTime(tick * 0.025)
        rows.append(at.output("ranges"))
    side = 0.5 / math.cos(math.radians(15.0))
    errors = np.array(rows) - [side, 0.5, side]
    wanted = np.array([0.001, 0.001, 0.02])
    assert np.all(np.abs(errors.mean(axis=0)) < 5.0 * wanted / math.sqrt(1500))
    np.testing.assert_allclose(errors.std(axis=0), wanted, rtol=5 / math.sqrt(3000))
    # At 1.2 m the middle sensor hears nothing, and says 1 m.
    at.set(poses_WO=[0.175 + 1.25, 0.0, 0.0])
    assert at.output("echo").tolist() == [1.0, 0.0, 1.0]
    assert at.output("ranges")[1] == 1.0


def test_the_map_and_the_monitor_know_each_sensor():
    limits = FreeSpaceMap(sensors=KINDS).step.numbers.limits
    np.testing.assert_allclose(limits[:, 1], [3.0, 1.0, 3.0])
    np.testing.assert_allclose(limits[:, 2], 0.002 + 5.0 * KINDS.each("noise_m"))
    judged = SensingMonitor(sensors=KINDS).step.numbers
    np.testing.assert_allclose(np.diff(judged.spike_m), [0.0, 7.5 * 0.019])
    np.testing.assert_allclose(np.diff(judged.turn_rad), np.radians([50.0, -50.0]))
    sectors = sensor_sectors(KINDS, 0.0)
    assert sectors.right.min() == pytest.approx(math.radians(-45.0))
    seen = sectors.seen_by[:, 1]
    assert np.degrees(sectors.left - sectors.right)[seen].sum() == pytest.approx(80.0)


def test_guarantees_count_the_worst_sensor():
    settings = {"guard": {}, "ultrasonic": MIXED}
    found = guarantees(load_scenario("two_static_obstacles", settings))
    usual = guarantees(load_scenario("two_static_obstacles", {"guard": {}}))
    assert found.seen_way_m == pytest.approx(0.175 + 1.0), "the one that looks ahead"
    assert found.needed_way_m == pytest.approx(usual.needed_way_m + 5.0 * 0.019)


@pytest.mark.parametrize("law", ["conventional", "guarded"])
def test_both_engines_agree_and_the_guard_keeps_its_distance(law):
    """A box in the way, with drop-outs and a fault of one sensor."""
    settings: dict[str, Any] = {
        "hearing": "ideal",
        "law": law,
        "guard": {},
        "duration_s": 4.0,
        "ultrasonic": {**MIXED, "firing": "sequential", "dropout_probability": 0.02},
    }
    scenario = load_scenario("two_static_obstacles", settings)
    drake, compiled = (simulate(scenario, engine=e) for e in ("drake", "compiled"))
    assert compiled.columns.keys() == drake.columns.keys()
    for column, values in drake.columns.items():
        np.testing.assert_allclose(
            compiled.columns[column], values, rtol=0.0, atol=1e-7, err_msg=column
        )
    assert compiled.collision is None
    long = simulate(load_scenario("corridor", {**settings, "duration_s": 15.0}))
    assert long.collision is None
