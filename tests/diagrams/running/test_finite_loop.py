"""A run with NaN on any wire stops at the next tick; the robot does not drive on."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from pydrake.common.value import Value

import systems.framework.noise
import systems.sound.recorder
from diagrams import build_sound_follower, load_scenario, make_simulator, simulate
from diagrams.building.builder import SoundFollower
from systems.framework.signals import TICK_S, AudioFrame, Emission

pytestmark = pytest.mark.drake

BUILDS = {
    "audio": (),
    "ideal": ("hearing=ideal", "obstacle_sensing=ideal"),
    "in turn": ("hearing=ideal", "ultrasonic.firing=sequential"),
}
#: Not read where the sensors fire at once.
UNREAD = [("collision", "range_ages"), ("collision", "pose_WB_estimated")]
# The source sounds then, so that every block has something to do.
SPOILT_AT_S = 0.3
FOLLOWERS: dict[str, SoundFollower] = {}


def built(build: str) -> SoundFollower:
    """One diagram for all runs of a kind: Drake never frees them."""
    if build not in FOLLOWERS:
        words = ("sound.start_s=0", *BUILDS[build])
        scenario = load_scenario("two_moving_obstacles", words)
        FOLLOWERS[build] = build_sound_follower(scenario, log=True)
    return FOLLOWERS[build]


def wires() -> list[tuple[str, str, str]]:
    """(build, role, port) of every input of every block that reads it."""
    return [
        (build, role, name)
        for build in BUILDS
        for role, block in built(build).blocks.items()
        for k in range(block.num_input_ports())
        if ((name := block.get_input_port(k).get_name()) and (role, name) not in UNREAD)
        or build == "in turn"
    ]


def spoilt(value: Any, bad: float) -> tuple[str, Any]:
    """The value with its last number gone bad, and the place of that."""
    if isinstance(value, Emission):
        samples = value.samples.copy()
        samples[-1] = bad
        place = f".samples[{len(samples) - 1}]"
        return place, Value[object](value._replace(samples=samples))
    if isinstance(value, AudioFrame):
        counts: Any = value.counts.astype(np.float32)
        counts[-1, -1] = bad
        place = f".counts[{counts.shape[0] - 1}, {counts.shape[1] - 1}]"
        return place, Value[object](value._replace(counts=counts))
    numbers = np.array(value, dtype=float)
    numbers[-1] = bad
    return f"[{len(numbers) - 1}]", numbers


@pytest.mark.parametrize(("build", "role", "name"), wires())
def test_a_wire_that_goes_bad_stops_the_run(build: str, role: str, name: str) -> None:
    follower = built(build)
    block = follower.blocks[role]
    port = block.GetInputPort(name)
    for bad in (math.nan, math.inf):
        simulator = make_simulator(follower)
        simulator.AdvanceTo(SPOILT_AT_S)
        context = block.GetMyContextFromRoot(simulator.get_mutable_context())
        place, value = spoilt(port.Eval(context), bad)
        port.FixValue(context, value)  # takes the place of the wire
        kind = type(block).__name__.split("_")[0]
        message = f"^{kind}: {re.escape(name + place)} is {bad} at "
        with pytest.raises(ValueError, match=message):
            simulator.AdvanceTo(SPOILT_AT_S + 2.0 * TICK_S)


def test_noise_of_the_microphones_that_goes_bad_stops_the_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    follower = built("audio")
    make = systems.framework.noise.frame_noise

    def broken(shape: tuple[int, int], seed: int, tick: int) -> Any:
        noise = make(shape, seed, tick)
        noise[1, 100] = math.nan if tick == 20 else noise[1, 100]
        return noise

    simulate(follower.scenario.model_copy(update={"duration_s": 0.1}))
    monkeypatch.setattr(systems.sound.recorder, "frame_noise", broken)
    with pytest.raises(ValueError, match=r"^MicArray: noise\[1, 100\] is nan"):
        simulate(follower.scenario, follower=follower)
