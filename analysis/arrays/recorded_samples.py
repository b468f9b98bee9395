"""Recordings in memory, from files or arrays, that fit a microphone array."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.arrays.array_geometry import ROBOT_ARRAY, ArrayGeometry
from analysis.arrays.joined_files import join_files
from systems.framework.input_error import InputError
from systems.sound.sound_file import LARGEST_SAMPLE

#: A file with all channels, several files in the order of the microphones, or (n,
#: samples) recorded samples.
Recording: TypeAlias = str | Path | Sequence[str | Path] | ArrayLike

_RATES_HZ = (8_000, 500_000)

# Channels and microphones of a ReSpeaker with the firmware of six channels.
_RESPEAKER = (6, 4)


class RecordedSamples(NamedTuple):
    """A recording in memory. Its channels and rate match the array it was read for."""

    samples: NDArray[np.float64]
    """(channels, samples) recorded sound; full scale is 1."""
    rate: int
    """Sample rate, Hz."""
    name: str
    """Name of the recording in messages."""
    remarks: tuple[str, ...] = ()
    """Messages about the files."""


def recorded_samples(
    recording: Recording,
    geometry: ArrayGeometry,
    sample_rate_hz: float | None = None,
    starts_s: Sequence[float] | None = None,
) -> RecordedSamples:
    """Reads files or takes (channels, samples) samples, and checks them for the array.

    A file states its own rate, and ``sample_rate_hz`` is then None. ``starts_s``
    contains the times at which several files begin, s.
    """
    paths = _paths(recording)
    if paths and sample_rate_hz is not None:
        raise InputError(
            "sample_rate_hz",
            "applies to samples only; leave it out, because a file states its own rate",
        )
    if len(paths) < 2 and starts_s is not None:
        raise InputError(
            "starts_s", "applies to several files only; leave it out for one recording"
        )
    if paths:
        samples, rate, remarks = join_files(paths, starts_s)
        found = RecordedSamples(samples, rate, name_of_files(paths), remarks)
    else:
        found = _given(recording, sample_rate_hz)
    if complaint := array_mismatch(geometry, len(found.samples), found.rate):
        raise InputError("recording", f"{found.name} {complaint}")
    return found


def name_of_files(paths: Sequence[str | Path]) -> str:
    """Names the recording in one or more files in a message."""
    first = repr(str(paths[0]))
    if len(paths) == 1:
        return first
    return f"{first} with {len(paths) - 1} further files"


def _paths(recording: object) -> list[str | Path]:
    """Lists the files of a recording. The list is empty for samples."""
    if isinstance(recording, str | Path):
        return [recording]
    if not isinstance(recording, list | tuple):
        return []
    paths = [path for path in recording if isinstance(path, str | Path)]
    return paths if len(paths) == len(recording) else []


def _given(recording: object, sample_rate_hz: float | None) -> RecordedSamples:
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
    if (most := np.abs(samples).max()) > LARGEST_SAMPLE:
        raise InputError(
            "recording", f"{where} has samples up to {most:.1e}; full scale is 1"
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
            "record every microphone on a channel of its own, or give locate one file "
            "per microphone, or join files: sox -M 1.wav 2.wav 3.wav all.wav"
        )
    if geometry.channels is None and count > needed:
        default = geometry.microphones == ROBOT_ARRAY.microphones
        remedy = "give the positions of its microphones with --geometry FILE"
        if not default:
            remedy = (
                "name the columns of its microphones, counted from 0, in 'channels' of "
                "the geometry file"
            )
        if (count, needed) == _RESPEAKER and not default:
            remedy += (
                "; in a ReSpeaker, column 0 is processed, and its microphones are "
                "'channels: [1, 2, 3, 4]'"
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
