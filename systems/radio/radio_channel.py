"""The air between the robots' radios."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from numba.extending import register_jitable
from pydrake.systems.framework import LeafSystem

from systems.framework.block_facts import BlockFacts
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.signals import TICK_S
from systems.framework.state_block import StateOutputs
from systems.framework.step_block import RunFacts, Step, reseeded
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
    """What is on the air after a tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Number of the tick.
        state: ``delay`` rows of the size of ``air``, the next one first; changed.
        inputs: As the input ports.
        outputs: Left as they are: they are state.
        numbers: ``ChannelNumbers``.
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


class RadioChannel(LeafSystem, StateOutputs):
    """Brings what each robot sends to all radios.

    .. pydrake_system::

        name: RadioChannel
        output_ports:
        - air [number of bytes, and bytes]

    For each robot that sends it has an input port ``frames_<robot>`` (number of frames,
    and nine bytes each). All radios hear the same, the sender's own included: frames
    bear addresses. A frame is lost as a whole, or a byte of it is changed; both by
    chance.

    Discrete state, every tick: what is on its way. Latency: ``latency_s``, rounded to
    ticks, at least one.

    Args:
        parameters: ``RadioParameters``.
        robots: Names of those that send.
        seed: Of losses and errors.
        tick_s: Period of the update, s.

    Reference: Song 2011, 3.3; latency and losses are ours.
    """

    FACTS = BlockFacts("radio", "world")

    def __init__(
        self,
        *,
        parameters: RadioParameters | None = None,
        robots: Sequence[str] = (),
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        own = parameters or RadioParameters()
        delay = max(1, round(own.latency_s / tick_s))
        numbers = ChannelNumbers(delay, own.loss, own.byte_error, tick_noise(seed))
        self.set_name("radio_channel")
        self.declare_state_outputs(
            Step(radio_channel_step, numbers, [0.0] * (delay * AIR_SIZE), _publish),
            [(f"frames_{name}", FRAMES_SIZE) for name in robots],
            (("air", AIR_SIZE),),
            tick_s,
        )

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop."""
        return reseeded(self, run)
