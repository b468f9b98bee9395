"""Lengths in the header of a WAV file, which may be unknown."""

from __future__ import annotations

import struct
from typing import BinaryIO

#: Least length in a WAV header that stands for an unknown length, and the largest one.
#: Programs that write to a pipe do not know the length. They write 0, or a number near
#: the limit of a signed or an unsigned number of 32 bits.
LEAST_UNKNOWN, MOST_UNKNOWN = 0x7FFF_0000, 0xFFFF_FFFF


def states_length(size: int) -> bool:
    """Returns whether a length in a WAV header, in bytes, is that of the samples.

    False means that the length is unknown, and that the samples go on to the end.
    """
    return 0 < size < LEAST_UNKNOWN


def data_size(file: BinaryIO) -> int | None:
    """Returns the size of the samples of a WAV file that its header states, in bytes.

    The result is None if the file has no chunk of samples. Afterwards, the position in
    the file is the beginning of the samples.
    """
    while len(chunk := file.read(8)) == 8:
        name, size = struct.unpack("<4sI", chunk)
        if name == b"data":
            return int(size)
        file.seek(size + size % 2, 1)
    return None
