"""Finds sources at the peaks of a histogram of votes for directions.

There are two kinds of votes: those of single frequencies, and those of the steered
response, which uses all frequencies together. The weight of a vote of a single
frequency is this frequency, because phases determine directions more exactly at higher
frequencies. If both kinds vote, there are two densities of votes. The sources are then
at the peaks of the geometric mean of both densities. Echoes cause errors in both
densities, but at different directions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.steep_votes import SteepVotes, steep_votes, without_steep
from analysis.arrays.voting.vote_bearings import (
    KERNEL_RAD,
    LEAST_STD_RAD,
    NEAR_RAD,
    voted_bearing,
    wrapped,
)
from analysis.arrays.voting.vote_records import DirectionVotes

_CELLS = 360

# _LEAST_HEIGHT: least height of a peak, as a share of the highest peak.
# _LEAST_PROMINENCE: least height of a peak above the higher of the two adjacent
#   valleys, as a share of the height of the peak.
_LEAST_HEIGHT, _LEAST_PROMINENCE = 0.18, 0.12

# Least share of a source in the votes, as a fraction of the largest share. A strong
# echo has few votes, but they agree, so its peak is narrow and high.
_LEAST_SHARE = 0.17

# _OF_BINS: exponent of the density of single bins in the geometric mean.
# _ANYWHERE: share of each density that is spread over all directions. It preserves a
#   source that has few votes in one of the two densities.
_OF_BINS, _ANYWHERE = 0.6, 0.1

# Least number of single bins that vote for a source.
_LEAST_VOTES = 15.0

# Factor for the least number of bins if the steered response also votes.
_AGREED = 0.5

# Least number of steered votes in total. Fewer votes may be random.
_LEAST_STEERED = 3

# Largest number of votes of a source that count as independent.
_INDEPENDENT = 30.0

# _RATES: rates of bearings to try, rad/s. Neighbors turn the votes of half a second by
#   less than the width of the kernel.
# _TURNS: least height of the highest peak at a rate, as a multiple of that at rest. Two
#   sources at rest that sound one after the other reach 2.
_RATES = np.radians(np.linspace(-120.0, 120.0, 17))
_TURNS = 2.2

# Standard deviation of Gaussian values over the median of their magnitudes.
_MAD_TO_STD = 1.4826

# _MOSTLY_STEADY: mean of how far the votes stand out from steady sound, below which
#   steady sound such as that of a fan has most of the votes, though a talker may be
#   louder.
# _STEADY_WEIGHT: share of the weight that votes for steady sound then keep.
_MOSTLY_STEADY, _STEADY_WEIGHT = 0.5, 0.1


class VotedSource(NamedTuple):
    """A direction from which sound came, with the votes for it."""

    bearing: float
    """Bearing, in (-pi, pi], rad."""
    bearing_std: float
    """Standard deviation of the bearing from the scatter of the votes and from the
    error common to all votes, rad. At most 30 votes count as independent."""
    elevation: float | None
    """Median elevation of the votes, rad. None if the array cannot measure it."""
    elevation_std: float | None
    """Scatter of the elevations of the votes, rad. Errors in common do not average out,
    so it is that of one vote."""
    share: float
    """Share of the total weight of all votes, 0 to 1."""
    power: float
    """Sum of the A-weighted power of its votes."""
    rises: float
    """Mean of how far its votes stand out from steady sound, 0 to 1."""
    votes: int
    """Number of votes near the peak."""
    confidence: float
    """Confidence that the source exists, 0 to 1. It is 1 if the peak is the highest and
    has at least three times the required number of votes."""
    rate: float = 0.0
    """Rate of the bearing, rad/s. It is 0 unless the source turns fast."""
    later_s: float = 0.0
    """Time of the bearing after the middle of the span of time, s. The loudest sound of
    the span determines the bearing."""
    common_std: float = 0.0
    """Part of ``bearing_std`` from reflections that move all votes alike, rad. It is
    about the same in consecutive spans of time."""
    steered_share: float | None = None
    """Share of the steered votes that are near the bearing, 0 to 1. None if only one
    kind of votes decides."""

    @property
    def own_variance(self) -> float:
        """Variance of the bearing without the common error, rad^2."""
        return max(self.bearing_std**2 - self.common_std**2, 0.0)


def gather_sources(
    votes: DirectionVotes, *, least_votes: float = _LEAST_VOTES, by_level: bool = True
) -> list[VotedSource]:
    """Finds the sources in a span of time. The source with the largest share is first.

    If enough single frequencies vote, they decide together with the steered response.
    Otherwise, the steered response decides alone. Two steady sounds at the same time
    cannot be separated, because no time or frequency contains only one of them. For
    less than one second of sound, ``least_votes`` must be smaller. If ``by_level`` is
    true and most votes are for steady sound, they count less than other votes.
    """
    votes = _weighed(votes) if by_level else votes
    single = ~votes.steered
    enough = np.count_nonzero(single) >= least_votes
    use = single if enough else votes.steered
    least = least_votes if enough else _LEAST_STEERED
    used, steered = votes.part(use, slice(0)), votes.part(votes.steered, slice(0))
    if used.azimuth.size < least:
        return []
    whole = float(used.weight.sum())
    agree = enough and steered.azimuth.size >= _LEAST_STEERED
    if agree:
        least *= _AGREED
    found = []
    steep = steep_votes(used.azimuth, used.elevation, used.weight)
    level = without_steep(used.elevation)
    if steep is not None:
        found = [_steep_source(used, steep, whole, least)]
        level = ~steep.dropped
    used = used.part(level, slice(0))
    steered = steered.part(without_steep(steered.elevation), slice(0))
    if used.azimuth.size:
        found += _level_sources(used, steered if agree else None, whole, least)
    found = [source for source in found if source.votes >= least]
    most = max((source.share for source in found), default=0.0)
    found = [source for source in found if source.share >= _LEAST_SHARE * most]
    return sorted(found, key=lambda source: -source.share)


def gather_turning(
    votes: DirectionVotes, t_s: float, *, least_votes: float
) -> list[VotedSource]:
    """Finds the sources in a short span of time with the middle t_s.

    While a source turns fast, its votes spread over many directions, and only parts of
    them form peaks. If the votes agree far better when they are turned back by a common
    rate, this is the rate of the sources.
    """
    single = ~votes.steered
    use = single if np.count_nonzero(single) >= least_votes else votes.steered
    if not use.any():
        return []
    after, weight = votes.t_s[use] - t_s, votes.weight[use]
    heights = [
        _density(wrapped(votes.azimuth[use] - rate * after), weight)[0].max()
        for rate in _RATES
    ]
    best = int(np.argmax(heights))
    rate = float(_RATES[best])
    if heights[best] < _TURNS * heights[_RATES.size // 2]:
        found = gather_sources(votes, least_votes=least_votes)
        return [source._replace(later_s=source.later_s - t_s) for source in found]
    turned = votes._replace(azimuth=wrapped(votes.azimuth - rate * (votes.t_s - t_s)))
    found = gather_sources(turned, least_votes=least_votes)
    return [source._replace(rate=rate, later_s=0.0) for source in found]


def _weighed(votes: DirectionVotes) -> DirectionVotes:
    """Reduces the weights of votes for steady sound if most votes are for it."""
    single = ~votes.steered if not votes.steered.all() else votes.steered
    if not single.any() or votes.rises[single].mean() >= _MOSTLY_STEADY:
        return votes
    kept = _STEADY_WEIGHT + (1.0 - _STEADY_WEIGHT) * votes.rises
    return votes._replace(weight=votes.weight * kept)


def _steep_source(
    votes: DirectionVotes, steep: SteepVotes, whole: float, least: float
) -> VotedSource:
    chosen = steep.chosen
    count = int(np.count_nonzero(chosen))
    std = steep.bearing_spread / math.sqrt(min(float(max(count, 1)), _INDEPENDENT))
    share = float(votes.weight[chosen].sum()) / whole
    sure = min(1.0, count / (3.0 * least))
    return VotedSource(
        bearing=steep.bearing,
        bearing_std=math.hypot(
            std, LEAST_STD_RAD / max(math.cos(steep.elevation), 0.01)
        ),
        elevation=steep.elevation,
        elevation_std=_scatter(votes.elevation[chosen]),
        share=share,
        power=float(votes.power[chosen].sum()),
        rises=float(votes.rises[chosen].mean()),
        votes=count,
        confidence=math.sqrt(min(1.0, 2.0 * share)) * sure,
        later_s=_mean_time(votes, chosen),
    )


def _level_sources(
    votes: DirectionVotes, steered: DirectionVotes | None, whole: float, least: float
) -> list[VotedSource]:
    """Finds the sources that are not steep, from votes and from steered votes."""
    azimuth, weight = votes.azimuth, votes.weight
    density, centers = _density(azimuth, weight)
    if steered is not None and steered.azimuth.size:
        other, _ = _density(steered.azimuth, steered.weight)
        density = density**_OF_BINS * other ** (1.0 - _OF_BINS)
    peaks = _peaks(density)
    if not peaks.size:
        return []
    found = []
    nearest = peaks[np.argmax(np.cos(azimuth[:, None] - centers[peaks]), axis=1)]
    for peak in peaks:
        source = _source(votes, steered, centers[peak], nearest == peak, whole)
        if source is not None:
            height = float(density[peak] / density.max())
            sure = min(1.0, source.votes / (3.0 * least))
            found.append(source._replace(confidence=math.sqrt(height) * sure))
    return found


def _density(
    azimuth: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the smoothed density of the votes in cells, and the bearings of these."""
    cells = np.floor((azimuth + math.pi) / (2.0 * math.pi) * _CELLS).astype(int)
    histogram = np.bincount(cells % _CELLS, weight, _CELLS)
    centers = -math.pi + (np.arange(_CELLS) + 0.5) * 2.0 * math.pi / _CELLS
    kernel = np.exp((np.cos(centers - centers[0]) - 1.0) / KERNEL_RAD**2)
    smooth = np.fft.irfft(np.fft.rfft(histogram) * np.fft.rfft(kernel), _CELLS)
    density = np.maximum(smooth, 0.0) / smooth.sum()
    return density + _ANYWHERE / _CELLS, centers


