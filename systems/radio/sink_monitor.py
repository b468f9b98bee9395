"""The status of the robots that the computer of the operator receives by radio."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.radio.codec import FRAME_BYTES, read_frame
from systems.radio.radio_channel import AIR_SIZE


class SinkPlaces(NamedTuple):
    """Indices in the status of a robot. The names are also those of its columns."""

    frames: int
    """Number of frames received."""
    function: int
    """Function of the last frame; -1: no frame yet."""
    value: int
    """Value of the last frame."""
    age_s: int
    """Time since the last frame, s."""
    result: int
    """Result of the search; -1: none yet, 0: not found, 1: found."""


_AT = SinkPlaces(*range(5))
# Numbers of the frames with the result of a search (Song 2011, table 5).
_FN_FOUND_ODOR, _FN_FOUND_SOUND = 12, 16


class SinkNumbers(NamedTuple):
    """Constants of the step of ``SinkMonitor``."""

    addresses: NDArray[np.int64]
    """Addresses of the robots."""
    tick_s: float


@register_jitable
def sink_monitor_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: SinkNumbers
) -> None:
    """Updates the status of each robot in one tick (control period).

    The function reads the radio frames that arrive in this tick. The state has the same
    values as the output port ``sink_status``.
    """
    air, robots = inputs[0], len(numbers.addresses)
    for robot in range(robots):
        state[len(_AT) * robot + _AT.age_s] += numbers.tick_s
    for first in range(1, 1 + int(air[0]), FRAME_BYTES):
        address, function, value = read_frame(air, first)
        for robot in range(robots):
            if numbers.addresses[robot] == address:
                place = len(_AT) * robot
                state[place + _AT.frames] += 1.0
                state[place + _AT.function] = float(function)
                state[place + _AT.value] = value
                state[place + _AT.age_s] = 0.0
                if function in (_FN_FOUND_ODOR, _FN_FOUND_SOUND):
                    state[place + _AT.result] = value


@register_jitable
def _publish(state: Any, outputs: Any, numbers: SinkNumbers) -> None:
    """Copies the output from the state of ``sink_monitor_step``."""
    status = outputs[0]
    for k in range(len(status)):
        status[k] = state[k]


class SinkMonitor(Block):
    """Receives the radio frames of all robots, and stores the last frame of each robot.

    The block models the computer of the operator. The output is the discrete state,
    which the block updates at every tick (control period). The latency is one tick.

    Args:
        robots: Radio address of each robot, by name of the robot.
        tick_s: Control period, s.

    Reference: Song 2011, 3.3 and 4.1.
    """

    part, stage = "sink", "world"
    inputs = (Port("air", AIR_SIZE, "number of bytes, and bytes"),)
    outputs = (
        Port("sink_status", "5 robots", "number, five for each robot, see SinkPlaces"),
    )

    def __init__(
        self, *, robots: Mapping[str, int] = {}, tick_s: float = TICK_S
    ) -> None:
        super().__init__()
        self.set_name("sink_monitor")
        names = tuple(f"{name}.{field}" for name in robots for field in _AT._fields)
        self.outputs = (self.outputs[0]._replace(columns=names),)
        state = [0.0, -1.0, 0.0, 0.0, -1.0] * len(robots)
        addresses = np.array([*robots.values()], dtype=np.int64)
        self.declare(
            Step(sink_monitor_step, SinkNumbers(addresses, tick_s), state, _publish),
            tick_s=tick_s,
            sizes={"robots": len(robots)},
            arrays=True,
        )
