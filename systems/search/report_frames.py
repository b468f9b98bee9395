"""Frames that a searching robot sends in a tick, kept in its state."""

from __future__ import annotations

from typing import Any

from numba.extending import register_jitable

from systems.radio.codec import FRAME_BYTES, MOST_FRAMES, write_frame

__all__ = ["add_frame", "clear_frames"]


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
