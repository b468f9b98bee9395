"""Sensors that fail as their kind says, from then on, and alone."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from systems.ranging.sensor_faults import SensorFaultParameters

from diagrams import load_scenario, simulate
from systems.framework.input_error import InputError
from systems.ranging.parameters import UltrasonicParameters

BEGIN_S, BEGIN = 1.0, 40
SETTINGS = (
    "hearing=ideal",
    "duration_s=3",
    "ultrasonic.axes_deg=[30,0,-30]",
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
    fault = f"ultrasonic.faults=[{{sensor: 2, kind: {kind}, start_s: {BEGIN_S}}}]"
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


def test_a_sensor_that_is_not_there_is_named():
    with pytest.raises((InputError, ValidationError), match=r"faults\.0\.sensor.*4"):
        UltrasonicParameters(faults=(SensorFaultParameters(sensor=4),))
