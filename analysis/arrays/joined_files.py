"""Joins sound files of several recorders, which may have started at different times."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.input_error import InputError
from systems.sound.sound_file import MOST_SAMPLES, ReadSound, read_recording

# Shifts by a part of a sample use a sinc with 2 _HALF + 1 values and a Kaiser window.
# With these numbers, the errors are below 1e-4 up to 0.46 of the sample rate, which is
# above the band of a recording.
_HALF, _BETA = 80, 8.0

# A shift below this part of a sample is left out.
_LEAST_SHIFT = 1e-3


class JoinedFiles(NamedTuple):
    """The channels of several files over the time that all of them cover."""

    samples: NDArray[np.float64]
    """(channels, n) samples; full scale is 1. The channels of the first file come
    first."""
    rate: int
    """Sample rate, Hz."""
    remarks: tuple[str, ...]
    """Messages about the files."""


def join_files(
    paths: Sequence[str | Path], starts_s: Sequence[float] | None
) -> JoinedFiles:
    """Reads one or more files with one or more channels each, and aligns them in time.

    Args:
        paths: WAV or FLAC files in the order of the microphones.
        starts_s: Time at which each file begins, s, from any common moment. None: all
            files begin at the same time.

    Returns:
        The samples from the latest beginning to the earliest end.

    Raises:
        InputError: A file cannot be read, the files have different sample rates or no
            time in common, or the number of start times is not that of the files.
    """
    starts = _checked_starts(paths, starts_s)
    sounds: list[ReadSound] = []
    for path in paths:
        if Path(path).is_dir():
            raise InputError(
                "recording",
                f"{str(path)!r} is a folder, not a file; name the files in it in the "
                "order of the microphones",
            )
        sounds.append(read_recording(path, "recording"))
        if sum(sound.samples.size for sound in sounds) > MOST_SAMPLES:
            raise InputError(
                "recording",
                f"the files hold more than {MOST_SAMPLES} samples in all channels; cut "
                "them into shorter files",
            )
    _check_rates(paths, sounds)
    rate = sounds[0].rate
    remarks = [
        f"{sound.truncated}; only this part is used"
        for sound in sounds
        if sound.truncated
    ]
    if len(sounds) == 1:
        return JoinedFiles(sounds[0].samples, rate, tuple(remarks))
    samples = _common_part(paths, sounds, starts * rate)
    if order := _order_remark(paths):
        remarks.append(order)
    lengths = [sound.samples.shape[1] for sound in sounds]
    if starts_s is None and min(lengths) < max(lengths):
        remarks.append(
            f"the files last {min(lengths) / rate:.3f} to {max(lengths) / rate:.3f} s; "
            f"the first {samples.shape[1] / rate:.3f} s of each are used as if all "
            "files began at the same time; otherwise state starts_s"
        )
    return JoinedFiles(samples, rate, tuple(remarks))


def _checked_starts(
    paths: Sequence[str | Path], starts_s: Sequence[float] | None
) -> NDArray[np.float64]:
    if starts_s is None:
        return np.zeros(len(paths))
    if len(starts_s) != len(paths):
        raise InputError(
            "starts_s",
            f"has {len(starts_s)} values for {len(paths)} files; give one start time "
            "per file, s",
        )
    starts = np.array(starts_s, dtype=np.float64)
    if not np.isfinite(starts).all():
        raise InputError("starts_s", "has a value that is not finite; give times in s")
    return starts - starts.min()


def _check_rates(paths: Sequence[str | Path], sounds: list[ReadSound]) -> None:
    for path, sound in zip(paths, sounds, strict=True):
        if sound.rate != sounds[0].rate:
            raise InputError(
                "recording",
                f"{str(path)!r} has a sample rate of {sound.rate} Hz, but "
                f"{str(paths[0])!r} has {sounds[0].rate} Hz; convert it: sox FILE -r "
                f"{sounds[0].rate} converted.wav",
            )


def _common_part(
    paths: Sequence[str | Path], sounds: list[ReadSound], starts: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns the samples of all files from the latest beginning to the earliest end.

    ``starts`` contains the beginnings of the files, samples.
    """
    ends = starts + [sound.samples.shape[1] for sound in sounds]
    count = math.floor(ends.min() - starts.max() + _LEAST_SHIFT)
    if count < 1:
        first, last = int(ends.argmin()), int(starts.argmax())
        gap_s = (starts.max() - ends.min()) / sounds[0].rate
        raise InputError(
            "starts_s",
            f"{str(paths[first])!r} ends {gap_s:.3f} s before {str(paths[last])!r} "
            "begins; correct the start times, or choose files of the same time",
        )
    offsets = starts.max() - starts
    parts = [
        _part(sound.samples, float(offset), count)
        for sound, offset in zip(sounds, offsets, strict=True)
    ]
    return np.concatenate(parts)


def _part(
    samples: NDArray[np.float64], offset: float, count: int
) -> NDArray[np.float64]:
    """Returns ``count`` samples of all channels from ``offset``, which is no integer.

    Values between two samples are those of the band-limited signal.
    """
    whole = round(offset)
    shift = offset - whole
    if abs(shift) < _LEAST_SHIFT:
        return samples[:, whole : whole + count]
    wanted = np.arange(whole - _HALF, whole + count + _HALF)
    padded = samples[:, np.clip(wanted, 0, samples.shape[1] - 1)]
    steps = np.arange(-_HALF, _HALF + 1)
    kernel = np.sinc(steps + shift) * np.kaiser(steps.size, _BETA)
    return np.array([np.convolve(channel, kernel, "valid") for channel in padded])


def _order_remark(paths: Sequence[str | Path]) -> str:
    """Tells that a shell has sorted numbered files by their digits: 1, 10, 2."""
    names = [str(path) for path in paths]
    by_number = sorted(
        names,
        key=lambda name: [
            (int(part) if part.isdigit() else 0, part)
            for part in re.split(r"(\d+)", name)
        ],
    )
    if names != sorted(names) or names == by_number:
        return ""
    k = next(k for k, name in enumerate(names) if name != by_number[k])
    return (
        f"microphone {k + 1} is {names[k]!r}, not {by_number[k]!r}: the files are in "
        "the order of their digits; name them in the order of the microphones"
    )
