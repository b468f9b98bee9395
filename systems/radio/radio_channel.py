"""The air between the robots' radios."""

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

#: Frames that arrive in a tick at most.
_MOST_ON_AIR = 3 * MOST_FRAMES
#: Size of the port ``air``: how many bytes, then these.
AIR_SIZE = 1 + FRAME_BYTES * _MOST_ON_AIR


class ChannelNumbers(NamedTuple):
    """What the step of ``RadioChannel`` depends on."""

    delay: int
    """Ticks, at least 1."""
    loss: float
    byte_error: float
    noise: TickNoise


@register_jitable
def _share(number: float) -> float:
    """An even number from 0 to 1 of a normal one."""
    return 0.5 * (1.0 + math.erf(number / math.sqrt(2.0)))


@register_jitable
def _send(state: Any, place: int, frames: Any, numbers: Any, random: Any) -> None:
    """Puts a robot's frames behind what is sent in this tick."""
    for frame in range(int(frames[0])):
        count = int(state[place])
        row = count // FRAME_BYTES
        if _share(random[row, 0]) < numbers.loss or count + FRAME_BYTES >= AIR_SIZE:
            continue
        for k in range(FRAME_BYTES):
            byte = frames[1 + frame * FRAME_BYTES + k]
            if _share(random[row, 1 + 2 * k]) < numbers.byte_error:
                other = min(math.floor(255.0 * _share(random[row, 2 + 2 * k])), 254.0)
                byte = (byte + 1.0 + other) % 256.0
            state[place + 1 + count + k] = byte
        state[place] = count + float(FRAME_BYTES)


@register_jitable
def radio_channel_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: ChannelNumbers
) -> None:
    """What is on the air after a tick.

    State: ``delay`` rows of the size of ``air``, the next one first.
    """
    for k in range((numbers.delay - 1) * AIR_SIZE):
        state[k] = state[k + AIR_SIZE]
    place = (numbers.delay - 1) * AIR_SIZE
    state[place] = 0.0
    sends = False
    for frames in inputs:
        sends = sends or frames[0] > 0.5
    if sends:
        rows, columns = _MOST_ON_AIR + 1, 1 + 2 * FRAME_BYTES
        random = tick_normals(numbers.noise, tick, rows, columns)
        for frames in inputs:
            _send(state, place, frames, numbers, random)


@register_jitable
def _publish(state: Any, outputs: Any, numbers: ChannelNumbers) -> None:
    """The outputs of ``radio_channel_step``'s state."""
    air = outputs[0]
    for k in range(AIR_SIZE):
        air[k] = state[k]


class RadioChannel(Block):
    """Brings what each robot sends to all radios.

    For each robot that sends, the block has an input port ``frames_<robot>`` (number of
    frames, and nine bytes each). All radios hear the same bytes, and a robot hears its
    own frames, too: frames contain addresses. By chance a frame is lost as a whole, or
    one of its bytes is changed.

    Discrete state, every tick: the bytes on their way. Latency: ``latency_s``, rounded
    to ticks, at least one.

    Args:
        parameters: ``RadioParameters``.
        robots: Names of the robots that send.
        seed: Seed of losses and errors.
        tick_s: Period of the update, s.

    Reference: Song 2011, 3.3; latency and losses are ours.
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
        numbers = ChannelNumbers(
            delay, parameters.loss, parameters.byte_error, tick_noise(seed)
        )
        self.declare(
            Step(radio_channel_step, numbers, [0.0] * (delay * AIR_SIZE), _publish),
            tick_s=tick_s,
        )
