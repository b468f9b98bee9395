"""Named sets of sensors: what they see, and how they are chosen and changed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from analysis.batches.plan import SweepPlan
from analysis.batches.sweep import reproducing_command
from diagrams import Scenario, dump_scenario, load_scenario, simulate
from systems.ranging.parameters import UltrasonicParameters
from systems.ranging.sensor_presets import SENSOR_PRESETS
from systems.ranging.ultrasonic_array import cone_ranges

RINGS = ("ring_8", "ring_12", "lidar")
MAST, CONTROL_POINT_M = (-0.175, 0.0), 0.175
POSE = (0.7, -0.4, 0.3)


def sensors(preset: str, **fields: object) -> UltrasonicParameters:
    return UltrasonicParameters.model_validate({"preset": preset, **fields})


def chosen(tmp_path: Path, text: str, *overrides: str) -> UltrasonicParameters:
    path = tmp_path / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path, overrides).follower.ultrasonic


def saved(tmp_path: Path, scenario: Scenario) -> Path:
    path = tmp_path / "saved.yaml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    return path


def test_three_is_what_there_is_by_default():
    assert sensors("three") == UltrasonicParameters()


@pytest.mark.parametrize("name", RINGS)
def test_a_ring_sees_a_body_at_every_bearing(name):
    """A post of 2 cm, 1.5 m from the axle: each echo is its near side, to a cm."""
    ring = sensors(name)
    for degrees in np.arange(0.0, 360.0, 1.0):
        angle = math.radians(degrees)
        x, y = POSE[0] + 1.5 * math.cos(angle), POSE[1] + 1.5 * math.sin(angle)
        post = np.array([[x, y, angle, 0.02, 0.02, 0.0]])
        found = cone_ranges(POSE, post, ring, CONTROL_POINT_M)
        assert found.min() == pytest.approx(1.49, abs=1e-9), degrees
        heading = ring.axes[int(np.argmin(found))] + POSE[2]
        off = abs(math.remainder(heading - angle, 2.0 * math.pi))
        half = ring.half_angles[0] + 0.01 / 1.49
        assert off <= half, "one that looks there"


def test_the_papers_three_do_not():
    behind = np.array([[POSE[0] - 1.5, POSE[1], 0.0, 0.02, 0.02, 0.0]])
    found = cone_ranges((*POSE[:2], 0.0), behind, sensors("three"), CONTROL_POINT_M)
    assert np.all(np.isinf(found))


@pytest.mark.parametrize("name", RINGS)
def test_a_ring_has_no_gaps_and_stands_over_the_axle(name):
    ring = sensors(name)
    np.testing.assert_allclose(ring.half_angles, math.pi / ring.count)
    assert set(ring.places) == {MAST}
    assert len(ring.neighbors) == ring.count


def test_three_of_six_look_back_from_the_rear_edge():
    six = sensors("six")
    turned = [math.remainder(axis, 360.0) for axis in six.axes_deg[3:]]
    assert turned == [-150.0, -180.0, 150.0]
    assert six.places[3:] == ((-0.35, 0.0),) * 3
    assert (six.axes_deg[:3], six.places[:3]) == ((30.0, 0.0, -30.0), ((0.0, 0.0),) * 3)


@pytest.mark.parametrize(
    ("robot", "mast", "rear"),
    [
        # Axle and rear edge from P: -eps and -eps - length/2, from the data sheets.
        ("han2019", -0.175, -0.350),
        ("turtlebot3_burger", -0.080, -0.149),
        ("jackal", -0.188, -0.442),
        ("p3dx", -0.1655, -0.393),
    ],
)
def test_sensors_stand_where_the_body_of_each_robot_allows(robot, mast, rear):
    for name in (*RINGS, "lidar_270"):
        words = [f"robot.preset={robot}", f"ultrasonic.preset={name}"]
        loaded = load_scenario("default", words)
        assert set(loaded.follower.ultrasonic.places) == {(mast, 0.0)}
        again = loaded.with_({"seed": 2})
        assert again.follower.ultrasonic == loaded.follower.ultrasonic
    words = [f"robot.preset={robot}", "ultrasonic.preset=six"]
    fourth = "ultrasonic.sensors={3: {position_m: [-0.1, 0.0]}, 4: {noise_m: 0.02}}"
    ahead, behind = load_scenario("default", words), [*words, fourth]
    assert ahead.follower.ultrasonic.places[:3] == ((0.0, 0.0),) * 3
    places = np.array(ahead.follower.ultrasonic.places[3:])
    np.testing.assert_allclose(places, [[rear, 0.0]] * 3, atol=1e-12)
    changed = load_scenario("default", behind).follower.ultrasonic
    np.testing.assert_allclose(changed.places[3:], [[-0.1, 0], [rear, 0], [rear, 0]])
    assert changed.sensors[4].noise_m == 0.02


def test_a_given_position_wins_over_the_mast():
    words = ["robot.preset=jackal", "ultrasonic.preset=lidar"]
    given = load_scenario("default", [*words, "ultrasonic.position_m=[-0.05, 0.0]"])
    assert set(given.follower.ultrasonic.places) == {(-0.05, 0.0)}


def test_a_scanner_sees_270_deg_ahead_without_gaps():
    scan = sensors("lidar_270")
    np.testing.assert_allclose(np.diff(scan.axes_deg), -2.0 * 1.8)
    assert scan.axes_deg[0] + 1.8 == pytest.approx(135.0)
    assert scan.axes_deg[0] == -scan.axes_deg[-1]
    assert 0.0 in scan.axes_deg, "the guard needs a view straight ahead"
    assert (scan.count, scan.maximum_range_m, scan.noise_m) == (75, 10.0, 0.01)


def test_a_lidar_is_farther_and_noisier():
    lidar = sensors("lidar")
    assert (lidar.maximum_range_m, lidar.noise_m) == (5.0, 0.01)


def test_a_scan_of_seven_is_a_half_plane_of_rays():
    """A wall 1 m ahead of P: 1/cos of the axis, less what half a beam adds."""
    scan = sensors("scan_7")
    assert scan.axes_deg == tuple(90.0 - 30.0 * k for k in range(7))
    assert scan.places == ((0.0, 0.0),) * 7
    wall = np.array([[0.175 + 1.05, 0.0, 0.0, 0.1, 9.0, 0.0]])
    found = cone_ranges((0.0, 0.0, 0.0), wall, scan, CONTROL_POINT_M)
    assert np.all(np.isinf(found[[0, 6]]))
    for axis, range_ in zip(scan.axes_deg[1:6], found[1:6], strict=True):
        nearest = math.radians(max(abs(axis) - 0.5, 0.0))
        assert range_ == pytest.approx(1.0 / math.cos(nearest), rel=1e-9)
    # Between two beams a post of 2 cm is not seen.
    angle = math.radians(15.0)
    post = [0.175 + math.cos(angle), math.sin(angle), 0.0, 0.02, 0.02, 0.0]
    found = cone_ranges((0.0, 0.0, 0.0), np.array([post]), scan, CONTROL_POINT_M)
    assert np.all(np.isinf(found))


def test_what_is_given_beside_a_preset_wins(tmp_path):
    text = "ultrasonic: {noise_m: 0.002, preset: lidar, maximum_range_m: 4}"
    found = chosen(tmp_path, text)
    assert found == sensors("lidar", noise_m=0.002, maximum_range_m=4.0)
    assert (found.noise_m, found.maximum_range_m, found.count) == (0.002, 4.0, 72)


@pytest.mark.parametrize("first", ["noise", "preset"])
def test_the_order_on_the_command_line_does_not_matter(tmp_path, first):
    words = ["ultrasonic.noise_m=0.002", "ultrasonic.preset=lidar"]
    if first == "preset":
        words.reverse()
    expected = sensors("lidar", noise_m=0.002)
    assert load_scenario("default", words).follower.ultrasonic == expected
    path = saved(tmp_path, load_scenario("default", ["ultrasonic.preset=ring_8"]))
    assert load_scenario(path, words).follower.ultrasonic == expected


def test_fields_of_a_file_win_over_a_preset_of_the_command_line(tmp_path):
    found = chosen(tmp_path, "ultrasonic: {noise_m: 0.002}", "ultrasonic.preset=lidar")
    assert found == sensors("lidar", noise_m=0.002)


@pytest.mark.parametrize("name", SENSOR_PRESETS)
def test_a_saved_scenario_has_the_effective_values(tmp_path, name):
    scenario = load_scenario("default", [f"ultrasonic.preset={name}"])
    path = saved(tmp_path, scenario)
    assert load_scenario(path) == scenario
    text = path.read_text("utf-8")
    assert f"preset: {name}" in text
    half = sensors(name).sensors[0].beam_half_angle_deg
    assert text.count(f"beam_half_angle_deg: {half}") == 1
    # Another preset takes the place of all of them.
    other = load_scenario(path, ["ultrasonic.preset=ring_12"])
    assert other.follower.ultrasonic == sensors("ring_12")


def test_a_ring_of_any_number_on_the_mast():
    assert set(sensors("ring_12", sensors=16).places) == {MAST}
    assert sensors("ring_12", sensors=16).count == 16


def test_each_robot_may_have_another():
    robots = "robots={robot: {}, second: {ultrasonic: {preset: ring_8}, start: "
    robots += "{position_m: [-2, -1]}}}"
    words = [robots, "ultrasonic.noise_m=0.003"]
    scenario = load_scenario("default", words)
    assert scenario.of_robot("second").sensing.ultrasonic == sensors("ring_8")
    first = scenario.of_robot("robot").sensing.ultrasonic
    assert first == sensors("three", noise_m=0.003)


def test_a_robot_may_be_named_preset():
    words = ["robots={robot: {}}", "robots.preset={start: {position_m: [-2, -1]}}"]
    assert set(load_scenario("default", words).robots) == {"robot", "preset"}


def test_a_sweep_goes_through_presets(tmp_path):
    names = list(SENSOR_PRESETS)
    plan = SweepPlan.model_validate(
        {
            "set": {"hearing": "ideal"},
            "grid": {"ultrasonic.preset": names, "ultrasonic.period_s": [0.05]},
        }
    )
    points = plan.points()
    expected = [sensors(name, period_s=0.05) for name in names]
    assert [plan.scenario_of(point).follower.ultrasonic for point in points] == expected
    assert "ultrasonic.preset" in reproducing_command(tmp_path, points[0], "drake")


@pytest.mark.parametrize(
    "fixed", [{"ultrasonic.noise_m": 0.002}, {"ultrasonic": {"noise_m": 0.002}}]
)
def test_a_sweep_whose_preset_would_drop_what_is_set_is_refused(fixed):
    plan = {"set": fixed, "grid": {"ultrasonic.preset": ["three", "six"]}}
    what = r"grid\.ultrasonic\.preset: replaces all of ultrasonic"
    with pytest.raises(ValidationError, match=what):
        SweepPlan.model_validate(plan)


@pytest.mark.parametrize("name", SENSOR_PRESETS)
def test_every_preset_runs(name):
    words = ["hearing=ideal", f"ultrasonic.preset={name}", "duration_s=2"]
    result = simulate(load_scenario("two_static_obstacles", words))
    assert result.simulated_s == pytest.approx(2.0)
    assert f"range_{sensors(name).count}" in result.columns
