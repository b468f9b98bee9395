"""The status of the robots that the computer of the operator receives by radio."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.block import Block, Port, Step
from systems.framework.signals import TICK_S
from systems.radio.radio_channel import AIR_SIZE
from systems.radio.stream import PARSER_SIZE, parse_byte

#: Status of each robot: number of frames received; function of the last frame (-1: no
#: frame yet); value of the last frame; time since the last frame, s; and result of the
#: search (-1: none yet, 0: not found, 1: found).
SINK_FIELDS = ("frames", "function", "value", "age_s", "result")
_COUNT, _FUNCTION, _VALUE, _AGE, _RESULT = range(len(SINK_FIELDS))


class SinkNumbers(NamedTuple):
    """Constants of the step of ``SinkMonitor``."""

    addresses: NDArray[np.int64]
    """Addresses of the robots."""
    tick_s: float


@register_jitable
def sink_monitor_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: SinkNumbers
) -> None:
    """Updates the status of each robot with the bytes of this tick.

    The state holds the ``SINK_FIELDS`` of each robot, then the state of the parser.
    """
    air, fields, robots = inputs[0], 5, len(numbers.addresses)
    for robot in range(robots):
        state[robot * fields + _AGE] += numbers.tick_s
    first = robots * fields
    parser = state[first:]
    for k in range(int(air[0])):
        good, address, function, value = parse_byte(parser, air[1 + k])
        if not good:
            continue
        for robot in range(robots):
            if numbers.addresses[robot] == address:
                place = robot * fields
                state[place + _COUNT] += 1.0
                state[place + _FUNCTION] = float(function)
                state[place + _VALUE] = value
                state[place + _AGE] = 0.0
                if function in (12, 16):
                    state[place + _RESULT] = value


@register_jitable
def _publish(state: Any, outputs: Any, numbers: SinkNumbers) -> None:
    """Copies the output from the state of ``sink_monitor_step``."""
    status = outputs[0]
    for k in range(len(status)):
        status[k] = state[k]


class SinkMonitor(Block):
    """Receives all frames, and stores the last frame of each robot.

    The discrete state holds the output and the state of the parser, and is updated
    every tick. The latency is one tick.

    Args:
        robots: Addresses of the robots, by name.
        tick_s: Period of the update, s.

    Reference: Song 2011, 3.3 and 4.1.
    """

    part, stage = "sink", "world"
    inputs = (Port("air", AIR_SIZE, "number of bytes, and bytes"),)
    outputs = (
        Port("sink_status", "5 robots", "number, five for each robot, see SINK_FIELDS"),
    )

    def __init__(
        self, *, robots: Mapping[str, int] = {}, tick_s: float = TICK_S
    ) -> None:
        super().__init__()
        self.set_name("sink_monitor")
        names = tuple(f"{name}.{field}" for name in robots for field in SINK_FIELDS)
        self.outputs = (self.outputs[0]._replace(columns=names),)
        state = [0.0, -1.0, 0.0, 0.0, -1.0] * len(robots) + [0.0] * PARSER_SIZE
        addresses = np.array([*robots.values()], dtype=np.int64)
        self.declare(
            Step(sink_monitor_step, SinkNumbers(addresses, tick_s), state, _publish),
            tick_s=tick_s,
            sizes={"robots": len(robots)},
            arrays=True,
        )
