"""Bearing, elevation and range over time of a recording by any array."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.recordings.array_geometry import (
    ROBOT_ARRAY,
    ArrayGeometry,
    KnownArray,
    load_geometry,
    make_geometry,
)
from analysis.recordings.channel_faults import ChannelFault, find_channel_faults
from analysis.recordings.heard_sources import heard_sources
from analysis.recordings.locate_result import LocateResult, SourceEstimate
from analysis.recordings.onset_spectra import AFTER_S, OnsetSpectra
from analysis.recordings.recording_faults import channels_without_faults
from analysis.recordings.recording_search import RecordingSearch, Sighting
from analysis.recordings.recording_spectra import RecordingSpectra
from analysis.recordings.source_placement import place_source
from analysis.recordings.wavefront_misfit import late_channel
from systems.framework.input_error import InputError
from systems.sound.sound_file import read_sound

__all__ = ["ArrayGeometry", "LocateResult", "SourceEstimate", "load_geometry", "locate"]

_RATES_HZ = (8_000, 192_000)

# Where a geometry names no band.
_BAND_HZ = (300.0, 15_000.0)

# A band may not reach up to half the sample rate, where recorders' filters fall.
_TOP_OF_RATE = 0.45


# Snapshots of a stretch: more of them for a source that is faint or far, of
# which fewer show too little.
_SNAPSHOTS = (8, 32, 128)
_LEAST_ESTIMATES = 3

# Microphones may stand so many deviations farther apart than it is stated.
_SLACK = 4.0

# Faults that make channels seem late.
_EXPLAINS_LATENESS = ("size", "near")


def locate(
    recording: str | Path | ArrayLike,
    geometry: ArrayGeometry | str | Path | Sequence[Sequence[float]] | None = None,
    *,
    sample_rate_hz: float | None = None,
) -> LocateResult:
    """Locates the source of a recording, stretch by stretch.

    Args:
        recording: WAV or FLAC with one channel a microphone, 8-192 kHz; or samples,
            (n, samples), one row a microphone.
        geometry: The microphones, as an object, a file, or their places (x, y) or
            (x, y, z) in m; none: the robot's own array.
        sample_rate_hz: Of samples, Hz; a file has its own.

    Returns:
        ``LocateResult``. Standard deviations count what the geometry says of its
        own errors; a range is reported where its standard deviation is at most
        ``largest_range_error`` of it.

    Raises:
        InputError: The recording cannot be used; says why, and the remedy.
    """
    geometry = make_geometry(geometry)
    samples, rate, where = _samples(recording, sample_rate_hz)
    complaint = _complaint(samples, rate, geometry)
    if complaint:
        raise InputError("recording", f"{where} {complaint}")
    known = geometry.known
    shape = known.shape
    whole = geometry.columns == tuple(range(len(samples)))
    channels = samples if whole else samples[list(geometry.columns)]
    spectra, faults = _recording(channels, rate, known, geometry.band, where)
    if not spectra.starts.size:
        raise InputError(
            "recording",
            f"{where} has {samples.shape[1]} samples, less than one frame of "
            f"{spectra.window.size}; record longer",
        )
    search, sightings, estimates = _estimates(spectra, known)
    late = late_channel(sightings, known)
    if late is not None and not any(f.kind in _EXPLAINS_LATENESS for f in faults):
        faults.append(late)
    array = {
        "microphones": [list(place) for place in geometry.microphones],
        "channels": list(geometry.columns),
        "kind": shape.kind,
        "aperture_m": shape.aperture_m,
        "side": shape.side,
        "sound_speed_m_s": known.c,
        "sound_speed_std_m_s": known.budget.speed_std,
        "position_std_m": known.budget.position_std,
        "delay_std_s": known.budget.delay_std,
        "largest_range_error": known.largest_range_error,
        "band_hz": [spectra.low_hz, spectra.high_hz],
        "sample_rate_hz": rate,
        "frame_s": search.stretch_s,
    }
    sources, tracks = heard_sources(
        spectra.channels,
        shape,
        known.c,
        float(rate),
        (spectra.low_hz, spectra.high_hz),
    )
    return LocateResult(
        array, shape, estimates, len(search.stretches), faults, sources, tracks
    )


def _samples(
    recording: str | Path | ArrayLike, sample_rate_hz: float | None
) -> tuple[NDArray[np.float64], int, str]:
    """Samples, (n, samples), their rate, Hz, and what to call them."""
    if isinstance(recording, str | Path):
        if sample_rate_hz is not None:
            raise InputError(
                "sample_rate_hz", "is that of samples; leave it out, a file has its own"
            )
        samples, rate = read_sound(recording, "recording")
        return samples, rate, repr(str(recording))
    if sample_rate_hz is None:
        raise InputError("sample_rate_hz", "is not said; give that of the samples, Hz")
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
            f"{where}; give (microphones, samples), one row a microphone: transpose "
            "what soundfile.read returns",
        )
    samples = given.astype(np.float64)
    if given.dtype.kind in "iu":
        samples /= np.iinfo(given.dtype).max  # as files are read: full scale is 1
    if not np.isfinite(samples).all() or not samples.any():
        raise InputError(
            "recording", f"{where} is silent or not finite; give what was recorded"
        )
    return samples, round(sample_rate_hz), where


def _recording(
    channels: NDArray[np.float64],
    rate: int,
    array: KnownArray,
    band: tuple[float, float] | None,
    where: str,
) -> tuple[RecordingSpectra, list[ChannelFault]]:
    """The channels that were chosen, mended where they can be; and their faults."""
    low, high = band or (_BAND_HZ[0], min(_BAND_HZ[1], _TOP_OF_RATE * rate))
    shape = array.shape

    def spectra(channels: NDArray[np.float64]) -> RecordingSpectra:
        equal = np.empty(channels.shape, dtype=np.float32)
        for row, channel in zip(equal, channels, strict=True):
            row[:] = (channel - channel.mean()) / channel.std()
        return RecordingSpectra(equal, float(rate), low, high, shape.max_delay(array.c))

    def agreement(channels: NDArray[np.float64]) -> float:
        search = RecordingSearch(spectra(channels), shape, array.c, _SNAPSHOTS[0])
        return search.mean_response()

    faults = find_channel_faults(
        channels, array, sample_rate_hz=float(rate), band_hz=band
    )
    channels, faults = channels_without_faults(channels, faults, agreement, where)
    return spectra(channels), faults


_Heard = tuple[RecordingSearch, list[Sighting], list[SourceEstimate]]


def _estimates(recording: RecordingSpectra, array: KnownArray) -> _Heard:
    """By each sound, if they are short, or by stretches of time.

    The stretches are the shortest ones in which something is heard often enough.
    """
    sounds = [
        OnsetSpectra(
            recording.channels,
            recording.sample_rate_hz,
            recording.low_hz,
            recording.high_hz,
            recording.travel_s,
            after_s=after_s,
        )
        for after_s in AFTER_S
    ]
    if sounds[0].are_most:
        return min((_heard(s, array, snapshots=1) for s in sounds), key=_uncertainty)
    best = None
    for snapshots in _SNAPSHOTS:
        heard = _heard(recording, array, snapshots)
        if best is None or len(heard[2]) > len(best[2]):
            best = heard
        if len(heard[2]) >= min(_LEAST_ESTIMATES, len(heard[0].stretches)):
            break
    assert best is not None
    return best


def _uncertainty(heard: _Heard) -> tuple[int, float]:
    """What is worse the less is heard, and then the less well its delays are known."""
    variances = [np.trace(sighting.covariance) for sighting in heard[1]]
    return -len(variances), float(np.median(variances)) if variances else np.inf


def _heard(recording: RecordingSpectra, array: KnownArray, snapshots: int) -> _Heard:
    search = RecordingSearch(
        recording,
        array.shape,
        array.c,
        snapshots,
        slack_s=_SLACK * array.budget.position_std / array.c,
        has_place=lambda delays: place_source(delays, array) is not None,
    )
    sightings = list(search.sightings())
    placed = ((s.t_s, place_source(s, array)) for s in sightings)
    found = [SourceEstimate.of(t_s, at) for t_s, at in placed if at is not None]
    return search, sightings, found


def _complaint(samples: NDArray[np.float64], rate: int, geometry: ArrayGeometry) -> str:
    """Why an array cannot have made a recording; empty if it can."""
    count, needed = len(samples), len(geometry.microphones)
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
            "give the places of its microphones by --geometry FILE"
            if default
            else "name the channels to use in the geometry file, as "
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
