"""Locates continuous tones, and names the tones whose direction is ambiguous."""

from __future__ import annotations

import math

from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.far_field import locate_far_source
from analysis.arrays.recording_search import Sighting
from analysis.arrays.recording_spectra import RecordingSpectra
from analysis.arrays.source_estimate import SourceEstimate
from analysis.arrays.source_placement import place_source
from analysis.arrays.tone_search import Tone, ToneSearch

# Largest number of directions in a message, and of frequencies.
_MOST_NAMED = 4

# Least share of the stretches with an ambiguous tone that is reported.
_OFTEN = 0.5


def heard_tones(
    recording: RecordingSpectra, array: KnownArray
) -> tuple[ToneSearch, list[Sighting], list[SourceEstimate]]:
    """Finds the delays and the directions of the tones in a recording."""
    search = ToneSearch(recording, array)
    sightings = search.sightings()
    placed = ((s.t_s, place_source(s, array)) for s in sightings)
    found = [
        SourceEstimate.of(t_s, at, array.centroid_m)
        for t_s, at in placed
        if at is not None
    ]
    return search, sightings, found


def unclear_tone(search: ToneSearch, array: KnownArray) -> list[ChannelFault]:
    """Reports a tone whose phases fit several directions, or none."""
    tones = [tone for _, tone in search.tones if len(tone.candidates) > 1]
    if len(tones) < _OFTEN * len(search.stretches) or not tones:
        return _among_echoes(search)
    tone = min(tones, key=lambda tone: len(tone.candidates))
    names = ", ".join(
        f"{line.frequency_hz:.0f}"
        for line in sorted(tone.lines, key=lambda line: line.frequency_hz)[:_MOST_NAMED]
    )
    least = array.shape.distances_m.min()
    where = _named(tone, array)
    text = (
        f"sound: a tone of {names} Hz, whose direction is ambiguous{where}; use a "
        f"sound with more frequencies, or tones below {array.c / (2.0 * least):.0f} Hz"
    )
    return [ChannelFault("tone", (), text)]


def _among_echoes(search: ToneSearch) -> list[ChannelFault]:
    names = ", ".join(f"{f:.0f}" for f in sorted(search.lines_hz[:_MOST_NAMED]))
    text = (
        f"sound: a tone of {names} Hz, whose phases fit no single direction, because "
        "echoes or errors of the positions disturb them; use a sound with more "
        "frequencies"
    )
    return [ChannelFault("tone", (), text)]


def _named(tone: Tone, array: KnownArray) -> str:
    """Returns the directions that fit a tone, as text, if they are few."""
    if len(tone.candidates) > _MOST_NAMED or "bearing" not in array.shape.angles:
        return ""
    covariance = tone.lines[0].covariance
    fixes = [
        locate_far_source(tau, covariance, array.shape, array.c)
        for tau in tone.candidates
    ]
    bearings = sorted(round(math.degrees(fix.bearing)) for fix in fixes)
    return f" (bearing {' or '.join(map(str, bearings))} deg)"
