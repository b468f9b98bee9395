"""Any number of range sensors: rings, sets with gaps, and what joins across them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from diagrams import load_scenario, simulate
from systems import CollisionVector
from systems.ranging.collision_vector import collision_vectors, echo_points
from systems.ranging.parameters import CollisionVectorParameters, UltrasonicParameters
from systems.ranging.ultrasonic_array import cone_ranges

SIX = UltrasonicParameters.model_validate({"preset": "six"})


def along(*axes: float) -> list[dict[str, float]]:
    return [{"axis_deg": axis} for axis in axes]


def sensors(**fields: Any) -> UltrasonicParameters:
    return UltrasonicParameters.model_validate({"noise_m": 0.0, **fields})


@pytest.mark.parametrize("count", [1, 2, 5, 12, 36])
def test_a_ring_looks_all_around_and_once_ahead(count):
    ring = sensors(sensors=count)
    assert ring.count == count
    steps = -np.diff([*ring.axes_deg, ring.axes_deg[0] - 360.0])
    np.testing.assert_allclose(steps, 360.0 / count)
    assert 180.0 in ring.axes_deg


def test_a_ring_of_even_number_has_one_ahead():
    assert 0.0 in sensors(sensors=8).axes_deg


@pytest.mark.parametrize(
    ("listed", "neighbors"),
    [
        (along(30.0, 0.0, -30.0), {(0, 1), (1, 2)}),
        (along(*SIX.axes_deg), {(0, 1), (1, 2), (3, 4), (4, 5)}),
        (4, {(0, 1), (1, 2), (2, 3), (3, 0)}),
        (3, set()),
        (along(0.0), set()),
    ],
)
def test_neighbors_are_next_to_one_another_and_not_far(listed, neighbors):
    assert set(sensors(sensors=listed).neighbors) == neighbors


def test_a_thin_ring_measures_a_round_of_walls():
    """36 beams of a degree from the middle of a room of 4 m: closed form."""
    walls = np.array(
        [
            [2.5, 0.0, 0.0, 1.0, 8.0, 0.0],
            [-2.5, 0.0, 0.0, 1.0, 8.0, 0.0],
            [0.0, 2.5, 0.0, 8.0, 1.0, 0.0],
            [0.0, -2.5, 0.0, 8.0, 1.0, 0.0],
        ]
    )
    lidar = sensors(sensors=36, beam_half_angle_deg=0.5)
    found = cone_ranges([0.0, 0.0, 0.0], walls, lidar, 0.0)
    # The nearest point within the beam is at its edge nearer to the wall's foot.
    directions = np.radians(np.array(lidar.axes_deg))
    away = np.abs((directions + math.pi / 4) % (math.pi / 2) - math.pi / 4)
    nearest = np.maximum(away - math.radians(0.5), 0.0)
    np.testing.assert_allclose(found, 2.0 / np.cos(nearest), rtol=1e-9)


def test_echoes_to_both_sides_of_the_back_are_joined():
    """Of twelve, the first (180 deg) and the last (-150 deg) are neighbors."""
    ring = sensors(sensors=12)
    ranges, echo = np.full(12, 3.0), np.zeros(12)
    ranges[[0, 11]], echo[[0, 11]] = 0.5, 1.0
    points = echo_points(ranges, echo, ring)
    parameters = CollisionVectorParameters()
    ((feature, x, y),) = collision_vectors(points, parameters, ring.neighbors)
    assert feature == 24.0, "12 + the twelfth sensor and its right neighbor"
    middle = math.radians(-165.0)
    distance = 0.5 * math.cos(math.radians(15.0))
    assert (x, y) == pytest.approx(
        (distance * math.cos(middle), distance * math.sin(middle))
    )


def test_of_many_vectors_the_nearest_three_are_kept():
    points = [(float(5 - k), 0.0) for k in range(5)]
    found = collision_vectors(
        points, CollisionVectorParameters(aggregation="sum"), neighbors=()
    )
    assert found == [(5.0, 1.0, 0.0), (4.0, 2.0, 0.0), (3.0, 3.0, 0.0)]


def test_the_block_has_ports_for_its_sensors():
    block = CollisionVector(sensors=SIX)
    assert block.GetInputPort("ranges").size() == 6
    assert block.GetOutputPort("collision_vectors_B").size() == 6


def test_the_back_is_defended_by_sensors_that_look_back():
    """A source too near pushes the robot back: into a box that three do not see."""
    scenario = [
        "hearing=ideal",
        "law=conventional",
        "attraction={stiffness_n_m: 4, damping_n_s_m: 8}",
        "source.waypoints_m=[[0.8, 0.0]]",
        "obstacles=[{name: box, size_m: [0.2, 2.0], waypoints_m: [[-0.775, 0.0]]}]",
        "duration_s=6",
    ]
    three = simulate(load_scenario("default", scenario))
    assert three.cause == "collision"
    six = simulate(load_scenario("default", [*scenario, "ultrasonic.preset=six"]))
    assert six.collision is None
    assert six.columns["range_5"][0] == pytest.approx(0.5, abs=0.01)
    assert {"range_6", "echo_6"} <= set(six.columns)


@pytest.mark.parametrize("firing", ["simultaneous", "sequential"])
def test_a_ring_runs(firing):
    ring = ["hearing=ideal", "ultrasonic.sensors=8", f"ultrasonic.firing={firing}"]
    result = simulate(load_scenario("default", [*ring, "duration_s=3"]))
    assert result.simulated_s == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"sensors": 0}, "0 sensors; use 1 to 360"),
        ({"sensors": 361}, "361 sensors"),
        ({"sensors": []}, "0 sensors"),
        ({"sensors": along(30.0, 30.0)}, r"sensors\.1\.axis_deg: 30 must be below 30"),
        ({"sensors": along(180.0, 0.0, -180.0)}, "is a turn or more"),
        ({"sensors": {"3": {"noise_m": 0.1}}}, r"sensors\.3: is not one of 3 sensors"),
        ({"sensors": {"1": {"noise_m": -1.0}}}, r"sensors\.1\.noise_m"),
        ({"sensors": [{"axis": 1.0}]}, r"sensors\.0\.axis"),
        ({"noise_m": -1.0}, "noise_m: is -1.0; input should be greater"),
        ({"axes_deg": (10.0, -10.0), "positions_m": ((0, 0),) * 3}, "3 positions for"),
        ({"preset": "five"}, "'ring_8', 'ring_12', 'lidar', 'lidar_270' or 'scan_7'"),
        ({"preset": ["six"]}, "'three', 'six'"),
    ],
)
def test_bad_sets(fields, message):
    with pytest.raises(ValidationError, match=message):
        UltrasonicParameters.model_validate(fields)
