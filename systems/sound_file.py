"""Reading recorded sound, with errors that say what is wrong with the file."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np
import soundfile
from numpy.typing import NDArray

__all__ = ["read_sound"]

# Programs that write to a pipe cannot know the length and leave one of these.
_UNKNOWN_SIZES = (0, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)


def read_sound(path: str | Path, field: str) -> tuple[NDArray[np.float64], int]:
    """Reads a WAV or FLAC file.

    Args:
        path: The file.
        field: Name of the parameter that holds the path, for the messages.

    Returns:
        (channels, n) samples, full scale 1, and the rate in Hz.

    Raises:
        ValueError: The file is missing, not sound, empty, truncated, silent
            in every channel or not finite.
    """
    path = Path(path)
    where = f"{field}: {str(path)!r}"
    if not path.is_file():
        raise ValueError(f"{where} is not a file; give the path of a WAV or FLAC file")
    if path.stat().st_size == 0:
        raise ValueError(f"{where} is empty; record or copy it again")
    _refuse_truncated_wav(path, where)
    try:
        with soundfile.SoundFile(path) as sound:
            announced = sound.frames
            samples = sound.read(dtype="float64", always_2d=True).T
            rate = sound.samplerate
    except (soundfile.LibsndfileError, OSError) as error:
        raise ValueError(
            f"{where} is not a readable WAV or FLAC file ({error}); convert it"
        ) from error
    if samples.shape[1] < announced:
        raise ValueError(
            f"{where} is truncated: {samples.shape[1]} of {announced} samples; "
            "record or copy it again"
        )
    _check_samples(samples, where)
    return np.ascontiguousarray(samples), rate


def _check_samples(samples: NDArray[np.float64], where: str) -> None:
    if samples.shape[1] == 0:
        raise ValueError(f"{where} holds no samples; record or copy it again")
    if not np.isfinite(samples).all():
        channel, sample = np.argwhere(~np.isfinite(samples))[0]
        raise ValueError(
            f"{where} holds NaN or infinite samples, the first in channel "
            f"{channel + 1} as sample {sample}; export it again"
        )
    if not samples.any():
        raise ValueError(f"{where} is silent throughout; give one that sounds")


def _refuse_truncated_wav(path: Path, where: str) -> None:
    """libsndfile reads what is left of a cut WAV file without a word."""
    with path.open("rb") as file:
        header = file.read(12)
        if header[:4] != b"RIFF":
            return
        if len(header) < 12 or not _data_is_whole(file, path.stat().st_size):
            raise ValueError(f"{where} is truncated; record or copy it again")


def _data_is_whole(file: BinaryIO, file_size: int) -> bool:
    while len(chunk := file.read(8)) == 8:
        name, size = struct.unpack("<4sI", chunk)
        if name == b"data":
            return size in _UNKNOWN_SIZES or file.tell() + size <= file_size
        file.seek(size + size % 2, 1)
    return False
