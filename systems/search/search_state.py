"""The common part of the states of both searches, and their outputs."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Port
from systems.radio.codec import FRAME_BYTES, FRAMES_SIZE, MOST_FRAMES, write_frame
from systems.search.search_ending import REPORT_COLUMNS

#: Time of a step for turning and driving, s (Song 2011, 4.2 and 4.3).
MOVE_S = 3.0
#: Period of the radio reports after the end of a search, s.
REPORT_EVERY_S = 1.0


class SearchPlaces(NamedTuple):
    """Indices in the state of a search, for values that both searches have."""

    activity: int
    left: int
    """Number of ticks until the activity ends."""
    started: int
    """0 before the first tick, 1 after it."""
    expected: int
    """Expected heading, clockwise from north, deg."""
    moves: int
    """Whether the robot moves, 0 or 1."""
    flag: int
    """Value of the third output port: ``calling`` or ``listening``."""
    ended: int
    """First index of the report, in the order of ``REPORT_COLUMNS``."""
    phase: int
    steps: int
    fault: int


#: Indices of the common values. Each search adds its own indices after them.
AT = SearchPlaces(*range(10))


def ticks_of(time_s: float, tick_s: float, least: int = 1) -> int:
    """Converts a time in s to the nearest number of ticks (control periods).

    ``tick_s`` is the duration of a tick, s. The result is at least ``least``.
    """
    return max(least, round(time_s / tick_s))


def search_ports(flag: str, unit: str) -> tuple[Port, ...]:
    """Makes the output ports of a block that searches.

    ``flag`` is the name of the third port, ``calling`` or ``listening``, and ``unit``
    is its unit. The ports are in the order in which ``publish_search`` fills them.
    """
    return (
        Port(
            "expected_heading_deg",
            1,
            "deg, clockwise from north",
            "expected_heading_deg",
        ),
        Port("move", 1, "0 or 1", "move"),
        Port(flag, 1, unit, flag),
        Port(
            "search_report",
            len(REPORT_COLUMNS),
            "number of the ending, phase, steps, sum of faults",
            REPORT_COLUMNS,
        ),
        Port("frames", FRAMES_SIZE, "number, and nine bytes each, see systems.radio"),
    )


@register_jitable
def publish_search(state: Any, outputs: Any, first: int) -> None:
    """Copies the outputs of a search from its state.

    Args:
        state: State of the search.
        outputs: Arrays that the function fills: heading, move, flag, report and radio
            frames.
        first: Index in the state at which the radio frames begin.
    """
    expected, move, flag, report, frames = outputs
    expected[0], move[0], flag[0] = state[AT.expected], state[AT.moves], state[AT.flag]
    for k in range(len(report)):
        report[k] = state[AT.ended + k]
    for k in range(len(frames)):
        frames[k] = state[first + k]


@register_jitable
def add_frame(
    state: Any, first: int, address: int, function: int, value: float
) -> None:
    """Adds a radio frame to the frames that the robot sends in this tick.

    A tick is a control period. If the robot already sends ``MOST_FRAMES`` frames in
    this tick, the function does nothing.

    Args:
        state: State of the search.
        first: Index in the state of the number of frames. The bytes of the frames
            follow.
        address: Radio address of the sender.
        function: Number Fn of the function (Song 2011, table 5).
        value: Value to send, in the unit that ``write_frame`` states.
    """
    count = int(state[first])
    if count >= MOST_FRAMES:
        return
    write_frame(state, first + 1 + FRAME_BYTES * count, address, function, value)
    state[first] = count + 1.0
