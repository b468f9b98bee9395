"""Estimates the bearing, elevation and range of a recorded source over time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.arrays.array_geometry import ArrayGeometry, KnownArray
from analysis.arrays.body_delays import in_free_air
from analysis.arrays.channel_faults import ChannelFault
from analysis.arrays.heard_sources import heard_sources
from analysis.arrays.locate_result import LocatedSource, SourceEstimate
from analysis.arrays.prepared_recording import (
    LEAST_SIGHTINGS,
    SNAPSHOTS,
    prepared_recording,
)
from analysis.arrays.recorded_samples import RecordedSamples
from analysis.arrays.recording_search import RecordingSearch, Sighting
from analysis.arrays.recording_spectra import (
    AFTER_S,
    OnsetSpectra,
    RecordingSpectra,
)
from analysis.arrays.source_placement import has_place, place_source
from analysis.arrays.wavefront_misfit import late_channel

# Least agreement of the channels in a window, as a share of the agreement in the best
# window. Below this share, the window contains more echoes than direct sound.
_CLEAR = 0.5

# Largest error of the distances between microphones, in standard deviations.
_SLACK = 4.0

# Faults that make channels appear late.
_EXPLAINS_LATENESS = ("size", "near")


class HeardRecording(NamedTuple):
    """Results for all stretches of a recording.

    A stretch is a run of snapshots. A snapshot is a short window of the recording.
    """

    recording: RecordingSpectra
    search: RecordingSearch
    sightings: list[Sighting]
    """Delays of the stretches in which one source position stands out."""
    estimates: list[SourceEstimate]
    """Estimated source positions, for the sightings whose delays fit a position."""
    faults: list[ChannelFault]


def located(recorded: RecordedSamples, geometry: ArrayGeometry) -> LocatedSource:
    """Locates the source of a recording in each short stretch of time.

    Args:
        recorded: Recording that matches the array.
        geometry: Geometry of the microphones.

    Returns:
        The estimates over time.

    Raises:
        InputError: The recording cannot be used. The message states the cause and the
            remedy.
    """
    heard = hear(recorded, geometry)
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
        "sample_rate_hz": recorded.rate,
        "frame_s": search.stretch_s,
    }
    sources = heard_sources(
        spectra.channels,
        shape,
        known.c,
        spectra.sample_rate_hz,
        (spectra.low_hz, spectra.high_hz),
    )
    return LocatedSource(
        array,
        shape,
        heard.estimates,
        len(search.stretches),
        heard.faults,
        sources,
        known.largest_range_error,
    )


def hear(recorded: RecordedSamples, geometry: ArrayGeometry) -> HeardRecording:
    """Finds the delays and positions of the source in a recording in memory."""
    recording, faults = prepared_recording(recorded, geometry)
    known = geometry.known
    search, sightings, estimates = _estimates(recording, known)
    late = late_channel(sightings, known)
    if late is not None and not any(f.kind in _EXPLAINS_LATENESS for f in faults):
        faults.append(late)
    return HeardRecording(recording, search, sightings, estimates, faults)


_Heard = tuple[RecordingSearch, list[Sighting], list[SourceEstimate]]


def _estimates(recording: RecordingSpectra, array: KnownArray) -> _Heard:
    """Locates each short sound of a recording, or else each stretch of time.

    If the recording does not mostly consist of short sounds, the stretches are the
    shortest ones that give enough estimates.
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
    for snapshots in SNAPSHOTS:
        heard = _heard(recording, array, snapshots)
        if best is None or len(heard[2]) > len(best[2]):
            best = heard
        if len(heard[2]) >= min(LEAST_SIGHTINGS, len(heard[0].stretches)):
            break
    assert best is not None
    return best


def _clearest(heard: list[_Heard]) -> _Heard:
    """Chooses the window length whose delays have the smallest errors.

    The choice is among the window lengths that detect the most sounds. Window lengths
    that contain more echoes than direct sound are excluded.
    """
    most = max(len(sightings) for _, sightings, _ in heard)
    full = [each for each in heard if len(each[1]) == most]
    if not most:
        return full[0]
    agreement = [np.median([s.agreement for s in each[1]]) for each in full]
    variance = [np.median([np.trace(s.covariance) for s in each[1]]) for each in full]
    clear = np.array(agreement) > _CLEAR * max(agreement)
    return full[int(np.argmin(np.where(clear, variance, np.inf)))]


def _heard(recording: RecordingSpectra, array: KnownArray, snapshots: int) -> _Heard:
    shape = array.shape
    search = RecordingSearch(
        recording,
        shape,
        array.c,
        snapshots,
        slack_s=_SLACK * array.misplaced_m / array.c,
        has_place=lambda delays: has_place(in_free_air(delays, shape, array.c), array),
    )
    sightings = [in_free_air(s, shape, array.c) for s in search.sightings()]
    placed = ((s.t_s, place_source(s, array)) for s in sightings)
    found = [SourceEstimate.of(t_s, at) for t_s, at in placed if at is not None]
    return search, sightings, found
