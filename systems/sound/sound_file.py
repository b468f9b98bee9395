"""Reads sound files, with error messages that state the problem and the remedy."""

from __future__ import annotations

import os
import re
import struct
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import soundfile
from numpy.typing import NDArray

from systems.framework.input_error import InputError
from systems.framework.input_files import require_file
from systems.sound.wav_lengths import (
    LEAST_UNKNOWN,
    MOST_UNKNOWN,
    data_size,
    states_length,
)

# Lines in which libsndfile reports that a file is shorter than its header states. AIFF
# has the name SSND, AU the name Data Size, and W64 and RF64 have names with riff.
_SHORTER = re.compile(
    r"^\s*(?:data|SSND|Data Size|riff|Riff size)\s*: (\d+) \(should be (\d+)\)",
    re.MULTILINE,
)

# First bytes of sound files with a header.
_HEADERS = (
    *(b"RIFF", b"RIFX", b"RF64", b"riff", b"fLaC", b"OggS", b"FORM", b".snd", b"caff"),
    b"ID3",
)

#: Number of frames that libsndfile reports for a FLAC file of unknown length.
UNKNOWN_FRAMES = 2**63 - 1

#: Largest number of samples in all channels together. That many samples need 1 GB.
MOST_SAMPLES = 2**27

#: Largest sample. Full scale is 1, or 2^31 in files with unscaled numbers. The powers
#: of larger samples would exceed the range of single precision.
LARGEST_SAMPLE = 1e12

#: Shortest loop of noise, s. A shorter loop would sound like a tone.
_LEAST_NOISE_S = 0.2

# Largest number of bytes of a sample in a file.
_MOST_BYTES = 8

# Smallest and largest sample rate.
_RATES_HZ = (1_000, 400_000)

# Number of samples per channel that are read at once. The samples before damage in a
# file are read except for those in the damaged block.
_BLOCK = 2**12


class ReadSound(NamedTuple):
    """The samples of a sound file, which may end early."""

    samples: NDArray[np.float64]
    """(channels, n) samples; full scale is 1."""
    rate: int
    """Sample rate, Hz."""
    truncated: str = ""
    """How much of the file is missing, after the name of the file. Empty if the file is
    complete."""


def read_sound(path: str | Path, field: str) -> tuple[NDArray[np.float64], int]:
    """Reads a complete WAV or FLAC file, even if its header does not state the length.

    Args:
        path: Sound file.
        field: Name of the parameter with the path, for the messages.

    Returns:
        (channels, n) samples, where 1 is full scale, and the sample rate in Hz.

    Raises:
        InputError: ``read_recording`` refuses the file, or the file is truncated.
    """
    samples, rate, truncated = read_recording(path, field)
    if truncated:
        raise InputError(field, f"{truncated}; record or copy it again")
    return samples, rate


def read_recording(path: str | Path, field: str) -> ReadSound:
    """Reads a WAV or FLAC file up to its end, or up to damage in it.

    Args:
        path: Sound file.
        field: Name of the parameter with the path, for the messages.

    Returns:
        The samples that can be read, the sample rate, and what is missing.

    Raises:
        InputError: The file is missing, not a sound file, empty, or silent in every
            channel. Or a sample is not finite or exceeds ``LARGEST_SAMPLE``, the file
            has more than ``MOST_SAMPLES`` samples, or its rate is outside 1 to 400 kHz.
    """
    path = require_file(path, field, "WAV or FLAC")
    where = repr(str(path))
    if path.stat().st_size == 0:
        raise InputError(field, f"{where} is empty; record or copy it again")
    try:
        with _Stream(_opened(path, field, where)) as sound:
            # Raw samples can look like the frames of an MP3 file.
            if sound.format == "MP3" and path.suffix.lower() != ".mp3":
                _require_header(path, field, where)
            announced, rate = _announced_frames(sound), sound.samplerate
            _check_header(announced, sound.channels, rate, field, where)
            samples, complete = _read_all(sound, field, where)
    except OSError as error:
        raise InputError(
            field, f"{where} cannot be read ({error}); copy it to another place"
        ) from error
    except soundfile.LibsndfileError as error:
        _require_header(path, field, where)
        cause = error.error_string.rstrip(". ") or "it is damaged"
        raise InputError(
            field, f"{where} is not a readable WAV or FLAC file ({cause}); convert it"
        ) from error
    _check_samples(samples, field, where)
    count, truncated = samples.shape[1], ""
    if announced == UNKNOWN_FRAMES and not complete:
        truncated = f"{where} is truncated: only {count} samples can be read"
    elif count < announced != UNKNOWN_FRAMES:
        truncated = f"{where} is truncated: {count} of {announced} samples can be read"
    return ReadSound(samples, rate, truncated)


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
    if frames != UNKNOWN_FRAMES and frames * channels > MOST_SAMPLES:
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


