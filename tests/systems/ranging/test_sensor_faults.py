"""Sensors that fail as their kind says, from then on, and alone."""

from __future__ import annotations

import numpy as np
import pytest

from diagrams import load_scenario, simulate
from systems.framework.faults import FROZEN, LOST, Fault, fault_ticks
from systems.framework.input_error import InputError

BEGIN = 40  # tick at 1 s
SETTINGS = (
    "hearing=ideal",
    "duration_s=3",
    "ultrasonic.firing=sequential",
)


def log(*overrides, engine="compiled"):
    settings = [*SETTINGS, *overrides]
    return simulate(load_scenario("two_static_obstacles", settings), engine=engine)


def readings(run):
    return {
        f"{name}_{k}": run.columns[f"{name}_{k}"]
        for k in (1, 2, 3)
        for name in ("range", "echo")
    }


@pytest.fixture(scope="module")
def sound():
    return log("obstacles.0.waypoints_m=[[1.6,0]]")


@pytest.mark.parametrize("kind", ["silent", "blind", "frozen", "noisy"])
def test_it_fails_from_then_on_and_the_others_do_not(sound, kind):
    fault = f"faults=[{{sensor: ultrasonic, number: 2, kind: {kind}, start_s: 1}}]"
    place = "obstacles.0.waypoints_m=[[1.6,0]]"
    runs = [log(place, fault, engine=engine) for engine in ("compiled", "drake")]
    for name, values in readings(runs[0]).items():
        np.testing.assert_allclose(readings(runs[1])[name], values, atol=1e-9)
    failed, healthy = readings(runs[0]), readings(sound)
    assert failed.keys() == healthy.keys()
    for name, values in failed.items():
        np.testing.assert_array_equal(values[:BEGIN], healthy[name][:BEGIN])
    assert (healthy["echo_2"][3:BEGIN] == 1.0).all()
    middle = failed["range_2"]
    for name in ("range_1", "echo_1", "range_3", "echo_3"):
        np.testing.assert_allclose(
            failed[name][: BEGIN + 4], healthy[name][: BEGIN + 4], atol=0.05
        )
    late = middle[BEGIN + 3 :]
    if kind == "blind":
        assert not failed["echo_2"][BEGIN + 3 :].any()
    elif kind == "noisy":
        assert 0.1 < np.std(np.diff(late[::3])) < 0.9
    else:
        assert (late == middle[BEGIN - 1]).all()


@pytest.mark.parametrize(
    ("faults", "field", "told"),
    [
        ("{sensor: ultrasonic, number: 4, kind: blind}", "faults.0.number", "4 is not"),
        ("{sensor: ultrasonic, kind: dead}", "faults.0.kind", "silent or blind"),
        ("{sensor: gas_sensors, kind: dead}", "faults.0.sensor", "not a sensor of"),
        ("{sensor: lidar, kind: dead}", "faults.0.sensor", "'microphones'"),
        ("{sensor: odometry}", "faults.0.kind", "missing"),
        (
            "{sensor: odometry, kind: lost}, {sensor: odometry, kind: lost}",
            "faults.1.number",
            "has two faults",
        ),
    ],
)
def test_faults_that_cannot_be_are_named(faults, field, told):
    with pytest.raises(InputError, match=told) as error:
        load_scenario("default", [f"faults=[{faults}]"])
    assert error.value.field == field


def test_a_robot_may_have_faults_of_its_own():
    robots = "robots={one: {}, two: {start: {position_m: [-2, -1]}, faults: [{sensor: "
    settings = [robots + "odometry, kind: lost}]}}", *SETTINGS]
    one, two = load_scenario("default", settings).robots.values()
    assert one.faults == ()
    assert two.faults == (Fault(sensor="odometry", kind="lost"),)


def test_several_kinds_of_sensors_share_one_list():
    """Each kind finds its own; the first tick is that of the start."""
    faults = (
        Fault(sensor="ultrasonic", number=2, kind="frozen", start_s=1.0),
        Fault(sensor="odometry", kind="lost", start_s=0.5),
    )
    assert fault_ticks(faults, "ultrasonic", 3, 0.025).tolist() == [
        [0, 0],
        [FROZEN, 40],
        [0, 0],
    ]
    assert fault_ticks(faults, "odometry", 1, 0.025).tolist() == [[LOST, 20]]
    assert not fault_ticks(faults, "gas_sensors", 3, 0.025).any()
