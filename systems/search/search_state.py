"""What the states of both searches have in common, and how it is put out."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Port
from systems.radio.codec import FRAME_BYTES, FRAMES_SIZE, MOST_FRAMES, write_frame
from systems.search.search_ending import REPORT_COLUMNS


class SearchPlaces(NamedTuple):
    """Places in the state of a search, of what both searches have."""

    activity: int
    left: int
    """Ticks until the activity ends."""
    started: int
    """0 before the first tick, then 1."""
    expected: int
    """Heading to which the robot turns, deg."""
    moves: int
    """Whether it moves, 0 or 1."""
    flag: int
    """Whether it calls, or what it listens to."""
    ended: int
    """The report begins here, in the order of ``REPORT_COLUMNS``."""
    phase: int
    steps: int
    fault: int


#: Places of what both searches have; each search adds places of its own behind them.
AT = SearchPlaces(*range(10))


def ticks_of(time_s: float, tick_s: float, least: int = 1) -> int:
    """A time as a number of ticks.

    Args:
        time_s: s.
        tick_s: Period of a tick, s.
        least: Smallest number that is returned.

    Returns:
        The nearest number.
    """
    return max(least, round(time_s / tick_s))


def search_ports(flag: str, unit: str) -> tuple[Port, ...]:
    """Output ports of a search.

    Args:
        flag: Name of the port that says whether it calls or what it listens to.
        unit: Unit of this port.

    Returns:
        The ports, in the order of ``publish_search``.
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
    """Puts out what the state of a search says.

    Args:
        state: Of the search.
        outputs: Heading, move, flag, report and frames; filled.
        first: Place of the frames in the state.
    """
    expected, move, flag, report, frames = outputs
    expected[0], move[0], flag[0] = state[AT.expected], state[AT.moves], state[AT.flag]
    for k in range(len(report)):
        report[k] = state[AT.ended + k]
    for k in range(len(frames)):
        frames[k] = state[first + k]


@register_jitable
def clear_frames(state: Any, first: int) -> None:
    """Takes the frames of the last tick away.

    Args:
        state: Holds the number of frames at ``first``, and their bytes after it.
        first: Place of that number.
    """
    state[first] = 0.0


@register_jitable
def add_frame(
    state: Any, first: int, address: int, function: int, value: float
) -> None:
    """Adds a frame, if there is room.

    Args:
        state: As of ``clear_frames``.
        first: The same.
        address: Of the sender.
        function: Fn of the frame (Song 2011, table 5).
        value: What it carries, in its unit.
    """
    count = int(state[first])
    if count >= MOST_FRAMES:
        return
    write_frame(state, first + 1 + FRAME_BYTES * count, address, function, value)
    state[first] = count + 1.0
