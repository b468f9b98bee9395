"""A parser that finds frames in a stream of bytes that may contain errors."""

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

#: Size of the state of a parser: the number of stored bytes, then the bytes.
PARSER_SIZE = 1 + FRAME_BYTES


@register_jitable
def _is_begin(state: Any, count: int) -> bool:
    """Returns whether the stored bytes can be the beginning of a frame."""
    if count >= 1 and state[1] != FIRST_BYTE:
        return False
    return not (count >= 2 and state[2] != SECOND_BYTE)


@register_jitable
def _drop_one(state: Any) -> None:
    """Drops bytes from the front until the rest can be the beginning of a frame."""
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
    """Processes the next byte of a stream.

    If the stored bytes are not a valid frame, the parser searches for the beginning of
    a frame from the second byte on. Therefore wrong bytes do not destroy a valid frame
    after them. A checksum with the value FA does not begin a new frame.

    Args:
        state: ``PARSER_SIZE`` numbers, initially 0. The function changes them.
        byte: The next byte, 0 to 255.

    Returns:
        Whether a valid frame ends with this byte; then its address, function and value.
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
    """Applies ``parse_byte`` to a stream that arrives in pieces."""

    def __init__(self) -> None:
        self._state = [0.0] * PARSER_SIZE

    def feed(self, data: Iterable[int]) -> list[Frame]:
        """Processes the next piece of the stream.

        Args:
            data: The bytes of the piece.

        Returns:
            The frames that end in this piece.
        """
        frames = []
        for byte in data:
            good, address, function, value = parse_byte(self._state, float(byte))
            if good:
                frames.append(Frame(address, function, value))
        return frames
