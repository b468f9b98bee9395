"""Locates the calls in a recording one by one."""

from __future__ import annotations

import numpy as np

from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.call_placement import place_call
from analysis.arrays.call_search import CallSearch
from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.recording_search import Sighting
from analysis.arrays.recording_spectra import RecordingSpectra
from analysis.arrays.source_estimate import SourceEstimate

# Delays below this share of the longest possible delay are suspicious. In a compact
# array, calls with such delays are not located, because something else is wrong.
_ALIKE, _ALIKE_IN_COMPACT = 0.01, 0.1


def heard_calls(
    recording: RecordingSpectra, array: KnownArray
) -> tuple[CallSearch, list[Sighting], list[SourceEstimate]]:
    """Finds the delays and the places of the calls in a recording."""
    search = CallSearch.of(recording, array)
    sightings = search.sightings()
    least = 0.0 if array.far_apart else _ALIKE_IN_COMPACT * recording.travel_s
    placed = ((s.t_s, place_call(s, array)) for s in sightings if _span(s) >= least)
    found = [
        SourceEstimate.of(t_s, at, array.centroid_m)
        for t_s, at in placed
        if at is not None
    ]
    return search, sightings, found


def arrivals_alike(sightings: list[Sighting], array: KnownArray) -> list[ChannelFault]:
    """Reports that all calls arrive everywhere at about the same time."""
    longest = array.shape.max_delay(array.c)
    spans = [_span(sighting) for sighting in sightings]
    if not spans or max(spans) > _ALIKE * longest:
        return []
    text = (
        f"microphones: all sounds arrive within {1e3 * max(spans):.2g} ms, and an "
        f"array of {array.shape.aperture_m:.3g} m can have delays of "
        f"{1e3 * longest:.3g} ms; give positions in m, unless the source is equally "
        "far from all microphones"
    )
    return [ChannelFault("size", (), text)]


def _span(sighting: Sighting) -> float:
    """Returns the time from the first to the last arrival of a sound, s."""
    return float(np.ptp(np.append(sighting.tau, 0.0)))
