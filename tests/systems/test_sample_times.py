"""When blocks act: from the start on, every 25 ms (Han 2019, 4.1) or as told."""

from __future__ import annotations

import inspect
from typing import Any

import pytest
from pydrake.systems.framework import LeafSystem

import systems
from systems.ranging.parameters import UltrasonicParameters
from systems.sound.parameters import MicArrayParameters

pytestmark = pytest.mark.drake

IN_TURN = UltrasonicParameters(firing="sequential")
SAMPLED: dict[str, dict[str, Any]] = {
    "CollisionVector": {"sensors": IN_TURN},
    "GlobalPlanner": {},
    "IdealObjectSensor": {},
    "IdealSourceSensor": {},
    "ImpedanceAdaptation": {},
    "MicArray": {},
    "MotionGuard": {},
    "ObjectDetector": {},
    "PathTarget": {},
    "ReferenceModel": {},
    "SafetyFilter": {},
    "SoundEmitter": {},
    "SourceTracker": {},
    "TDOAEstimator": {},
    "UltrasonicArray": {"parameters": IN_TURN},
    "WheelCommand": {},
    "WheelOdometry": {},
    "WheelSpeedCommand": {},
    "CrossPowerEstimator": {},
    "GasSensorArray": {},
    "MotorDriver": {},
    "OdorPlume": {},
    "PlumeSearch": {},
    "RadioChannel": {},
    "RadioRange": {},
    "SinkMonitor": {"robots": {"nose": 1}},
    "SoundSearch": {},
    "WindField": {},
}
# The state of the laws that plan is one of arrays, which Drake updates otherwise. The
# laws that only stop, or are only pulled and pushed, have no state.
LAWS = {
    name
    for name in systems.__all__
    if name.endswith("Controller") and inspect.isclass(getattr(systems, name))
} - {
    "DynamicWindowController",
    "GuardedController",
    "PathIntegralController",
    "StopWhenNearController",
    "TrajectoryImpedanceController",
}


@pytest.mark.parametrize("name", sorted(SAMPLED.keys() | LAWS))
def test_sampled_every_frame_from_the_start_on(name):
    block = getattr(systems, name)(**SAMPLED.get(name, {}))
    timing = block.GetUniquePeriodicDiscreteUpdateAttribute()
    assert timing is not None
    assert (timing.period_sec(), timing.offset_sec()) == (0.025, 0.0)


SLOW = MicArrayParameters(frame_s=0.1)
TOLD: dict[str, dict[str, Any]] = {
    name: {"tick_s": 0.0125} for name in SAMPLED.keys() | LAWS
} | {
    "IdealSourceSensor": {"frame_s": 0.1},
    "MicArray": {"parameters": SLOW},
    "TDOAEstimator": {"microphones": SLOW},
    "CrossPowerEstimator": {"microphones": SLOW},
}


@pytest.mark.parametrize("name", sorted(TOLD))
def test_sampled_as_told(name):
    block = getattr(systems, name)(**SAMPLED.get(name, {}) | TOLD[name])
    timing = block.GetUniquePeriodicDiscreteUpdateAttribute()
    expected = 0.0125 if "tick_s" in TOLD[name] else 0.1
    assert (timing.period_sec(), timing.offset_sec()) == (expected, 0.0)


def test_other_blocks_are_functions_of_now():
    sampled = {
        name
        for name in systems.__all__
        if inspect.isclass(block := getattr(systems, name))
        and issubclass(block, LeafSystem)
        and block is not systems.Block
        and block(**SAMPLED.get(name, {})).GetUniquePeriodicDiscreteUpdateAttribute()
    }
    assert sampled == SAMPLED.keys() | LAWS
