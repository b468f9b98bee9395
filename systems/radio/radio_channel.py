"""The radio channel between the robots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.signals import TICK_S
from systems.radio.codec import FRAME_BYTES, FRAMES_SIZE, MOST_FRAMES
from systems.radio.parameters import RadioParameters

#: Size of the port ``air``: the number of bytes, then the bytes. Per tick, three robots
#: send at most ``MOST_FRAMES`` frames each.
AIR_SIZE = 1 + FRAME_BYTES * 3 * MOST_FRAMES


class ChannelNumbers(NamedTuple):
    """Constants of the step of ``RadioChannel``."""

    delay: int
    """Latency, ticks, at least 1."""
    loss: float
    noise: TickNoise


@register_jitable
def _share(number: float) -> float:
    """Converts a normal random number to a uniform random number from 0 to 1."""
    return 0.5 * (1.0 + math.erf(number / math.sqrt(2.0)))


@register_jitable
def _send(
    state: Any, place: int, frames: Any, numbers: Any, random: Any, sent: int
) -> int:
    """Appends the radio frames of one robot to the bytes that are sent in this tick.

    Each frame uses one random number, whether it is lost or not. The function returns
    the number of frames that all robots have sent so far in this tick (control period).
    """
    for frame in range(int(frames[0])):
        row, sent = sent, sent + 1
        count = int(state[place])
        if _share(random[row, 0]) < numbers.loss or count + FRAME_BYTES >= AIR_SIZE:
            continue
        for k in range(FRAME_BYTES):
            state[place + 1 + count + k] = frames[1 + frame * FRAME_BYTES + k]
        state[place] = count + float(FRAME_BYTES)
    return sent


@register_jitable
def radio_channel_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: ChannelNumbers
) -> None:
    """Shifts the bytes in transit by one tick (control period), and adds new frames.

    The new frames are those that the robots send in this tick. The state has ``delay``
    rows, one per tick of latency. Each row has the size of the port ``air``. The first
    row arrives next.
    """
    for k in range((numbers.delay - 1) * AIR_SIZE):
        state[k] = state[k + AIR_SIZE]
    place = (numbers.delay - 1) * AIR_SIZE
    state[place] = 0.0
    sends = False
    for frames in inputs:
        sends = sends or frames[0] > 0.5
    if sends:
        random = tick_normals(numbers.noise, tick, len(inputs) * MOST_FRAMES, 1)
        sent = 0
        for frames in inputs:
            sent = _send(state, place, frames, numbers, random, sent)


@register_jitable
def _publish(state: Any, outputs: Any, numbers: ChannelNumbers) -> None:
    """Copies the output from the state of ``radio_channel_step``."""
    air = outputs[0]
    for k in range(AIR_SIZE):
        air[k] = state[k]


class RadioChannel(Block):
    """Transmits the radio frames of each robot to all radios.

    For each robot that sends, the block has an input port ``frames_<robot>``. The port
    carries the number of frames, and nine bytes per frame. All radios receive the same
    bytes, so a robot also receives its own frames. The address in a frame identifies
    the sender. A frame is lost with the probability ``loss``, independently of other
    frames. All other frames arrive without errors.

    The discrete state has the bytes in transit. The block updates the state at every
    tick (control period). The latency is ``latency_s``, rounded to ticks, and at least
    one tick.

    Args:
        parameters: Latency, and probability that a frame is lost.
        robots: Names of the robots that send.
        seed: Seed of the losses.
        tick_s: Control period, s.

    Reference: Song 2011, 3.3. Latency and losses are our additions.
    """

    part, stage = "radio", "world"
    outputs = (Port("air", AIR_SIZE, "number of bytes, and bytes"),)

    def __init__(
        self,
        *,
        parameters: RadioParameters = RadioParameters(),
        robots: Sequence[str] = (),
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("radio_channel")
        self.inputs = [
            Port(f"frames_{name}", FRAMES_SIZE, "number, and nine bytes each")
            for name in robots
        ]
        delay = max(1, round(parameters.latency_s / tick_s))
        numbers = ChannelNumbers(delay, parameters.loss, tick_noise(seed))
        self.declare(
            Step(radio_channel_step, numbers, [0.0] * (delay * AIR_SIZE), _publish),
            tick_s=tick_s,
        )
