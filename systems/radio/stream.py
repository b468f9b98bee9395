"""Frames out of a stream of bytes that may be damaged."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from numba.extending import register_jitable

from systems.radio.codec import (
    FIRST_BYTE,
    FRAME_BYTES,
    SECOND_BYTE,
    Frame,
    frame_is_sound,
    frame_value,
)

#: Numbers of a parser's state: how many bytes it holds, and these.
PARSER_SIZE = 1 + FRAME_BYTES


@register_jitable
def _is_begin(state: Any, count: int) -> bool:
    """Whether the bytes held can still become a frame."""
    if count >= 1 and state[1] != FIRST_BYTE:
        return False
    return not (count >= 2 and state[2] != SECOND_BYTE)


@register_jitable
def _drop_one(state: Any) -> None:
    """Drops the first byte, and all after it that cannot begin a frame."""
    count = int(state[0])
    while count > 0:
        for k in range(1, count):
            state[k] = state[k + 1]
        count -= 1
        if _is_begin(state, count):
            break
    state[0] = float(count)


@register_jitable
def parse_byte(state: Any, byte: float) -> tuple[bool, int, int, float]:
    """Takes the next byte of a stream.

    What turns out to be no frame is looked through again from its second byte on, so
    that garbage costs no good frame after it; a sum that is FA is no new head.

    Args:
        state: ``PARSER_SIZE`` numbers, 0 at first; changed.
        byte: 0 to 255.

    Returns:
        Whether a frame ends here; its address, function and value.
    """
    count = int(state[0]) + 1
    state[count] = byte
    state[0] = float(count)
    if not _is_begin(state, count):
        _drop_one(state)
        return False, 0, 0, 0.0
    if count < FRAME_BYTES:
        return False, 0, 0, 0.0
    if not frame_is_sound(state, 1):
        _drop_one(state)
        return False, 0, 0, 0.0
    address, function = int(state[3]), int(state[4])
    value = frame_value(state, 1)
    state[0] = 0.0
    return True, address, function, value


class StreamParser:
    """``parse_byte`` for bytes that come in pieces."""

    def __init__(self) -> None:
        self._state = [0.0] * PARSER_SIZE

    def feed(self, data: Iterable[int]) -> list[Frame]:
        """Takes the next piece of the stream.

        Args:
            data: Bytes.

        Returns:
            Frames that end in it.
        """
        frames = []
        for byte in data:
            good, address, function, value = parse_byte(self._state, float(byte))
            if good:
                frames.append(Frame(address, function, value))
        return frames
