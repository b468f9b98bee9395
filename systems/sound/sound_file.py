"""Reads sound files, with error messages that state the problem and the remedy."""

from __future__ import annotations

import struct
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
import soundfile
from numpy.typing import NDArray

from systems.framework.input_error import InputError
from systems.framework.input_files import require_file

# Numbers that stand for an unknown length of a WAV file. Programs that write to a pipe
# do not know the length of the file, and write one of these numbers instead.
_UNKNOWN_SIZES = (0, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)

# Number of frames that libsndfile reports for a FLAC file of unknown length.
_UNKNOWN_FRAMES = 2**63 - 1

#: Largest number of samples in all channels together. That many samples need 1 GB.
MOST_SAMPLES = 2**27

#: Shortest loop of noise, s. A shorter loop would sound like a tone.
_LEAST_NOISE_S = 0.2

# Largest number of bytes of a sample in a file.
_MOST_BYTES = 8

# Smallest and largest sample rate.
_RATES_HZ = (1_000, 400_000)

# Number of samples per channel that are read at once.
_BLOCK = 2**16


def read_sound(path: str | Path, field: str) -> tuple[NDArray[np.float64], int]:
    """Reads a WAV or FLAC file, even if its header does not state the length.

    Args:
        path: Sound file.
        field: Name of the parameter with the path, for the messages.

    Returns:
        (channels, n) samples, where 1 is full scale, and the sample rate in Hz.

    Raises:
        InputError: The file is missing, not a sound file, empty, truncated, or silent
            in every channel. Or a sample is not finite, the file has more than
            ``MOST_SAMPLES`` samples, or its rate is outside 1 to 400 kHz.
    """
    path = require_file(path, field, "WAV or FLAC")
    where = repr(str(path))
    if path.stat().st_size == 0:
        raise InputError(field, f"{where} is empty; record or copy it again")
    try:
        with _Stream(_opened(path, field, where)) as sound:
            announced, rate = sound.frames, sound.samplerate
            _check_header(announced, sound.channels, rate, field, where)
            samples = _read_all(sound, field, where)
    except (soundfile.LibsndfileError, OSError) as error:
        raise InputError(
            field, f"{where} is not a readable WAV or FLAC file ({error}); convert it"
        ) from error
    if samples.shape[1] < announced != _UNKNOWN_FRAMES:
        raise InputError(
            field,
            f"{where} is truncated: {samples.shape[1]} of {announced} samples; "
            "record or copy it again",
        )
    _check_samples(samples, field, where)
    return samples, rate


def read_played(
    path: str | Path, low_hz: float, field: str
) -> tuple[NDArray[np.float64], int]:
    """Reads the sound that a loudspeaker plays.

    Args:
        path: Sound file.
        low_hz: Lower end of the band of the sound, Hz. The sample rate must be at least
            twice this frequency.
        field: Name of the parameter with the path, for the messages.

    Returns:
        (n,) samples, where 1 is full scale, and the sample rate in Hz.

    Raises:
        InputError: ``read_sound`` refuses the file, the file has several channels, or
            its sample rate is too low.
    """
    channels, rate = read_sound(path, field)
    if len(channels) != 1:
        raise InputError(
            field, f"{path} has {len(channels)} channels; mix it down to one channel"
        )
    if rate < 2.0 * low_hz:
        raise InputError(
            field,
            f"{path} has a rate of {rate} Hz, below twice low_hz ({low_hz:g} Hz); use "
            "a recording of a higher rate",
        )
    return channels[0], rate


def read_noise(
    path: str | Path, count: int, field: str
) -> tuple[NDArray[np.float64], int]:
    """Reads ego noise, which is repeated without end at each of several microphones.

    Args:
        path: Sound file.
        count: Number of microphones.
        field: Name of the parameter with the path, for the messages.

    Returns:
        (1, n) or (count, n) samples, where 1 is full scale, and the sample rate in Hz.

    Raises:
        InputError: ``read_sound`` refuses the file, the number of its channels is
            neither 1 nor ``count``, or the file is too short.
    """
    channels, rate = read_sound(path, field)
    if len(channels) not in (1, count):
        raise InputError(
            field,
            f"{path} has {len(channels)} channels for {count} microphones; give "
            "one channel for each, or mix it down to one channel",
        )
    if channels.shape[1] < _LEAST_NOISE_S * rate:
        raise InputError(
            field,
            f"{path} lasts {channels.shape[1] / rate:.3f} s; give at least "
            f"{_LEAST_NOISE_S} s",
        )
    return channels, rate


