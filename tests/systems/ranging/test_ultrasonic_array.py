"""Range finders: cones in closed form, limits, noise, order of firing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from phonotaxis.testing import Bench, evaluate
from systems.ranging.parameters import UltrasonicParameters
from systems.ranging.ultrasonic_array import UltrasonicArray
from systems.sound.acoustics import sound_speed

QUIET = UltrasonicParameters.model_validate({"noise_m": 0.0})
FAR = [50.0, 0.0, 0.0]


def make_array(parameters=QUIET, **settings) -> UltrasonicArray:
    return UltrasonicArray(parameters=parameters, obstacle_count=1, **settings)


def wall_ahead(distance: float, *, pose_WB=(0.0, 0.0, 0.0)) -> dict[str, Any]:
    """Inputs for a long wall at a distance ahead of P."""
    x, y, theta = pose_WB
    ahead = 0.175 + distance + 0.5
    pose = [x + ahead * math.cos(theta), y + ahead * math.sin(theta), theta]
    sizes = [1.0, 30.0, 0.0]
    return {"pose_WB": pose_WB, "poses_WO": pose, "sizes": sizes, "pose_WS": FAR}


@pytest.mark.parametrize("pose_WB", [(0.0, 0.0, 0.0), (-1.0, 2.0, 2.5)])
def test_wall_across_the_path(pose_WB):
    """The side cones see the wall along their inner borders, 15 deg off."""
    outputs = evaluate(make_array(), **wall_ahead(1.2, pose_WB=pose_WB))
    side = 1.2 / math.cos(math.radians(15))
    np.testing.assert_allclose(outputs["ranges"], [side, 1.2, side])
    np.testing.assert_array_equal(outputs["echo"], [1, 1, 1])


def test_left_sensor_comes_first():
    left = [0.175 + math.cos(math.pi / 6), math.sin(math.pi / 6), math.pi / 6]
    outputs = evaluate(
        make_array(),
        pose_WB=[0, 0, 0],
        poses_WO=left,
        sizes=[0.2, 0.2, 0.0],
        pose_WS=FAR,
    )
    np.testing.assert_array_equal(outputs["echo"], [1, 0, 0])
    assert outputs["ranges"][0] == pytest.approx(0.9)


def test_master_robot_is_seen():
    outputs = evaluate(
        make_array(source_size=(0.326, 0.352)),
        pose_WB=[0, 0, 0],
        poses_WO=FAR,
        sizes=[0.1, 0.1, 0.0],
        pose_WS=[1.5, 0.0, 0.0],
    )
    assert outputs["ranges"][1] == pytest.approx(1.5 - 0.163 - 0.175)


def test_each_of_several_boxes_is_seen():
    """Three in a row ahead; each is the nearest when the ones before it are away."""
    sizes = [0.2, 0.3, 0.0, 0.4, 0.5, 0.0, 0.6, 0.7, 0.0]
    faces = [1.0 - 0.1, 1.5 - 0.2, 2.0 - 0.3]
    block = UltrasonicArray(parameters=QUIET, obstacle_count=3)
    for gone, face in enumerate(faces):
        places = np.array([[1.0, 0.0, 0.0], [1.5, 0.0, 0.0], [2.0, 0.0, 0.0]])
        places[:gone, 0] += 40.0
        outputs = evaluate(
            block, pose_WB=[0] * 3, poses_WO=places.ravel(), sizes=sizes, pose_WS=FAR
        )
        assert outputs["ranges"][1] == pytest.approx(face - 0.175)


@pytest.mark.parametrize(
    ("distance", "reading", "echo"),
    [
        (2.99, 2.99, 1),
        (3.01, 3.0, 0),
        (0.03, 0.03, 1),
        (0.01, 0.03, 1),
        (-0.2, 0.03, 1),
    ],
)
def test_limits(distance, reading, echo):
    """Nothing near enough is no echo; too near, inside even, reads 3 cm."""
    outputs = evaluate(make_array(), **wall_ahead(distance))
    assert outputs["ranges"][1] == pytest.approx(reading)
    assert outputs["echo"][1] == echo


def test_time_of_flight_at_the_true_speed_of_sound():
    """Sensors that assume 340 m/s in air of 25 deg C (346.5 m/s) read short."""
    warm = sound_speed(25.0)
    array = make_array(sound_speed_m_s=warm, assumed_sound_speed_m_s=340.0)
    outputs = evaluate(array, **wall_ahead(1.2))
    assert outputs["ranges"][1] == pytest.approx(1.2 * 340.0 / 346.5)
    outputs = evaluate(make_array(sound_speed_m_s=warm), **wall_ahead(1.2))
    assert outputs["ranges"][1] == pytest.approx(1.2)


def readings(parameters, ticks: int, *, seed: int = 3) -> np.ndarray:
    at = Bench(make_array(parameters, seed=seed), **wall_ahead(1.0))
    rows = []
    for tick in range(ticks):
        at.context.SetTime(tick * 0.025)
        rows.append(np.r_[at.output("ranges"), at.output("echo")])
    return np.array(rows)


def test_noise_has_the_set_deviation():
    noisy = readings(UltrasonicParameters.model_validate({"noise_m": 0.02}), 1500)[
        :, :3
    ]
    side = 1.0 / math.cos(math.radians(15))
    errors = noisy - [side, 1.0, side]
    # Five standard errors of a mean and of a deviation from 4500 draws.
    assert abs(errors.mean()) < 5 * 0.02 / math.sqrt(4500)
    assert errors.std() == pytest.approx(0.02, rel=5 / math.sqrt(2 * 4500))
    correlation = np.corrcoef(errors.T)[np.triu_indices(3, 1)]
    assert np.all(np.abs(correlation) < 5 / math.sqrt(1500))


def test_dropouts_come_at_the_set_rate():
    rows = readings(
        UltrasonicParameters.model_validate({"dropout_probability": 0.3}), 1500
    )
    echo = rows[:, 3:]
    assert (1 - echo).mean() == pytest.approx(0.3, abs=5 * math.sqrt(0.21 / 4500))
    np.testing.assert_array_equal(rows[:, :3][echo == 0], 3.0)


def test_seed_decides_the_noise():
    parameters = UltrasonicParameters.model_validate({"noise_m": 0.02})
    first, again = (readings(parameters, 20) for _ in range(2))
    other = readings(parameters, 20, seed=4)
    np.testing.assert_array_equal(first, again)
    assert not np.any(first[:, :3] == other[:, :3])


def test_sensors_fire_one_after_the_other():
    parameters = UltrasonicParameters.model_validate(
        {"noise_m": 0.0, "firing": "sequential"}
    )
    at = Bench(make_array(parameters), **wall_ahead(1.0))
    side = 1.0 / math.cos(math.radians(15))
    expected = [
        ([side, 3.0, 3.0], [1, 0, 0]),
        ([side, 1.0, 3.0], [1, 1, 0]),
        ([side, 1.0, side], [1, 1, 1]),
    ]
    for ranges, echo in expected:
        np.testing.assert_allclose(at.output("ranges"), ranges)
        np.testing.assert_array_equal(at.output("echo"), echo)
        at.tick()


def test_a_sensor_keeps_its_reading_until_it_fires_again():
    parameters = UltrasonicParameters.model_validate(
        {"noise_m": 0.0, "firing": "sequential"}
    )
    at = Bench(make_array(parameters), **wall_ahead(1.0)).tick().tick().tick()
    nearer = wall_ahead(0.5)
    at.set(poses_WO=nearer["poses_WO"])
    side = 1.0 / math.cos(math.radians(15))
    np.testing.assert_allclose(at.output("ranges"), [side / 2, 1.0, side])
    at.tick()
    np.testing.assert_allclose(at.output("ranges"), [side / 2, 0.5, side])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"minimum_range_m": 3.0}, "minimum_range_m: 3.0 must be below"),
        (
            {"sensors": [{"axis_deg": 0.0}, {"axis_deg": 30.0}]},
            "sensors.1.axis_deg: .* from left to right",
        ),
        ({"beam_half_angle_deg": 90.0}, "less than 90"),
        ({"dropout_probability": 1.5}, "less than or equal to 1"),
    ],
)
def test_impossible_sensors_are_refused(settings, message):
    with pytest.raises(ValidationError, match=message):
        UltrasonicParameters.model_validate(settings)