def _announced_frames(sound: soundfile.SoundFile) -> int:
    """Returns the number of samples per channel that the header of a file states.

    For a truncated file of samples without compression, ``frames`` is the number of
    samples in the file, and only the log of libsndfile has the stated length.
    """
    for stated, found in _SHORTER.findall(sound.extra_info):
        if int(found) < int(stated) < LEAST_UNKNOWN and sound.frames:
            return int(stated) // (int(found) // sound.frames)
    return int(sound.frames)


def _require_header(path: Path, field: str, where: str) -> None:
    """Raises an InputError if a file does not begin like a sound file."""
    with path.open("rb") as file:
        if file.read(4).startswith(_HEADERS):
            return
    raise InputError(
        field,
        f"{where} is not a readable WAV or FLAC file, it has no header; convert it, "
        "for example raw samples of 16 bits: ffmpeg -f s16le -ar RATE -ac CHANNELS -i "
        "FILE FILE.wav",
    )


def _read_all(
    sound: soundfile.SoundFile, field: str, where: str
) -> tuple[NDArray[np.float64], bool]:
    """Reads samples as an array (channels, samples) up to the end or to damage.

    Returns the samples, and whether there was no damage. Raises the error of libsndfile
    if no sample can be read.
    """
    blocks: list[NDArray[np.float64]] = []
    count, complete = 0, True
    while True:
        try:
            block = sound.read(_BLOCK, dtype="float64", always_2d=True)
        except soundfile.LibsndfileError:
            if not blocks:
                raise
            complete = False
            break
        if not len(block):
            break
        blocks.append(block)
        count += len(block)
        if count * sound.channels > MOST_SAMPLES:
            raise _too_long(field, where)
    samples = np.empty((sound.channels, count))
    first = 0
    for block in blocks:
        samples[:, first : first + len(block)] = block.T
        first += len(block)
    return samples, complete


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
    if (most := np.abs(samples).max()) > LARGEST_SAMPLE:
        raise InputError(
            field,
            f"{where} holds samples up to {most:.1e}, and full scale is 1; export it "
            "with 16 or 24 bits",
        )
    if not samples.any():
        raise InputError(field, f"{where} is silent throughout; use a file with sound")


def _opened(path: Path, field: str, where: str) -> int | BytesIO:
    """Opens a file, or a copy of the file with a repaired header.

    If a recorder left 0 as the length of the samples, libsndfile would read nothing. In
    this case, the function returns a copy whose header marks the length as unknown.
    Otherwise, it returns a descriptor, which the reader closes. A descriptor has no
    name, so a file named .raw may have a header.
    """
    file_size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(12)
        size = data_size(file) if header[:4] == b"RIFF" else -1
        begins = file.tell()
        if size is None:
            raise InputError(
                field, f"{where} is truncated in its header; record or copy it again"
            )
        whole = struct.unpack("<I", header[4:8])[0] if size == 0 else 0
        # If other chunks follow the samples, the file is complete and has no samples.
        if size != 0 or (states_length(whole) and 8 + whole > begins):
            return os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        if file_size - begins > _MOST_BYTES * MOST_SAMPLES:
            raise _too_long(field, where)
        file.seek(0)
        content = bytearray(file.read())
    content[begins - 4 : begins] = struct.pack("<I", MOST_UNKNOWN)
    return BytesIO(content)