class _Stream(soundfile.SoundFile):
    """A sound file that claims not to be seekable, so that reading to its end works.

    In a seekable file, the library soundfile queries the position after it has read a
    block. At the end of a FLAC file of unknown length, this query fails.
    """

    def seekable(self) -> bool:
        return False


def _check_header(
    frames: int, channels: int, rate: int, field: str, where: str
) -> None:
    if not _RATES_HZ[0] <= rate <= _RATES_HZ[1]:
        raise InputError(
            field,
            f"{where} has a sample rate of {rate} Hz; record at {_RATES_HZ[0]} to "
            f"{_RATES_HZ[1]} Hz",
        )
    if frames != _UNKNOWN_FRAMES and frames * channels > MOST_SAMPLES:
        raise InputError(
            field,
            f"{where} states that it holds {frames} samples of {channels} "
            f"channels, above {MOST_SAMPLES} in all; cut it into shorter files, "
            "or repair its header",
        )


def _too_long(field: str, where: str) -> InputError:
    return InputError(
        field,
        f"{where} holds more than {MOST_SAMPLES} samples in all channels; cut it into "
        "shorter files",
    )


def _read_all(
    sound: soundfile.SoundFile, field: str, where: str
) -> NDArray[np.float64]:
    """Reads all samples as an array (channels, samples)."""
    blocks, count = [], 0
    while len(block := sound.read(_BLOCK, dtype="float64", always_2d=True)):
        blocks.append(block)
        count += len(block)
        if count * sound.channels > MOST_SAMPLES:
            raise _too_long(field, where)
    samples = np.empty((sound.channels, count))
    first = 0
    for block in blocks:
        samples[:, first : first + len(block)] = block.T
        first += len(block)
    return samples


def _check_samples(samples: NDArray[np.float64], field: str, where: str) -> None:
    if samples.shape[1] == 0:
        raise InputError(field, f"{where} holds no samples; record or copy it again")
    if not np.isfinite(samples).all():
        channel, sample = np.argwhere(~np.isfinite(samples))[0]
        raise InputError(
            field,
            f"{where} holds NaN or infinite samples, the first in channel "
            f"{channel + 1} as sample {sample}; export it again",
        )
    if not samples.any():
        raise InputError(field, f"{where} is silent throughout; use a file with sound")


def _opened(path: Path, field: str, where: str) -> Path | BytesIO:
    """Returns the path of a file, or a copy of the file with a repaired header.

    The library libsndfile reads a truncated WAV file without an error message, so this
    function refuses such a file. If a recorder left 0 as the length of the samples,
    libsndfile would read nothing. In this case, the function returns a copy whose
    header marks the length as unknown.
    """
    file_size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(12)
        if header[:4] != b"RIFF":
            return path
        size = _data_size(file) if len(header) == 12 else None
        begins = file.tell()
        if size is None or (size not in _UNKNOWN_SIZES and begins + size > file_size):
            raise InputError(field, f"{where} is truncated; record or copy it again")
        (whole,) = struct.unpack("<I", header[4:8])
        # The header is complete if the length is not 0, or if other chunks follow the
        # samples.
        if size or (whole not in _UNKNOWN_SIZES and 8 + whole > begins):
            return path
        if file_size - begins > _MOST_BYTES * MOST_SAMPLES:
            raise _too_long(field, where)
        file.seek(0)
        content = bytearray(file.read())
    content[begins - 4 : begins] = struct.pack("<I", _UNKNOWN_SIZES[-1])
    return BytesIO(content)


def _data_size(file: BinaryIO) -> int | None:
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
