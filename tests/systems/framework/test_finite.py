"""No block takes NaN or infinity: it says which port brought which, and stops."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator_
from pydrake.systems.framework import LeafSystem, LeafSystem_, PortDataType

import systems
from systems.base.parameters import PlantParameters
from systems.framework.finite import check_finite, read_arrays, read_lists
from systems.framework.signals import (
    FRAME_SAMPLES,
    SAMPLE_RATE_HZ,
    TICK_S,
    AudioFrame,
    Emission,
)
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.free_space import make_free_space
from systems.safety.parameters import GuardParameters
from systems.sound.adc import convert
from systems.sound.parameters import MicArrayParameters, SoundParameters
from systems.sound.sound_emitter import make_emission

NOT_FINITE = (math.nan, math.inf, -math.inf)
# Each once as it is, and in each way that reads its ports differently.
BLOCKS: dict[str, tuple[dict[str, Any], ...]] = {
    name: ({},)
    for name in systems.__all__
    if name != "WheelSpeedCommand"  # another name of WheelCommand
    and inspect.isclass(block := getattr(systems, name))
    and issubclass(block, LeafSystem)
    and block is not systems.Block
} | {
    # Fired at once, it reads neither ages nor pose.
    "CollisionVector": ({"sensors": UltrasonicParameters(firing="sequential")},),
    # With wheel errors it keeps what lies under the body.
    "FreeSpaceMap": (
        {},
        {"parameters": GuardParameters(wheel_error=0.01, place_error_m=0.03)},
    ),
    "IdealObstacleSensor": ({"obstacle_count": 2},),
    "MicArray": ({}, {"others": ["radio"]}),
    "ReciprocalAvoidanceController": ({"bodies": 2},),
    "UltrasonicArray": (
        {"obstacle_count": 2},
        {"obstacle_count": 2, "parameters": UltrasonicParameters(firing="sequential")},
    ),
    "WheelOdometry": ({}, {"plant": PlantParameters(pulses_per_revolution=None)}),
}
CASES = [(name, config) for name, configs in BLOCKS.items() for config in configs]


def emission() -> Emission:
    waveform = np.ones(50_000, dtype=np.float32)
    path = np.zeros((2, 6, 2)) + 0.5
    return make_emission(0.0, waveform, SoundParameters(start_s=0.0), *path)


def audio(channels: int = 3) -> AudioFrame:
    counts = np.zeros((channels, FRAME_SAMPLES), dtype=np.int16)
    return AudioFrame(counts, 512, float(SAMPLE_RATE_HZ), 0.0)


def fix(block: Any, context: Any, port: Any, value: Any) -> None:
    if port.get_data_type() == PortDataType.kAbstractValued:
        port.FixValue(context, Value[object](value))
    elif isinstance(block, LeafSystem_[AutoDiffXd]):
        seed: Any = np.ones(1)
        port.FixValue(context, np.array([AutoDiffXd(v, seed) for v in value]))
    else:
        port.FixValue(context, np.array(value))


def good_value(port: Any, level: float) -> Any:
    if port.get_name() == "free_space":
        return make_free_space(100, 0.05, 3, 17)
    if port.get_data_type() == PortDataType.kAbstractValued:
        heard = audio(4 if port.get_system().HasInputPort("listening") else 3)
        return heard if port.get_name() == "audio" else emission()
    if port.get_name() == "listening":
        level += 1.0
    if port.get_name() == "range_ages":
        level *= TICK_S
    return [level] * port.size()


def spoilt(good: Any, bad: float) -> Iterator[tuple[str, Any]]:
    """Elements of a vector, or the ends of every field of a signal, in turn.

    Of a vector of more than 60 elements, which is checked as a whole, 60 with its ends.
    """
    if isinstance(good, list):
        chosen = np.linspace(0, len(good) - 1, min(len(good), 60)).astype(int)
        for k in chosen.tolist():
            yield f"[{k}]", [*good[:k], bad, *good[k + 1 :]]
        return
    for name, field in good._asdict().items():
        if not isinstance(field, np.ndarray):
            if not isinstance(field, bool):
                yield f".{name}", good._replace(**{name: bad})
            continue
        for place in (0, field.size - 1):
            kind = np.result_type(field, np.float32)
            values = np.array(field, dtype=kind)
            values.flat[place] = bad
            index = ", ".join(map(str, np.unravel_index(place, field.shape)))
            yield f".{name}[{index}]", good._replace(**{name: values})


def injections(block: Any, level: float) -> Iterator[tuple[Any, str, Any]]:
    """A context with one input that is not finite, and that input's name.

    Space that is known for ever is so up to an infinite way: no fault of the map.
    """
    ports = [block.get_input_port(i) for i in range(block.num_input_ports())]
    for port in ports:
        if port.get_name() == "free_space":
            continue
        for bad in NOT_FINITE:
            for element, value in spoilt(good_value(port, level), bad):
                context = block.CreateDefaultContext()
                for other in ports:
                    fix(block, context, other, good_value(other, level))
                fix(block, context, port, value)
                yield context, f"{port.get_name()}{element}", bad


def exercise(block: Any, context: Any) -> int:
    """All that a block ever computes: outputs, updates, derivatives.

    Returns:
        How many outputs there are.
    """
    for k in range(block.num_output_ports()):
        block.get_output_port(k).Eval(context)
    if context.num_continuous_states():
        block.EvalTimeDerivatives(context)
        return block.num_output_ports()
    scalar = AutoDiffXd if isinstance(block, LeafSystem_[AutoDiffXd]) else float
    Simulator_[scalar](block, context).AdvanceTo(1e-3)
    return block.num_output_ports()


def swallowed(block: Any, name: str) -> list[str]:
    """What the block takes without a word, or with words that do not say what."""
    silent, tried = [], 0
    for level in (0.0, 1.0):
        for context, place, bad in injections(block, level):
            tried += 1
            start = f"{name}: {place} is {bad} at 0 s, "
            try:
                exercise(block, context)
            except (ValueError, OverflowError) as error:
                if str(error).startswith(start) and len(str(error)) <= 300:
                    continue
            silent.append(f"{place} = {bad} among {level}")
    ports = [block.get_input_port(i) for i in range(block.num_input_ports())]
    numbers = [port for port in ports if port.get_name() != "free_space"]
    assert tried >= 2 * len(NOT_FINITE) * len(numbers)
    return silent


@pytest.mark.drake
@pytest.mark.parametrize(("name", "config"), CASES)
def test_no_block_swallows_what_is_not_finite(name: str, config: Any) -> None:
    assert swallowed(getattr(systems, name)(**config), name) == []


@pytest.mark.drake
@pytest.mark.parametrize(
    ("name", "config"),
    [
        (name, config)
        for name, config in CASES
        if hasattr(systems, f"{name}_")
        and (name != "WheelOdometry" or "odometry" in config)
    ],
)
def test_nor_does_it_where_it_is_differentiated(name: str, config: Any) -> None:
    block = getattr(systems, name)(**config).ToAutoDiffXd()
    assert swallowed(block, name) == []


@pytest.mark.parametrize(("name", "config"), CASES)
def test_what_is_finite_passes(name: str, config: Any) -> None:
    """Else the tests above would pass with blocks that refuse everything.

    Not repeated with the newest Drake: what all blocks compute is compiled for it.
    """
    block = getattr(systems, name)(**config)
    for level in (0.0, 1.0):
        context = block.CreateDefaultContext()
        for i in range(block.num_input_ports()):
            port = block.get_input_port(i)
            fix(block, context, port, good_value(port, level))
        assert exercise(block, context) > 0


@pytest.mark.drake
@pytest.mark.parametrize("read", [read_lists, read_arrays])
def test_a_sum_that_overflows_is_no_reason_to_refuse(read: Any) -> None:
    block = systems.WheelCommand()
    context = block.CreateDefaultContext()
    ports = [block.GetInputPort(n) for n in ("acceleration_W", "pose_WB_estimated")]
    for port in ports:
        port.FixValue(context, np.full(port.size(), 1e308))
    assert [len(values) for values in read(context, ports)] == [2, 3]


@pytest.mark.drake
def test_infinities_of_both_signs_do_not_cancel() -> None:
    block = systems.CollisionVector()
    context = block.CreateDefaultContext()
    block.GetInputPort("ranges").FixValue(context, [math.inf, -math.inf, 1.0])
    block.GetInputPort("echo").FixValue(context, np.zeros(3))
    with pytest.raises(ValueError, match=r"^CollisionVector: ranges\[0\] is inf at "):
        block.GetOutputPort("mask").Eval(context)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda bad: systems.DiffDrivePlant(initial_pose=(0.0, bad, 0.0)),
            "DiffDrivePlant: initial_pose[1]",
        ),
        (
            lambda bad: systems.WheelOdometry(initial_pose=(0.0, 0.0, bad)),
            "WheelOdometry: initial_pose[2]",
        ),
        (
            lambda bad: systems.SoundEmitter(maximum_range_m=bad),
            "SoundEmitter: maximum_range_m",
        ),
        (
            lambda bad: systems.IdealObstacleSensor(maximum_range_m=bad),
            "IdealObstacleSensor: maximum_range_m",
        ),
        (
            lambda bad: systems.IdealObstacleSensor(source_size=(0.3, bad)),
            "IdealObstacleSensor: source_size[1]",
        ),
        (
            lambda bad: systems.UltrasonicArray(source_size=(bad, 0.3)),
            "UltrasonicArray: source_size[0]",
        ),
        (
            lambda bad: systems.SourceTracker(measurement_age_s=bad),
            "SourceTracker: measurement_age_s",
        ),
    ],
)
@pytest.mark.parametrize("bad", NOT_FINITE)
def test_constructors_refuse_what_is_not_finite(
    make: Any, message: str, bad: float
) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(message)} is {bad}; "):
        make(bad)


@pytest.mark.drake
@pytest.mark.parametrize("name", ["POSITION_ERRORS", "CHANNEL_DELAYS", "GAINS"])
@pytest.mark.parametrize("bad", NOT_FINITE)
def test_numeric_parameters_of_a_trial_are_finite(name: str, bad: float) -> None:
    block = systems.MicArray()
    context = block.CreateDefaultContext()
    fix(block, context, block.GetInputPort("emission"), emission())
    for port in ("pose_WB", "velocity_WB"):
        block.GetInputPort(port).FixValue(context, np.zeros(3))
    group = context.get_mutable_numeric_parameter(getattr(block, name))
    group.SetAtIndex(1, bad)
    with pytest.raises(ValueError, match=rf"^MicArray: {name}\[1\] is {bad}; "):
        block.GetOutputPort("audio").Eval(context)


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_the_converter_makes_no_counts_of_what_is_not_finite(bad: float) -> None:
    good, spoilt = np.zeros((2, 3, 20), dtype=np.float32)
    spoilt[2, 9] = bad
    for pressure, noise, name in (
        (spoilt, good, "pressure"),
        (good, spoilt, "noise"),
        (None, spoilt, "noise"),
    ):
        with pytest.raises(ValueError, match=rf"^MicArray: {name}\[2, 9\] is {bad};"):
            convert(pressure, noise, 0.001, MicArrayParameters())


def test_the_converter_names_a_gain() -> None:
    noise = np.ones((2, 20), dtype=np.float32)
    gains = np.array([1.0, math.nan])
    with pytest.raises(ValueError, match=r"^MicArray: gains\[1\] is nan"):
        convert(None, noise, 0.001, MicArrayParameters(), gains)


@pytest.mark.drake
@pytest.mark.parametrize("bad", NOT_FINITE)
def test_the_plant_names_a_state_that_is_not_finite(bad: float) -> None:
    block = systems.DiffDrivePlant()
    context = block.CreateDefaultContext()
    block.GetInputPort("wheel_speeds").FixValue(context, np.zeros(2))
    context.SetContinuousState([0.0, 0.0, 0.0, bad, 0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=rf"^DiffDrivePlant: state\[3\] is {bad}; "):
        block.EvalTimeDerivatives(context)


def test_names_and_places() -> None:
    check_finite("A: numbers", [[0.0, 1.0], [2.0, 3.0]])
    with pytest.raises(ValueError, match=r"^A: numbers\[1, 0\] is nan; give a finite"):
        check_finite("A: numbers", [[0.0, 1.0], [math.nan, math.inf]])
    with pytest.raises(ValueError, match=r"^A: number is inf; give a finite number$"):
        check_finite("A: number", math.inf)
