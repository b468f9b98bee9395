"""The radio frames of nine bytes that robots send (Song 2011, 3.3)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from numba.extending import register_jitable

#: Number of bytes of a frame: FA, FB, address, function, four bytes of data, checksum.
#: The checksum is the sum of the other bytes modulo 256.
FRAME_BYTES = 9
#: Largest number of frames that a robot sends per tick.
MOST_FRAMES = 4
#: Size of the port ``frames``: the number of frames, then their bytes.
FRAMES_SIZE = 1 + FRAME_BYTES * MOST_FRAMES
#: The first two bytes of each frame.
_FIRST_BYTE, _SECOND_BYTE = 0xFA, 0xFB
_FILL = 0xFF

#: Names of the functions of frames that robots send (Song 2011, table 5).
FRAME_NAMES: Mapping[int, str] = {
    2: "set heading angle",
    5: "current heading angle",
    6: "gas sensor 1",
    7: "gas sensor 2",
    8: "gas sensor 3",
    9: "airflow sensor 1",
    10: "airflow sensor 2",
    12: "odor source search result",
    13: "sound source direction angle",
    14: "distance from sound source",
    15: "distance from olfactory robot",
    16: "sound source search result",
}


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
    """Writes a radio frame of nine bytes.

    The function codes the value as follows:

    - Angles are in deg. They are sent as 0 to 359.9, with one decimal.
    - Flags are 0 or 1.
    - All other values are limited to 0 to 99.99, and are sent with two decimals.

    Args:
        out: Sequence that receives the bytes as floats.
        first: Index in ``out`` of the first byte of the frame.
        address: Radio address of the sender, 1 to 3.
        function: Number of the function (the kind of value), see ``FRAME_NAMES``.
        value: Value to send.
    """
    out[first], out[first + 1] = float(_FIRST_BYTE), float(_SECOND_BYTE)
    out[first + 2], out[first + 3] = float(address), float(function)
    if _is_flag(function):
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
def read_frame(data: Any, first: int) -> tuple[int, int, float]:
    """Decodes a radio frame of nine bytes.

    The direction of the sound (function 13) is in (-180, 180] deg. All other values,
    including other angles, are in the range that ``write_frame`` states.

    Args:
        data: Sequence that contains the bytes.
        first: Index in ``data`` of the first byte of the frame.

    Returns:
        Three values: radio address of the sender; number of the function (the kind of
        value), see ``FRAME_NAMES``; and the value.
    """
    address, function = int(data[first + 2]), int(data[first + 3])
    if _is_flag(function):
        return address, function, float(data[first + 4])
    digits = 0.0
    for k in range(4, 8):
        digits = 10.0 * digits + float(data[first + k])
    if not _is_angle(function):
        return address, function, digits / 100.0
    angle = digits / 10.0
    if function == 13 and angle > 180.0:
        angle -= 360.0
    return address, function, angle
