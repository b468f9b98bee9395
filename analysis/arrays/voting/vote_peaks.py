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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.direction_votes import DirectionVotes

_CELLS = 360

# Standard deviation of the von Mises kernel, rad. A wider kernel merges talkers, and a
# narrower kernel splits them.
_KERNEL_RAD = math.radians(4.5)

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

# _LEAST_VOTES: least number of single bins that vote for a source.
# _NEAR_RAD: largest distance of these votes from the peak, rad.
_LEAST_VOTES, _NEAR_RAD = 15.0, math.radians(12.0)

# Factor for the least number of bins if the steered response also votes.
_AGREED = 0.5

# Least number of steered votes in total. Fewer votes may be random.
_LEAST_STEERED = 3

# Largest number of votes of a source that count as independent.
_INDEPENDENT = 30.0

# Error that reflections cause in all votes together, per square of the scatter of the
# votes, 1/rad. Both this error and the square of the scatter are proportional to the
# power of the reflections. The value is from simulated rooms with reverberation times
# of 0.2-0.6 s.
_COMMON = 3.0
_LEAST_STD_RAD = math.radians(0.5)

_STEPS = 4


class VotedSource(NamedTuple):
    """A direction from which sound came, with the votes for it."""

    bearing: float
    """Bearing, in (-pi, pi], rad."""
    bearing_std: float
    """Standard deviation of the bearing from the scatter of the votes and from the
    error common to all votes, rad. At most 30 votes count as independent."""
    elevation: float | None
    """Median elevation of the votes, rad. None if the array cannot measure it."""
    share: float
    """Share of the total weight of all votes, 0 to 1."""
    votes: int
    """Number of votes near the peak."""
    confidence: float
    """Confidence that the source exists, 0 to 1. It is 1 if the peak is the highest and
    has at least three times the required number of votes."""
    common_std: float = 0.0
    """Part of ``bearing_std`` from reflections that move all votes alike, rad. It is
    about the same in consecutive spans of time."""

    @property
    def own_variance(self) -> float:
        """Variance of the bearing without the common error, rad^2."""
        return max(self.bearing_std**2 - self.common_std**2, 0.0)


def gather_sources(
    votes: DirectionVotes, *, least_votes: float = _LEAST_VOTES
) -> list[VotedSource]:
    """Finds the sources in a span of time. The source with the largest share is first.

    If enough single frequencies vote, they decide together with the steered response.
    Otherwise, the steered response decides alone. Two steady sounds at the same time
    cannot be separated, because no time or frequency contains only one of them. For
    less than one second of sound, ``least_votes`` must be smaller.
    """
    single = ~votes.steered
    enough = np.count_nonzero(single) >= least_votes
    use = single if enough else votes.steered
    least = least_votes if enough else _LEAST_STEERED
    azimuth, weight = votes.azimuth[use], votes.weight[use]
    if azimuth.size < least:
        return []
    density, centers = _density(azimuth, weight)
    if enough and np.count_nonzero(votes.steered) >= _LEAST_STEERED:
        other, _ = _density(votes.azimuth[votes.steered], votes.weight[votes.steered])
        density = density**_OF_BINS * other ** (1.0 - _OF_BINS)
        least *= _AGREED
    found = []
    peaks = _peaks(density)
    if not peaks.size:
        return []
    nearest = peaks[np.argmax(np.cos(azimuth[:, None] - centers[peaks]), axis=1)]
    for peak in peaks:
        source = _source(
            azimuth, votes.elevation[use], weight, centers[peak], nearest == peak
        )
        if source is not None and source.votes >= least:
            height = float(density[peak] / density.max())
            sure = min(1.0, source.votes / (3.0 * least))
            found.append(source._replace(confidence=math.sqrt(height) * sure))
    most = max((source.share for source in found), default=0.0)
    found = [source for source in found if source.share >= _LEAST_SHARE * most]
    return sorted(found, key=lambda source: -source.share)


def _density(
    azimuth: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the smoothed density of the votes in cells, and the bearings of these."""
    cells = np.floor((azimuth + math.pi) / (2.0 * math.pi) * _CELLS).astype(int)
    histogram = np.bincount(cells % _CELLS, weight, _CELLS)
    centers = -math.pi + (np.arange(_CELLS) + 0.5) * 2.0 * math.pi / _CELLS
    kernel = np.exp((np.cos(centers - centers[0]) - 1.0) / _KERNEL_RAD**2)
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
    azimuth: NDArray[np.float64],
    elevation: NDArray[np.float64],
    weight: NDArray[np.float64],
    bearing: float,
    nearest: NDArray[np.bool_],
) -> VotedSource | None:
    """Makes the source at a peak from the votes that are nearest to this peak.

    The source is None if no vote is near the peak, for example if only the steered
    response has a peak there.
    """
    near = np.abs(wrapped(azimuth - bearing)) < _NEAR_RAD
    count = int(np.count_nonzero(near))
    mine = near & nearest
    if not mine.any():
        return None
    a, w = azimuth[mine], weight[mine]
    for _ in range(_STEPS):
        off = wrapped(a - bearing)
        pull = w * np.exp((np.cos(off) - 1.0) / _KERNEL_RAD**2)
        bearing += math.atan2(float(pull @ np.sin(off)), float(pull @ np.cos(off)))
    off = wrapped(a - bearing)
    spread = math.sqrt(float(w @ off**2) / float(w.sum()))
    std = spread / math.sqrt(min(float(a.size), _INDEPENDENT))
    common = _COMMON * spread**2
    heights = elevation[mine]
    return VotedSource(
        bearing=float(wrapped(bearing)),
        bearing_std=math.hypot(std, _LEAST_STD_RAD, common),
        elevation=float(np.median(heights)) if np.isfinite(heights).all() else None,
        share=float(w.sum() / weight.sum()),
        votes=count,
        confidence=0.0,
        common_std=common,
    )


def wrapped(angle: Any) -> Any:
    """Wraps an angle or an array of angles to (-pi, pi], rad."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)