def _peaks(density: NDArray[np.float64]) -> NDArray[np.int64]:
    """Returns the cells of the peaks that are high and prominent."""
    from scipy.signal import find_peaks  # slow import, about 1 s

    # The circle is cut at the lowest cell, so that the cut splits no peak.
    first = int(np.argmin(density))
    turned = np.append(np.roll(density, -first), density[first])
    height = _LEAST_HEIGHT * density.max()
    peaks, seen = find_peaks(turned, height=height, prominence=0.0)
    stands_out = seen["prominences"] >= _LEAST_PROMINENCE * seen["peak_heights"]
    return np.asarray((peaks[stands_out] + first) % _CELLS)


def _source(
    votes: DirectionVotes,
    steered: DirectionVotes | None,
    bearing: float,
    nearest: NDArray[np.bool_],
    whole: float,
) -> VotedSource | None:
    """Makes the source at a peak from the votes that are nearest to this peak.

    The source is None if no vote is near the peak, for example if only the steered
    response has a peak there.
    """
    azimuth, weight = votes.azimuth, votes.weight
    near = np.abs(wrapped(azimuth - bearing)) < NEAR_RAD
    count = int(np.count_nonzero(near))
    mine = near & nearest
    if not mine.any():
        return None
    found = voted_bearing(votes.part(mine, slice(0)), steered, bearing)
    heights = votes.elevation[mine]
    measured = bool(np.isfinite(heights).all())
    return VotedSource(
        bearing=found.bearing,
        bearing_std=found.std,
        elevation=float(np.median(heights)) if measured else None,
        elevation_std=_scatter(heights) if measured else None,
        share=float(weight[mine].sum()) / whole,
        power=float(votes.power[mine].sum()),
        rises=float(votes.rises[mine].mean()),
        votes=count,
        confidence=0.0,
        later_s=_mean_time(votes, mine),
        common_std=found.common_std,
        steered_share=None if steered is None else _near_share(steered, bearing),
    )


def _mean_time(votes: DirectionVotes, chosen: NDArray[np.bool_]) -> float:
    return float(np.average(votes.t_s[chosen], weights=votes.weight[chosen]))


def _near_share(votes: DirectionVotes, bearing: float) -> float:
    near = np.abs(wrapped(votes.azimuth - bearing)) < NEAR_RAD
    return float(votes.weight[near].sum()) / max(float(votes.weight.sum()), 1e-12)


def _scatter(angles: NDArray[np.float64]) -> float:
    off = np.abs(angles - np.median(angles))
    return max(LEAST_STD_RAD, _MAD_TO_STD * float(np.median(off)))
