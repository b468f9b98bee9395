"""Estimates the delays of a sound at rest from the stretches of a recording."""

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

# _BAND_HZ: default band for a geometry without a band, Hz.
# _TOP_OF_RATE: upper limit of the default band, as a share of the sample rate.
_BAND_HZ = (300.0, 15_000.0)
_TOP_OF_RATE = 0.45
_LEAST_BAND_HZ = 500.0

# _SNAPSHOTS: numbers of snapshots per stretch to try, in this order. More snapshots are
#   needed if few stretches show a source.
# _ENOUGH: number of stretches with a source that ends the trials.
_SNAPSHOTS = (8, 32, 128)
_ENOUGH = 3

# Ratio of the standard deviation to the median absolute deviation of normally
# distributed values.
_TO_STANDARD = 1.4826

# Largest distance of a stretch from the median, in standard deviations. A stretch
# beyond it belongs to a different sound.
_FARTHEST = 3.0

# Error from reflections that is the same in all stretches, and independent for each
# channel. It is a share of the travel time of sound along the array, for each part of
# the sound that is not coherent.
_SCATTER_SHARE = 0.015


@dataclass(frozen=True)
class HeardSound:
    """Delays of a sound at rest."""

    tau: NDArray[np.float64]
    """(n - 1,) delays t_k - t_0 of channels 1 ... n - 1 after channel 0, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays, s^2. It contains noise, reflections, and
    the scatter of the stretches."""
    stretches: int
    """Number of stretches that contain a sound."""
    used: int
    """Number of these stretches that agree on the delays."""


def sightings_of(
    path: Path,
    geometry: ArrayGeometry,
    from_s: float = 0.0,
    to_s: float | None = None,
    top_hz: float = math.inf,
) -> tuple[list[Sighting], list[str]]:
    """Finds the stretches of a recording in which a source is clearly audible.

    A stretch is a run of consecutive short windows, which are called snapshots.

    Args:
        path: WAV or FLAC file with one channel per microphone.
        geometry: Geometry of the microphones.
        from_s: Start of the part to use, s from the start of the recording.
        to_s: End of the part to use, s from the start of the recording. None: the end
            of the recording.
        top_hz: Highest frequency to use, Hz. At higher frequencies, the periods are
            shorter than the possible delay errors from wrong microphone positions.

    Returns:
        sightings: The stretches with a source, in the order of time.
        remarks: Messages about faulty channels.

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
    # Only the geometry can reveal exchanged channels, and the geometry is uncertain
    # here.
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
    """Averages the delays of a sound at rest over the stretches of a recording.

    A stretch with smaller errors has a larger weight. The covariance of the mean
    follows in these steps:

    1. The errors of the stretches are combined as if they were independent.
    2. The covariance is doubled, because stretches overlap by half.
    3. If the stretches scatter more than their errors say, the covariance grows
       accordingly.
    4. The error from reflections is added, because it is the same in all stretches.

    Args:
        sightings: Stretches that contain the sound, at least one.
        shape: The n microphones.
        c: Speed of sound, m/s.

    Returns:
        The mean delays and their covariance.
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
    """Returns for each stretch whether it contains the same sound as most stretches."""
    off = np.linalg.norm(tau - np.median(tau, axis=0), axis=1)
    usual = _TO_STANDARD * float(np.median(off))
    near: NDArray[np.bool_] = off <= max(_FARTHEST * usual, float(off.min()))
    return near


def _channels(
    path: Path, geometry: ArrayGeometry, from_s: float, to_s: float | None
) -> tuple[NDArray[np.float64], int]:
    """Reads the channels of the array between two times of a recording.

    Returns:
        samples: (n, samples) samples of the array's channels.
        rate: Sample rate, Hz.
    """
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
