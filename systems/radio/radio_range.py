"""The received level of the radio that a robot approaches."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.signals import TICK_S

#: Period of the measurements, s.
_PERIOD_S = 0.1
#: Smallest distance in the path loss, m.
_LEAST_M = 0.01
#: -A in eq. 8, level at a distance of 1 m, dBm. The value is an example in the data
#: sheet of the radio chip CC2431.
_LEVEL_AT_1_M_DBM = -42.4
#: n in eq. 8, exponent of the path loss.
_EXPONENT = 2.5
#: Standard deviation of a measured level, dB.
_FADING_DB = 4.0


@register_jitable
def radio_level(distance: float) -> float:
    """Computes the received radio level at a distance (path loss of Song 2011, eq. 8).

    Args:
        distance: Distance d between the antennas, m.

    Returns:
        Received level -(10 n log10(d) + A), dBm. Here n is the exponent of the path
        loss, and -A is the level at 1 m.
    """
    return _LEVEL_AT_1_M_DBM - 10.0 * _EXPONENT * math.log10(max(distance, _LEAST_M))


@register_jitable
def radio_distance(level: float) -> float:
    """Computes the distance between two antennas, m, from the received level, dBm.

    The function is the inverse of ``radio_level``.
    """
    return 10.0 ** ((_LEVEL_AT_1_M_DBM - level) / (10.0 * _EXPONENT))


class RangeNumbers(NamedTuple):
    """Constants of the step of ``RadioRange``."""

    period: int
    """Period of the measurements, ticks."""
    noise: TickNoise


@register_jitable
def radio_range_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: RangeNumbers
) -> None:
    """Measures the received radio level at the ticks at which a measurement is due.

    The state is the last measured level, dBm.
    """
    if tick % numbers.period == 0:
        pose, other = inputs
        distance = math.hypot(other[0] - pose[0], other[1] - pose[1])
        normals = tick_normals(numbers.noise, tick, 1, 2)
        state[0] = radio_level(distance) + _FADING_DB * float(normals[0, 0])
    outputs[0][0] = state[0]


class RadioRange(Block):
    """Measures the level of the radio signal from the robot that this robot approaches.

    The block measures a level every 0.1 s. The level depends on the distance between
    the origins of both robots, according to the path loss. The block adds a normally
    distributed error.

    The discrete state is the last measured level. There is no latency.

    Args:
        seed: Seed of the errors.
        tick_s: Control period, s.

    Reference: Song 2011, eq. 8.
    """

    part, stage = "radio_range", "hearing"
    inputs = (Port("pose_WB", 3, "m, m, rad"), Port("pose_WS", 3, "m, m, rad"))
    outputs = (Port("rssi_dbm", 1, "dBm", "rssi_dbm"),)

    def __init__(self, *, seed: int = 0, tick_s: float = TICK_S) -> None:
        super().__init__()
        self.set_name("radio_range")
        numbers = RangeNumbers(max(1, round(_PERIOD_S / tick_s)), tick_noise(seed))
        self.declare(Step(radio_range_step, numbers, [0.0]), tick_s=tick_s)
