"""Joins the sources of the votes and the estimates of the stretches into one list.

The votes find the directions of all sources, as if they were far away. Each stretch of
a recording gives one estimate of a position. Every estimate belongs to one source of
the list, and the summary describes the first source, so both say the same. If votes and
estimates contradict each other, or if the votes cannot be relied upon, no source of the
list is certain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.heard_sources import FollowedSource, HeardSource, HeardSources
from analysis.arrays.place_medians import median, median_angle
from analysis.arrays.source_estimate import SourceEstimate
from systems.sound.array_shape import ArrayShape

# Estimates within this angle of a source belong to it, deg.
_NEAR_DEG = 15.0
# Longest time between an estimate and the track to which it belongs, s.
_NEAR_S = 0.3
# A source moves if its track turns by more than this, deg.
_MOVES_DEG = 20.0

# Largest confidence of a source that is doubted.
_NOT_SURE = 0.5

# Least share of a source in the power of the loudest for it to count as equally loud.
# The main source is then the one with most estimates.
_AS_LOUD = 0.5

# Votes hold for ranges of more than this, in apertures of the array. Nearer waves are
# so curved that they fit other directions.
_FAR_APERTURES = 1.5

# Least share of the estimates that belong to a source of the votes, and the least
# number of estimates for which this matters.
_LEAST_AGREED, _LEAST_ESTIMATES = 1.0 / 3.0, 4

# Least number of estimates of a source that is no side lobe or echo, and their least
# number as a share of those of the main source.
_LEAST_OWN, _LEAST_OF_MAIN = 3, 0.25

# Faults that do not change directions.
_HARMLESS = ("clipped", "inverted", "moves")


class AgreedSources(NamedTuple):
    """One list of sources, with their tracks and the estimates of the first source."""

    sources: list[HeardSource]
    """The sources. The main source is first."""
    main: list[int]
    """Numbers of the estimates of the main source. Empty if only votes are for it."""
    doubt: str | None
    """Why the sources cannot be counted. None if they can."""
    tracks: list[FollowedSource]
    """Tracks of the sources."""


class _Doubts(NamedTuple):
    """Reasons for doubt, the gravest first."""

    of_all: list[str]
    """Reasons for which no source is certain."""
    of_count: list[str]
    """Reasons for which only the number of sources is uncertain."""


def agree_sources(
    heard: HeardSources,
    estimates: Sequence[SourceEstimate],
    faults: Sequence[ChannelFault],
    shape: ArrayShape,
) -> AgreedSources:
    """Makes one list of the sources from votes, estimates and faults.

    If the array cannot measure bearings, the list is empty, and the main estimates are
    those near the most common elevation.
    """
    if any(e.bearing_deg is None for e in estimates):
        heights = np.array([e.elevation_deg or 0.0 for e in estimates])
        doubt = "the array cannot measure bearings"
        main = _common(heights) or list(range(len(estimates)))
        return AgreedSources([], main, doubt, [])
    of_source = [_belonging(s, heard.tracks, estimates) for s in heard.sources]
    doubts = _doubts(heard, estimates, faults, shape, of_source)
    reasons = doubts.of_all + doubts.of_count
    if not estimates and doubts.of_all:
        # Votes that cannot be relied upon are no answer by themselves.
        return AgreedSources([], [], reasons[0], [])
    sources, main = _joined(heard, estimates, shape, of_source, doubts)
    tracks = heard.tracks
    if doubts.of_all:
        sources = [_capped(source) for source in sources]
        tracks = [replace(t, confidence=min(t.confidence, _NOT_SURE)) for t in tracks]
    reasons = doubts.of_all + doubts.of_count
    return AgreedSources(sources, main, reasons[0] if reasons else None, tracks)


def _doubts(
    heard: HeardSources,
    estimates: Sequence[SourceEstimate],
    faults: Sequence[ChannelFault],
    shape: ArrayShape,
    of_source: list[list[int]],
) -> _Doubts:
    of_all = []
    if any(fault.kind not in _HARMLESS for fault in faults):
        of_all.append("the channels or the geometry have faults")
    if heard.steady:
        of_all.append("the sound is steady")
    if _is_near(estimates, shape):
        of_all.append("the source is near or inside the array")
    if heard.unfit:
        of_all.append("the phases do not fit this array")
    belong = {k for chosen in of_source for k in chosen}
    if (
        len(estimates) >= _LEAST_ESTIMATES
        and len(belong) < _LEAST_AGREED * len(estimates)
    ) or (estimates and not heard.sources):
        of_all.append("short stretches and the whole recording disagree")
    of_count = []
    if heard.beside_steady:
        of_count.append("one of the sounds is steady")
    if heard.needs_estimates and not all(_are_confirmed(of_source)):
        of_count.append(heard.needs_estimates)
    return _Doubts(of_all, of_count)


def _joined(
    heard: HeardSources,
    estimates: Sequence[SourceEstimate],
    shape: ArrayShape,
    of_source: list[list[int]],
    doubts: _Doubts,
) -> tuple[list[HeardSource], list[int]]:
    """Returns the sources, the main source first, and the estimates of this source."""
    belong = {k for chosen in of_source for k in chosen}
    near = _is_near(estimates, shape)
    missed = bool(estimates) and (near or 2 * len(belong) < len(estimates))
    common = _common(np.array([e.bearing_deg for e in estimates])) if missed else []
    if missed and not common and not of_source:
        common = list(range(len(estimates)))
    if common:
        # The votes missed the source of most estimates.
        if not doubts.of_all:
            doubts.of_all.append("short stretches and the whole recording disagree")
        rest = [
            source
            for source in heard.sources
            if not near and not _is_beside(source, [estimates[k] for k in common])
        ]
        share = len(common) / len(estimates)
        source = HeardSource(0.0, 0.0, None, None, share, _NOT_SURE)
        return [_measured(source, estimates, common), *rest], common
    if not heard.sources:
        return [], []
    first = _main(heard, of_source)
    sources = heard.sources.copy()
    if heard.needs_estimates:
        sources = [
            _measured(source, estimates, own) if sure else _capped(source)
            for source, own, sure in zip(
                sources, of_source, _are_confirmed(of_source), strict=True
            )
        ]
    main = _measured(sources.pop(first), estimates, of_source[first])
    return [main, *sources], of_source[first]


def _main(heard: HeardSources, of_source: list[list[int]]) -> int:
    """Returns the number of the main source.

    The votes of wide arrays and of echoes do not tell how loud each source is, so the
    main source is then the one with most estimates.
    """
    shares = np.array([source.share for source in heard.sources])
    counts = np.array([len(chosen) for chosen in of_source])
    alike = (heard.needs_estimates is not None) | (shares >= _AS_LOUD * shares.max())
    return int(np.lexsort((-shares, -counts, ~alike))[0])


def _are_confirmed(of_source: list[list[int]]) -> list[bool]:
    """Returns whether the estimates confirm each source."""
    most = max((len(chosen) for chosen in of_source), default=0)
    least = max(min(_LEAST_OWN, most), _LEAST_OF_MAIN * most, 1)
    return [len(chosen) >= least for chosen in of_source]


def _measured(
    source: HeardSource, estimates: Sequence[SourceEstimate], chosen: list[int]
) -> HeardSource:
    """Returns a source with the direction of its estimates, if there are any."""
    if not chosen:
        return source
    mine = [estimates[k] for k in chosen]
    bearing, std = median_angle([(e.bearing_deg, e.bearing_std_deg) for e in mine])
    height, height_std = median([(e.elevation_deg, e.elevation_std_deg) for e in mine])
    assert bearing is not None
    assert std is not None
    return replace(
        source,
        bearing_deg=bearing,
        bearing_std_deg=std,
        elevation_deg=height,
        elevation_std_deg=height_std,
    )


def _belonging(
    source: HeardSource,
    tracks: Sequence[FollowedSource],
    estimates: Sequence[SourceEstimate],
) -> list[int]:
    """Returns the numbers of the estimates near a source, or near its moving track."""
    moving = [
        track
        for track in tracks
        if np.ptp(np.unwrap(track.bearing_deg, period=360.0)) > _MOVES_DEG
        and _off_deg(np.array(track.bearing_deg), source.bearing_deg).min() < _NEAR_DEG
    ]
    return [
        k
        for k, estimate in enumerate(estimates)
        if _is_beside(source, [estimate])
        or any(_is_passed(track, estimate) for track in moving)
    ]


def _is_beside(source: HeardSource, estimates: Sequence[SourceEstimate]) -> bool:
    """Returns whether the middle of some estimates is near a source.

    The angle between two directions is less than that between their bearings if both
    are steep.
    """
    bearing, std = median_angle([(e.bearing_deg, e.bearing_std_deg) for e in estimates])
    height, _ = median([(e.elevation_deg, e.elevation_std_deg) for e in estimates])
    if bearing is None or std is None:
        return False
    steep = [abs(h) for h in (source.elevation_deg, height) if h is not None]
    level = np.cos(np.radians(min(steep))) if len(steep) == 2 else 1.0
    off = float(_off_deg(np.array(bearing), source.bearing_deg))
    return bool(off * level <= _NEAR_DEG)


def _is_passed(track: FollowedSource, estimate: SourceEstimate) -> bool:
    """Returns whether a track is near an estimate at its time."""
    k = int(np.argmin(np.abs(np.array(track.t_s) - estimate.t_s)))
    if abs(track.t_s[k] - estimate.t_s) > _NEAR_S or estimate.bearing_deg is None:
        return False
    off = _off_deg(np.array(track.bearing_deg[k]), estimate.bearing_deg)
    return bool(off <= _NEAR_DEG)


def _is_near(estimates: Sequence[SourceEstimate], shape: ArrayShape) -> bool:
    """Returns whether most estimates are within or close to the array."""
    ranges = [e.range_m for e in estimates if e.range_m is not None]
    near = sum(r < _FAR_APERTURES * shape.aperture_m for r in ranges)
    return bool(estimates) and 2 * near >= len(estimates)


def _common(angles_deg: NDArray[np.float64]) -> list[int]:
    """Returns the angles near the most common angle, if they are at least half."""
    if not angles_deg.size:
        return []
    near = _off_deg(angles_deg, angles_deg[:, np.newaxis]) <= _NEAR_DEG
    most = near[int(near.sum(axis=1).argmax())]
    return np.flatnonzero(most).tolist() if 2 * most.sum() >= len(near) else []


def _off_deg(
    first: NDArray[np.float64], second: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    return np.asarray(np.abs((first - second + 180.0) % 360.0 - 180.0))


def _capped(source: HeardSource) -> HeardSource:
    return replace(source, confidence=min(source.confidence, _NOT_SURE))
