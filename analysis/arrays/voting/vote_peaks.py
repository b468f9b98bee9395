"""Sources at the peaks of a histogram of directions.

A vote counts by its frequency: phases tell directions the better, the higher it is.
Where both single bins and the steered response vote, sources are at the peaks of a
geometric mean of their densities: echoes mislead each of them elsewhere.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.direction_votes import DirectionVotes

_CELLS = 360

# Deviation of the von Mises kernel: wider ones merge talkers, narrower ones split them.
_KERNEL_RAD = math.radians(4.5)

# Of a peak, as a share of the highest one, and above the higher of the valleys beside
# it, as a share of its own height.
_LEAST_HEIGHT, _LEAST_PROMINENCE = 0.18, 0.12

# Of a source's share of the votes, as a share of the largest one: the votes of a strong
# echo are few but agree, so that its peak is narrow and high.
_LEAST_SHARE = 0.17

# Exponent of the single bins' density in the mean, and what either one has everywhere,
# as a share of all: a source that one of them hardly hears is not lost.
_OF_BINS, _ANYWHERE = 0.6, 0.1

# Single bins that vote for a source, within this of its peak.
_LEAST_VOTES, _NEAR_RAD = 15.0, math.radians(12.0)

# Of bins near a peak that the steered response shows as well so much less will do.
_AGREED = 0.5

# Fewer steered votes than this in all are chance.
_LEAST_STEERED = 3

# Votes of one source have errors in common, by reflections: no more of them count.
_INDEPENDENT = 30.0
_LEAST_STD_RAD = math.radians(0.5)

_STEPS = 4


class VotedSource(NamedTuple):
    """A direction from which sound came."""

    bearing: float
    """rad, in (-pi, pi]."""
    bearing_std: float
    """By the scatter of its votes, of which 30 count at most, rad."""
    elevation: float | None
    """Median of its votes, rad; None where the array does not tell it."""
    share: float
    """Of all votes' weight, 0 to 1."""
    votes: int
    """Near its peak."""
    confidence: float
    """0 to 1: 1 for a peak as high as the highest that as many votes as are asked for
    stand behind several times over."""


def gather_sources(
    votes: DirectionVotes, *, least_votes: float = _LEAST_VOTES
) -> list[VotedSource]:
    """The sources of a span of time.

    Single bins and the steered response decide together where enough bins vote, and
    the steered response alone where not.

    Args:
        votes: Of that time.
        least_votes: Single bins that vote for a source; for less than a second of
            sound fewer are to be had.

    Returns:
        The sources, the one with most votes first. Two steady sounds at once are not
        told apart: no time or frequency holds one of them alone.
    """
    single = ~votes.steered
    enough = np.count_nonzero(single) >= least_votes
    use = single if enough else votes.steered
    least = least_votes if enough else _LEAST_STEERED
    azimuth, weight = votes.azimuth[use], votes.weight[use]
    if azimuth.size < least:
        return []
    density, centres = _density(azimuth, weight)
    if enough and np.count_nonzero(votes.steered) >= _LEAST_STEERED:
        other, _ = _density(votes.azimuth[votes.steered], votes.weight[votes.steered])
        density = density**_OF_BINS * other ** (1.0 - _OF_BINS)
        least *= _AGREED
    found = []
    peaks = _peaks(density)
    if not peaks.size:
        return []
    nearest = peaks[np.argmax(np.cos(azimuth[:, None] - centres[peaks]), axis=1)]
    for peak in peaks:
        source = _source(
            azimuth, votes.elevation[use], weight, centres[peak], nearest == peak
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
    """(c,) density of the votes in the cells of the circle, and their bearings."""
    cells = np.floor((azimuth + math.pi) / (2.0 * math.pi) * _CELLS).astype(int)
    histogram = np.bincount(cells % _CELLS, weight, _CELLS)
    centres = -math.pi + (np.arange(_CELLS) + 0.5) * 2.0 * math.pi / _CELLS
    kernel = np.exp((np.cos(centres - centres[0]) - 1.0) / _KERNEL_RAD**2)
    smooth = np.fft.irfft(np.fft.rfft(histogram) * np.fft.rfft(kernel), _CELLS)
    density = np.maximum(smooth, 0.0) / smooth.sum()
    return density + _ANYWHERE / _CELLS, centres


def _peaks(density: NDArray[np.float64]) -> NDArray[np.int64]:
    """Cells of the peaks that are high and stand out."""
    from scipy.signal import find_peaks  # takes a second, which not everyone needs

    # From the lowest cell around to itself nothing is cut.
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
    """The source at a peak, of the votes that are nearer to it than to others.

    None where there are none: a peak of the steered response beside single bins.
    """
    near = np.abs(_wrapped(azimuth - bearing)) < _NEAR_RAD
    count = int(np.count_nonzero(near))
    mine = near & nearest
    if not mine.any():
        return None
    a, w = azimuth[mine], weight[mine]
    for _ in range(_STEPS):
        off = _wrapped(a - bearing)
        pull = w * np.exp((np.cos(off) - 1.0) / _KERNEL_RAD**2)
        bearing += math.atan2(float(pull @ np.sin(off)), float(pull @ np.cos(off)))
    off = _wrapped(a - bearing)
    spread = math.sqrt(float(w @ off**2) / float(w.sum()))
    std = spread / math.sqrt(min(float(a.size), _INDEPENDENT))
    heights = elevation[mine]
    return VotedSource(
        bearing=float(_wrapped(np.array(bearing))),
        bearing_std=math.hypot(std, _LEAST_STD_RAD),
        elevation=float(np.median(heights)) if np.isfinite(heights).all() else None,
        share=float(w.sum() / weight.sum()),
        votes=count,
        confidence=0.0,
    )


def _wrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """In (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)
