"""The radio frames of nine bytes that robots and sink exchange (Song 2011, 3.3)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numba.extending import register_jitable

from systems.framework.input_error import InputError

#: Number of bytes of a frame: FA, FB, address, function, four bytes of data, checksum.
#: The checksum is the sum of the other bytes modulo 256.
FRAME_BYTES = 9
#: Largest number of frames that a robot sends per tick.
MOST_FRAMES = 4
#: Size of the port ``frames``: the number of frames, then their bytes.
FRAMES_SIZE = 1 + FRAME_BYTES * MOST_FRAMES
#: The first two bytes of each frame.
FIRST_BYTE, SECOND_BYTE = 0xFA, 0xFB
#: Address of the sink. The robots have the addresses 1 to 3.
SINK = 4
_FILL = 0xFF

#: Names of the functions of frames (Song 2011, table 5).
FRAME_NAMES: Mapping[int, str] = {
    0: "stop",
    1: "run",
    2: "set heading angle",
    3: "auto mode",
    4: "manual mode",
    5: "current heading angle",
    6: "gas sensor 1",
    7: "gas sensor 2",
    8: "gas sensor 3",
    9: "airflow sensor 1",
    10: "airflow sensor 2",
    11: "temperature",
    12: "odor source search result",
    13: "sound source direction angle",
    14: "distance from sound source",
    15: "distance from olfactory robot",
    16: "sound source search result",
}


@register_jitable
def _is_command(function: int) -> bool:
    return function in (0, 1, 3, 4)


@register_jitable
def _is_angle(function: int) -> bool:
    return function in (2, 5, 13)


@register_jitable
def _is_flag(function: int) -> bool:
    return function in (12, 16)


@register_jitable
def write_frame(
    out: Any, first: int, address: int, function: int, value: float
) -> None:
    """Writes the nine bytes of a frame.

    Args:
        out: Sequence that receives the bytes as floats.
        first: Index of the first byte.
        address: Address of the sender, 1 to 3. A frame of the sink contains the address
            of the receiver instead.
        function: Number of the function, 0 to 16, see ``FRAME_NAMES``.
        value: The value. Angles are in deg and are sent as 0 to 359.9, with one
            decimal. Flags are 0 or 1. Commands have no value. All other values are
            limited to 0 to 99.99, with two decimals.
    """
    out[first], out[first + 1] = float(FIRST_BYTE), float(SECOND_BYTE)
    out[first + 2], out[first + 3] = float(address), float(function)
    if _is_command(function):
        for k in range(4, 8):
            out[first + k] = float(_FILL)
    elif _is_flag(function):
        out[first + 4] = 1.0 if value > 0.5 else 0.0
        for k in range(5, 8):
            out[first + k] = float(_FILL)
    else:
        if _is_angle(function):
            digits = math.floor(10.0 * value + 0.5) % 3600
        else:
            digits = math.floor(100.0 * min(max(value, 0.0), 99.99) + 0.5)
        for k in range(3, -1, -1):
            out[first + 4 + k] = float(digits % 10)
            digits //= 10
    total = 0.0
    for k in range(8):
        total += out[first + k]
    out[first + 8] = total % 256.0


@register_jitable
def frame_is_sound(data: Any, first: int) -> bool:
    """Checks whether nine bytes are a valid frame.

    Args:
        data: The bytes.
        first: Index of the first byte.

    Returns:
        Whether the first two bytes, address, function, data and checksum are valid.
    """
    total = 0
    for k in range(8):
        total += int(data[first + k])
    sound = int(data[first]) == FIRST_BYTE and int(data[first + 1]) == SECOND_BYTE
    sound = sound and total % 256 == int(data[first + 8])
    function = int(data[first + 3])
    sound = sound and 1 <= int(data[first + 2]) <= 4 and function <= 16
    begin = 8 if _is_command(function) else 4
    end = 5 if _is_flag(function) else 8
    largest = 1 if _is_flag(function) else 9
    for k in range(begin, end):
        sound = sound and int(data[first + k]) <= largest
    return sound


@register_jitable
def frame_value(data: Any, first: int) -> float:
    """Decodes the value of a valid frame.

    Args:
        data: The bytes.
        first: Index of the first byte.

    Returns:
        The value in the unit of ``write_frame``. The direction of the sound (function
        13) is above -180 and up to 180 deg. The value of a command is 0.
    """
    function = int(data[first + 3])
    if _is_command(function):
        return 0.0
    if _is_flag(function):
        return float(data[first + 4])
    digits = 0.0
    for k in range(4, 8):
        digits = 10.0 * digits + float(data[first + k])
    if not _is_angle(function):
        return digits / 100.0
    angle = digits / 10.0
    return angle - 360.0 if function == 13 and angle > 180.0 else angle


@dataclass(frozen=True)
class Frame:
    """The content of a frame."""

    address: int
    """Address of the sender. A frame of the sink has the address of the receiver."""
    function: int
    """Number of the function, 0 to 16, see ``FRAME_NAMES``."""
    value: float = 0.0
    """Value in the unit of ``write_frame``."""


def encode_frame(frame: Frame) -> bytes:
    """Encodes a frame as nine bytes.

    Args:
        frame: The content of the frame.

    Returns:
        The nine bytes.

    Raises:
        InputError: The address, the function or the value is out of its range.
    """
    if not 1 <= frame.address <= SINK:
        raise InputError("address", f"is {frame.address}; use 1 to {SINK}")
    if frame.function not in FRAME_NAMES:
        raise InputError("function", f"is {frame.function}; use 0 to 16")
    function, value = frame.function, frame.value
    if not math.isfinite(value):
        raise InputError("value", f"is {value}; give a finite number")
    plain = not (_is_angle(function) or _is_flag(function) or _is_command(function))
    if plain and not 0.0 <= value < 99.995:
        raise InputError("value", f"is {value:g}; send 0 to 99.99")
    if _is_flag(function) and value not in (0.0, 1.0):
        raise InputError("value", f"is {value:g}; send 0 or 1")
    out = [0.0] * FRAME_BYTES
    write_frame(out, 0, frame.address, function, value)
    return bytes(map(int, out))


def decode_frame(data: Sequence[int]) -> Frame | None:
    """Decodes nine bytes.

    Args:
        data: The bytes.

    Returns:
        The content of the frame, or None if the bytes are not a valid frame.
    """
    if len(data) != FRAME_BYTES or not frame_is_sound(data, 0):
        return None
    return Frame(data[2], data[3], frame_value(data, 0))
