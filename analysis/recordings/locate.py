"""Bearing, elevation and range over time of a recording by any array."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.recordings.array_geometry import (
    ArrayGeometry,
    KnownArray,
    make_geometry,
)
from analysis.recordings.array_match import (
    RecordedSamples,
    array_mismatch,
    recorded_samples,
)
from analysis.recordings.channel_faults import ChannelFault, find_channel_faults
from analysis.recordings.clock_drift import recording_drift
from analysis.recordings.heard_sources import heard_sources
from analysis.recordings.locate_result import LocateResult, SourceEstimate
from analysis.recordings.onset_spectra import AFTER_S, OnsetSpectra
from analysis.recordings.recording_faults import channels_without_faults
from analysis.recordings.recording_search import RecordingSearch, Sighting
from analysis.recordings.recording_spectra import RecordingSpectra
from analysis.recordings.source_placement import has_place, place_source
from analysis.recordings.wavefront_misfit import late_channel
from systems.framework.input_error import InputError

# Where a geometry names no band.
_BAND_HZ = (300.0, 15_000.0)

# A band may not reach up to half the sample rate, where recorders' filters fall.
_TOP_OF_RATE = 0.45


# Snapshots of a stretch: more of them for a source that is faint or far, of
# which fewer show too little.
_SNAPSHOTS = (8, 32, 128)
_LEAST_ESTIMATES = 3

# Where channels agree by less than this part of what they do in another window, it
# holds more echoes than sound.
_CLEAR = 0.5

# Microphones may stand so many deviations farther apart than it is stated.
_SLACK = 4.0

# Faults that make channels seem late.
_EXPLAINS_LATENESS = ("size", "near")


class HeardRecording(NamedTuple):
    """What was heard in a recording, stretch by stretch."""

    recording: RecordingSpectra
    search: RecordingSearch
    sightings: list[Sighting]
    """Delays of the stretches in which one place stands out."""
    estimates: list[SourceEstimate]
    """Their places, where the delays belong to one."""
    faults: list[ChannelFault]


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
    return located(recorded_samples(recording, geometry, sample_rate_hz), geometry)


def located(recorded: RecordedSamples, geometry: ArrayGeometry) -> LocateResult:
    """``locate`` of what has been read.

    Args:
        recorded: Of this array.
        geometry: The microphones.

    Returns:
        As of ``locate``.

    Raises:
        InputError: The recording cannot be used; says why, and the remedy.
    """
    samples, rate, where = recorded
    heard = hear(samples, rate, geometry, where)
    known, spectra, search = geometry.known, heard.recording, heard.search
    shape = known.shape
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
    sources = heard_sources(
        spectra.channels,
        shape,
        known.c,
        float(rate),
        (spectra.low_hz, spectra.high_hz),
    )
    return LocateResult(
        array,
        shape,
        heard.estimates,
        len(search.stretches),
        heard.faults,
        sources,
        known.largest_range_error,
    )


def hear(
    samples: NDArray[np.float64], rate: int, geometry: ArrayGeometry, name: str
) -> HeardRecording:
    """Locates the source of a recording in memory.

    Args:
        samples: (channels, samples).
        rate: Of the samples, Hz.
        geometry: The microphones.
        name: Of the recording, for messages.

    Returns:
        Delays and places of its stretches.

    Raises:
        InputError: The recording cannot be used; says why, and the remedy.
    """
    complaint = array_mismatch(geometry, len(samples), rate)
    if complaint:
        raise InputError("recording", f"{name} {complaint}")
    known = geometry.known
    whole = geometry.columns == tuple(range(len(samples)))
    channels = samples if whole else samples[list(geometry.columns)]
    recording, faults = _recording(channels, rate, known, geometry.band, name)
    if not recording.starts.size:
        raise InputError(
            "recording",
            f"{name} has {samples.shape[1]} samples, fewer than one frame of "
            f"{recording.window.size}; record longer",
        )
    search, sightings, estimates = _estimates(recording, known)
    late = late_channel(sightings, known)
    if late is not None and not any(f.kind in _EXPLAINS_LATENESS for f in faults):
        faults.append(late)
    return HeardRecording(recording, search, sightings, estimates, faults)


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

    drift = recording_drift(channels, float(rate), shape.p_AM, array.c)
    # What drifts belongs to no place, nor anything else that follows from delays.
    faults = (
        [drift]
        if drift
        else find_channel_faults(
            channels, array, sample_rate_hz=float(rate), band_hz=band
        )
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
        return _clearest([_heard(s, array, snapshots=1) for s in sounds])
    best = None
    for snapshots in _SNAPSHOTS:
        heard = _heard(recording, array, snapshots)
        if best is None or len(heard[2]) > len(best[2]):
            best = heard
        if len(heard[2]) >= min(_LEAST_ESTIMATES, len(heard[0].stretches)):
            break
    assert best is not None
    return best


def _clearest(heard: list[_Heard]) -> _Heard:
    """Of clear windows that hear most sounds, the one whose delays are known best."""
    most = max(len(sightings) for _, sightings, _ in heard)
    full = [each for each in heard if len(each[1]) == most]
    if not most:
        return full[0]
    agreement = [np.median([s.agreement for s in each[1]]) for each in full]
    variance = [np.median([np.trace(s.covariance) for s in each[1]]) for each in full]
    clear = np.array(agreement) > _CLEAR * max(agreement)
    return full[int(np.argmin(np.where(clear, variance, np.inf)))]


def _heard(recording: RecordingSpectra, array: KnownArray, snapshots: int) -> _Heard:
    search = RecordingSearch(
        recording,
        array.shape,
        array.c,
        snapshots,
        slack_s=_SLACK * array.budget.position_std / array.c,
        has_place=lambda delays: has_place(delays, array),
    )
    sightings = list(search.sightings())
    placed = ((s.t_s, place_source(s, array)) for s in sightings)
    found = [SourceEstimate.of(t_s, at) for t_s, at in placed if at is not None]
    return search, sightings, found
