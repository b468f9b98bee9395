"""Delays of a resting sound, from all stretches of a recording that it is heard in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.recordings.array_geometry import ArrayGeometry
from analysis.recordings.channel_faults import find_channel_faults
from analysis.recordings.recording_faults import channels_without_faults
from analysis.recordings.recording_search import RecordingSearch, Sighting
from analysis.recordings.recording_spectra import RecordingSpectra
from systems.framework.input_error import InputError
from systems.sound.array_shape import ArrayShape
from systems.sound.sound_file import read_sound

_RATES_HZ = (8_000, 192_000)

# Where a geometry names no band, and up to which share of the sample rate.
_BAND_HZ = (300.0, 15_000.0)
_TOP_OF_RATE = 0.45
_LEAST_BAND_HZ = 500.0

# Snapshots of a stretch: more of them where few show a source.
_SNAPSHOTS = (8, 32, 128)
_ENOUGH = 3

# Of normally distributed values, standard deviation over median deviation.
_TO_STANDARD = 1.4826

# Stretches farther off the median than so many deviations are of something else.
_FARTHEST = 3.0

# Reflections move each channel by its own, alike in all stretches, by this share of
# what sound takes along the array, for each part that is not coherent.
_SCATTER_SHARE = 0.015


@dataclass(frozen=True)
class HeardSound:
    """Delays of a sound that rests."""

    tau: NDArray[np.float64]
    """(n - 1,) delays t_k - t_0, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) from noise, reflections and the scatter of the stretches, s^2."""
    stretches: int
    """In which it was heard."""
    used: int
    """Of these, those that agree."""


def sightings_of(
    path: Path,
    geometry: ArrayGeometry,
    from_s: float = 0.0,
    to_s: float | None = None,
    top_hz: float = math.inf,
) -> tuple[list[Sighting], list[str]]:
    """Stretches of a recording in which a source stands out.

    Args:
        path: WAV or FLAC with one channel a microphone.
        geometry: The microphones.
        from_s: Where to begin, s from the start of the recording.
        to_s: Where to end, s; None: at the end of the recording.
        top_hz: Higher frequencies are left out, Hz: their periods are shorter than
            what the microphones may be off by.

    Returns:
        The stretches in order of time, and remarks on the channels.

    Raises:
        InputError: The recording cannot be used.
    """
    channels, rate = _channels(path, geometry, from_s, to_s)
    shape, c, where = geometry.known.shape, geometry.c, repr(str(path))
    low, high = geometry.band or (_BAND_HZ[0], min(_BAND_HZ[1], _TOP_OF_RATE * rate))
    high = min(high, max(top_hz, low + _LEAST_BAND_HZ))

    def spectra(rows: NDArray[np.float64]) -> RecordingSpectra:
        equal = rows - rows.mean(axis=1, keepdims=True)
        equal /= np.maximum(equal.std(axis=1, keepdims=True), 1e-30)
        longest = shape.max_delay(c)
        return RecordingSpectra(
            equal.astype(np.float32), float(rate), low, high, longest
        )

    faults = find_channel_faults(
        channels, geometry.known, sample_rate_hz=float(rate), band_hz=geometry.band
    )
    # Whether channels are exchanged is told by the geometry, which is in doubt here.
    faults = [fault for fault in faults if fault.kind != "swapped"]
    channels, faults = channels_without_faults(channels, faults, lambda _: 0.0, where)
    recording = spectra(channels)
    if not recording.starts.size:
        raise InputError(
            "recording",
            f"{where} has {channels.shape[1]} samples, fewer than one frame of "
            f"{recording.window.size}; record longer",
        )
    found: list[Sighting] = []
    for snapshots in _SNAPSHOTS:
        search = RecordingSearch(recording, shape, c, snapshots)
        heard = list(search.sightings())
        found = max(found, heard, key=len)
        if len(found) >= min(_ENOUGH, len(search.stretches)):
            break
    return found, [fault.message for fault in faults]


def heard_sound(
    sightings: Sequence[Sighting], shape: ArrayShape, c: float
) -> HeardSound:
    """The delays of a resting sound, as the mean of its stretches.

    Stretches count by their errors. The error of the mean is what these leave, one
    stretch in two being independent, made larger where the stretches scatter more
    than they say; what reflections do alike in all of them is added.

    Args:
        sightings: Stretches in which it is heard, at least one.
        shape: The n microphones.
        c: Speed of sound, m/s.

    Returns:
        The delays, and their errors.
    """
    tau = np.array([sighting.tau for sighting in sightings])
    near = _near_median(tau)
    chosen = [s for s, is_near in zip(sightings, near, strict=True) if is_near]
    weights = [np.linalg.inv(s.covariance) for s in chosen]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    pulls = [w @ s.tau for w, s in zip(weights, chosen, strict=True)]
    mean = covariance @ np.sum(pulls, axis=0)
    if len(chosen) > 1:
        off = [(s.tau - mean) for s in chosen]
        scatter = sum(float(d @ w @ d) for d, w in zip(off, weights, strict=True))
        covariance *= 2.0 * max(1.0, scatter / (mean.size * (len(chosen) - 1)))
    coherence = float(np.mean([min(s.coherence, 1.0) for s in chosen]))
    alike = _SCATTER_SHARE * (1.0 - coherence) * shape.max_delay(c)
    covariance = covariance + alike**2 * (np.eye(mean.size) + 1.0)
    return HeardSound(mean, covariance, len(sightings), len(chosen))


def _near_median(tau: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(stretches,) which of them are of the sound that most are of."""
    off = np.linalg.norm(tau - np.median(tau, axis=0), axis=1)
    usual = _TO_STANDARD * float(np.median(off))
    near: NDArray[np.bool_] = off <= max(_FARTHEST * usual, float(off.min()))
    return near


def _channels(
    path: Path, geometry: ArrayGeometry, from_s: float, to_s: float | None
) -> tuple[NDArray[np.float64], int]:
    """(n, samples) of the array's columns between two times, and the rate, Hz."""
    samples, rate = read_sound(path, "recording")
    where = repr(str(path))
    needed = max(geometry.columns) + 1
    exact = geometry.channels is not None or len(samples) == needed
    if len(samples) < needed or not exact:
        raise InputError(
            "recording",
            f"{where} has {len(samples)} channels, and the array has "
            f"{len(geometry.columns)} microphones; name one column for each "
            "microphone in 'channels' of the geometry file",
        )
    if not _RATES_HZ[0] <= rate <= _RATES_HZ[1]:
        low, high = _RATES_HZ
        raise InputError(
            "recording",
            f"{where} has a sample rate of {rate} Hz; record at {low} to {high} Hz",
        )
    if geometry.band is not None and rate < 2.0 * geometry.band[1]:
        raise InputError(
            "recording",
            f"{where} has a sample rate of {rate} Hz, below twice the band's upper end "
            f"of {geometry.band[1]:g} Hz; lower the band or record at a higher rate",
        )
    length = samples.shape[1] / rate
    end = length if to_s is None else to_s
    if not from_s < end <= length + 1.0 / rate:
        raise InputError(
            "recording",
            f"{where} has {length:.3f} s, and {from_s:g} to {end:g} s are not "
            "within it; correct from_s and to_s",
        )
    part = slice(round(from_s * rate), round(end * rate))
    return np.ascontiguousarray(samples[list(geometry.columns), part]), rate
