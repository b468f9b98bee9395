"""Estimates the bearing, elevation and range of a recorded source over time."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from analysis.arrays.array_geometry import ArrayGeometry, KnownArray
from analysis.arrays.body_delays import in_free_air
from analysis.arrays.call_search import CallSearch
from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.far_field import locate_far_source
from analysis.arrays.heard_calls import arrivals_alike, heard_calls
from analysis.arrays.heard_sources import (
    ECHOES,
    HeardSource,
    HeardSources,
    heard_sources,
)
from analysis.arrays.heard_tones import heard_tones, unclear_tone
from analysis.arrays.locate_result import LocatedSource
from analysis.arrays.loud_echo import loud_echo
from analysis.arrays.near_reflector import near_reflector
from analysis.arrays.prepared_recording import (
    LEAST_SIGHTINGS,
    SNAPSHOTS,
    prepared_recording,
)
from analysis.arrays.recorded_samples import RecordedSamples
from analysis.arrays.recording_search import RecordingSearch, Sighting
from analysis.arrays.recording_spectra import (
    AFTER_S,
    REVERBERATION_S,
    OnsetSpectra,
    RecordingSpectra,
)
from analysis.arrays.source_estimate import SourceEstimate
from analysis.arrays.source_placement import has_place, place_source
from analysis.arrays.tone_search import ToneSearch
from analysis.arrays.wavefront_misfit import late_channel

# Least agreement of the channels in a window, as a share of the agreement in the best
# window. Below this share, the window contains more echoes than direct sound.
_CLEAR = 0.5

# Largest error of the distances between microphones, in standard deviations.
_SLACK = 4.0

# Standard deviation of a bearing of which nothing is known, deg.
_ANY_STD_DEG = 180.0 / math.sqrt(3.0)
# _ULTRASOUND_HZ: lowest frequency of ultrasound, Hz.
# _CALLS_S: least travel time of sound along an array whose calls are looked for singly,
#   if nothing else is found, s.
# _WIDEST: largest number of periods of sound along the array for a grid of positions.
_ULTRASOUND_HZ, _CALLS_S, _WIDEST = 10_000.0, 0.005, 20_000.0


# Faults that make channels appear late, or leave out channels.
_EXPLAINS_LATENESS = ("size", "near", "dead", "slipped", "directional", "reflector")


class HeardRecording(NamedTuple):
    """Results for all stretches of a recording.

    A stretch is a run of snapshots. A snapshot is a short window of the recording.
    """

    recording: RecordingSpectra
    search: RecordingSearch | CallSearch | ToneSearch
    sightings: list[Sighting]
    """Delays of the stretches in which one source position stands out."""
    estimates: list[SourceEstimate]
    """Estimated source positions, for the sightings whose delays fit a position."""
    faults: list[ChannelFault]
    geometry: ArrayGeometry
    """The array without the microphones that are left out."""

    @property
    def band_hz(self) -> tuple[float, float]:
        """Band in use: that of the calls, or that of all snapshots."""
        if isinstance(self.search, CallSearch):
            return self.search.found_band_hz
        return self.recording.low_hz, self.recording.high_hz


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
    geometry = heard.geometry
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
        "band_hz": list(heard.band_hz),
        "sample_rate_hz": recorded.rate,
        "frame_s": search.stretch_s,
    }
    # No plane wave passes recorders far apart.
    sources = (
        HeardSources()
        if known.far_apart
        else heard_sources(
            spectra.channels,
            shape,
            known.c,
            spectra.sample_rate_hz,
            (spectra.low_hz, spectra.high_hz),
        )
    )
    if _is_brief(heard):
        sources = replace(sources, needs_estimates=ECHOES)
    result = LocatedSource(
        array,
        shape,
        heard.estimates,
        len(search.stretches),
        heard.faults,
        replace(sources, sources=[_with_errors(s, known) for s in sources.sources]),
        known.largest_range_error,
        recorded.remarks,
    )
    return replace(result, faults=heard.faults + _echoes(result, heard, known))


def _is_brief(heard: HeardRecording) -> bool:
    """Returns whether most votes may be those of echoes after short sounds."""
    if heard.recording.seconds < REVERBERATION_S:
        return True
    search = heard.search
    return isinstance(search, RecordingSearch) and isinstance(
        search.recording, OnsetSpectra
    )


def _echoes(
    result: LocatedSource, heard: HeardRecording, array: KnownArray
) -> list[ChannelFault]:
    """Returns a fault if the main source of a result is an echo."""
    main = result.main_source()
    doubtful = any(fault.kind != "clipped" for fault in heard.faults)
    if doubtful or main["bearing_deg"] is None:
        return []
    if not isinstance(heard.search, RecordingSearch):
        return []
    echo = loud_echo(
        heard.recording,
        array.shape,
        array.c,
        main["bearing_deg"],
        main["elevation_deg"],
    )
    return [] if echo is None else [echo]


def _with_errors(source: HeardSource, array: KnownArray) -> HeardSource:
    """Adds the errors of the array to the standard deviations of a source of votes."""
    shape, c = array.shape, array.c
    azimuth, height = np.radians([source.bearing_deg, source.elevation_deg or 0.0])
    level = np.array([math.cos(azimuth), math.sin(azimuth)]) * math.cos(height)
    u = np.append(level, math.sin(height))[: shape.p_AM.shape[1]]
    tau = -(shape.p_AM[1:] - shape.p_AM[0]) @ u / c
    errors = array.budget.delay_covariance(u, 0.0, shape, c)
    fix = locate_far_source(tau, errors, shape, c)
    elevation_std = source.elevation_std_deg
    if elevation_std is not None and fix.elevation_std is not None:
        elevation_std = math.hypot(elevation_std, math.degrees(fix.elevation_std))
    # Nothing is known of the bearing of a source straight above the array.
    bearing_std = math.hypot(source.bearing_std_deg, math.degrees(fix.bearing_std))
    return replace(
        source,
        bearing_std_deg=min(bearing_std, _ANY_STD_DEG),
        elevation_std_deg=elevation_std,
    )


def hear(recorded: RecordedSamples, geometry: ArrayGeometry) -> HeardRecording:
    """Finds the delays and positions of the source in a recording in memory."""
    recording, faults, used = prepared_recording(recorded, geometry)
    known = used.known
    search, sightings, estimates = _estimates(recording, known)
    if isinstance(search, CallSearch):
        faults += arrivals_alike(sightings, known)
        return HeardRecording(recording, search, sightings, estimates, faults, used)
    if isinstance(search, ToneSearch):
        if not estimates:
            faults += unclear_tone(search, known)
        return HeardRecording(recording, search, sightings, estimates, faults, used)
    # Faulty channels, and channels in the shadow of a body, have other spectra than the
    # others without any reflector.
    unlike = bool(faults) or known.shape.body is not None
    reflector = None if unlike else near_reflector(recording)
    if reflector is not None:
        faults.append(reflector)
    if not any(f.kind in _EXPLAINS_LATENESS for f in faults):
        late = late_channel(sightings, known)
        faults += [] if late is None else [late]
    return HeardRecording(recording, search, sightings, estimates, faults, used)


_Heard = tuple[
    RecordingSearch | CallSearch | ToneSearch, list[Sighting], list[SourceEstimate]
]


def _estimates(recording: RecordingSpectra, array: KnownArray) -> _Heard:
    """Locates each short sound of a recording, or else each stretch of time.

    If the recording does not mostly consist of short sounds, the stretches are the
    shortest ones that give enough estimates. If the microphones are far apart, or if
    the sound is ultrasound, each call is looked for in all channels instead.
    """
    if array.far_apart or recording.low_hz > _ULTRASOUND_HZ:
        calls = heard_calls(recording, array)
        wide = recording.high_hz * recording.travel_s > _WIDEST
        if calls[2] or wide or not recording.starts.size:
            return calls
    heard = _in_windows(recording, array)
    if not heard[2]:
        tones = heard_tones(recording, array)
        if tones[0].are_most:
            return tones
    if not heard[2] and recording.travel_s > _CALLS_S:
        return heard_calls(recording, array)
    return heard


def _in_windows(recording: RecordingSpectra, array: KnownArray) -> _Heard:
    """Locates the source in windows that contain its sound in all channels."""
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
    if sounds[0].are_most and any(s.starts.size for s in sounds):
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
    found = [
        SourceEstimate.of(t_s, at, array.centroid_m)
        for t_s, at in placed
        if at is not None
    ]
    return search, sightings, found
