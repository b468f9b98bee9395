"""Recordings in memory, from files or arrays, that fit a microphone array."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.arrays.array_geometry import ROBOT_ARRAY, ArrayGeometry
from systems.framework.input_error import InputError
from systems.sound.sound_file import read_sound

_RATES_HZ = (8_000, 500_000)


class RecordedSamples(NamedTuple):
    """A recording in memory. Its channels and rate match the array it was read for."""

    samples: NDArray[np.float64]
    """(channels, samples) recorded sound; full scale is 1."""
    rate: int
    """Sample rate, Hz."""
    name: str
    """Name of the recording in messages."""


def recorded_samples(
    recording: str | Path | ArrayLike,
    geometry: ArrayGeometry,
    sample_rate_hz: float | None = None,
) -> RecordedSamples:
    """Reads a file or takes (channels, samples) samples, and checks them for the array.

    A file states its own rate, and ``sample_rate_hz`` is then None.
    """
    if isinstance(recording, str | Path):
        if sample_rate_hz is not None:
            raise InputError(
                "sample_rate_hz",
                "applies to samples only; leave it out, because a file states its "
                "own rate",
            )
        samples, rate = read_sound(recording, "recording")
        found = RecordedSamples(samples, rate, repr(str(recording)))
    else:
        found = _given(recording, sample_rate_hz)
    if complaint := array_mismatch(geometry, len(found.samples), found.rate):
        raise InputError("recording", f"{found.name} {complaint}")
    return found


def _given(recording: ArrayLike, sample_rate_hz: float | None) -> RecordedSamples:
    if sample_rate_hz is None:
        raise InputError("sample_rate_hz", "is missing; give the sample rate in Hz")
    if not (math.isfinite(sample_rate_hz) and sample_rate_hz == round(sample_rate_hz)):
        raise InputError(
            "sample_rate_hz", f"is {sample_rate_hz!r}; give a whole number of Hz"
        )
    given = np.asarray(recording)
    where = f"array of shape {given.shape}"
    if given.dtype.kind not in "iuf":
        raise InputError("recording", f"{where} holds no numbers; give samples")
    if given.ndim != 2 or len(given) > given.shape[1]:
        raise InputError(
            "recording",
            f"{where}; give (microphones, samples), one row per microphone: transpose "
            "the result of soundfile.read",
        )
    samples = given.astype(np.float64)
    if given.dtype.kind in "iu":
        samples /= np.iinfo(given.dtype).max  # full scale is 1, as in files
    if not np.isfinite(samples).all() or not samples.any():
        raise InputError(
            "recording", f"{where} is silent or not finite; give recorded samples"
        )
    return RecordedSamples(samples, round(sample_rate_hz), where)


def array_mismatch(geometry: ArrayGeometry, channels: int, rate: int) -> str:
    """Explains why an array cannot have made a recording.

    The text continues a sentence that begins with the name of the recording. It is
    empty if the array can have made the recording.
    """
    count, needed = channels, len(geometry.microphones)
    if geometry.channels is not None and max(geometry.channels) >= count >= needed:
        return (
            f"has {count} channels, numbers 0 to {count - 1}; 'channels' in the "
            f"geometry file counts from 0 and names {max(geometry.channels)}"
        )
    if max(geometry.columns) >= count:
        what = "is mono" if count == 1 else f"has {count} channels"
        return (
            f"{what}, but the array needs {max(needed, max(geometry.columns) + 1)}; "
            "record every microphone on a channel of its own"
        )
    if geometry.channels is None and count > needed:
        default = geometry.microphones == ROBOT_ARRAY.microphones
        remedy = (
            "give the positions of its microphones with --geometry FILE"
            if default
            else "name the channels to use in the geometry file, for example "
            f"'channels: {list(range(needed))}'"
        )
        whose = "the robot's own array" if default else "the array"
        return f"has {count} channels, but {whose} {needed} microphones; {remedy}"
    if not _RATES_HZ[0] <= rate <= _RATES_HZ[1]:
        low, high = _RATES_HZ
        return f"has a sample rate of {rate} Hz; record at {low} to {high} Hz"
    if geometry.band is not None and rate < 2.0 * geometry.band[1]:
        return (
            f"has a sample rate of {rate} Hz, below twice the band's upper end of "
            f"{geometry.band[1]:g} Hz; lower the band or record at a higher rate"
        )
    return ""
