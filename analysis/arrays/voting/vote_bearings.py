"""Computes the bearing of one source from its votes, and the errors of this bearing.

Early reflections turn all votes of a source alike while the source and the array rest,
so this error does not average out. It depends on the frequency, however, and the two
kinds of votes use different frequencies: single bins vote up to about the frequency at
which phases wrap, and the steered response uses the whole band. The difference of their
bearings therefore shows how large the error is.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from analysis.arrays.voting.vote_records import DirectionVotes

#: Standard deviation of the von Mises kernel, rad. A wider kernel merges talkers, and a
#: narrower kernel splits them.
KERNEL_RAD = math.radians(4.5)

#: Largest distance of the votes that are near a source, rad.
NEAR_RAD = math.radians(12.0)

# _ALIKE: number of votes of single bins that count as one independent vote. Groups of
#   frames overlap, and neighboring frequencies have similar errors.
# _INDEPENDENT: largest number of votes of one kind that count as independent.
_ALIKE, _INDEPENDENT = 9.0, 30.0

#: Least standard deviation of a bearing, rad.
LEAST_STD_RAD = math.radians(0.5)

# Errors that reflections cause in all votes:
# - _COMMON: error of one kind of votes per square of their scatter, 1/rad. Both this
#   error and the square of the scatter are proportional to the power of the
#   reflections.
# - _DIFFERENCE: error per standard deviation between the bearings of both kinds.
# The values are from simulated rooms with reverberation times of 0.2-0.6 s.
_COMMON, _DIFFERENCE = 3.5, 1.0

_STEPS = 6


class VotedBearing(NamedTuple):
    """The bearing of a source from its votes."""

    bearing: float
    """Bearing, rad."""
    own_std: float
    """Standard deviation of the bearing from errors that differ between votes, rad."""
    common_std: float
    """Standard deviation from errors that all votes have in common, rad."""

    @property
    def std(self) -> float:
        """Standard deviation of the bearing, rad."""
        return math.hypot(self.own_std, self.common_std)


class _Center(NamedTuple):
    """The middle of the votes of one kind."""

    bearing: float
    scatter: float
    independent: float
    """Number of independent votes."""

    @property
    def own_std(self) -> float:
        return self.scatter / math.sqrt(self.independent)

    @property
    def common_std(self) -> float:
        return _COMMON * self.scatter**2

    @property
    def variance(self) -> float:
        return self.own_std**2 + self.common_std**2


def voted_bearing(
    votes: DirectionVotes, steered: DirectionVotes | None, start: float
) -> VotedBearing:
    """Computes the bearing of a source.

    Args:
        votes: Votes of the source.
        steered: All votes of the steered response, if ``votes`` are those of single
            bins. None if there are none.
        start: Approximate bearing, rad.

    Returns:
        The bearing with its errors.
    """
    each = _ALIKE if steered is not None else 1.0
    first = _center(votes, start, each)
    if steered is not None:
        near = np.abs(wrapped(steered.azimuth - start)) < NEAR_RAD
        if near.any():
            second = _center(steered.part(near, slice(0)), start, 1.0)
            return _joined(first, second)
    own = math.hypot(first.own_std, LEAST_STD_RAD)
    return VotedBearing(first.bearing, own, first.common_std)


def _joined(first: _Center, second: _Center) -> VotedBearing:
    """Returns the mean of two bearings, weighted by their variances."""
    part = second.variance / (first.variance + second.variance)
    off = float(wrapped(first.bearing - second.bearing))
    own = math.hypot(part * first.own_std, (1.0 - part) * second.own_std)
    common = part * first.common_std + (1.0 - part) * second.common_std
    between = math.sqrt(part * (1.0 - part)) * off
    return VotedBearing(
        float(wrapped(second.bearing + part * off)),
        math.hypot(own, LEAST_STD_RAD),
        math.hypot(common, _DIFFERENCE * between),
    )


def _center(votes: DirectionVotes, bearing: float, each: float) -> _Center:
    """Finds the nearest maximum of the density of the votes, and their scatter.

    Of all votes, ``each`` count as one.
    """
    azimuth, weight = votes.azimuth, votes.weight
    for _ in range(_STEPS):
        off = wrapped(azimuth - bearing)
        pull = weight * np.exp((np.cos(off) - 1.0) / KERNEL_RAD**2)
        bearing += math.atan2(float(pull @ np.sin(off)), float(pull @ np.cos(off)))
    off = wrapped(azimuth - bearing)
    scatter = math.sqrt(float(weight @ off**2) / float(weight.sum()))
    independent = min(max(azimuth.size / each, 1.0), _INDEPENDENT)
    return _Center(float(wrapped(bearing)), max(scatter, LEAST_STD_RAD), independent)


def wrapped(angle: Any) -> Any:
    """Wraps an angle or an array of angles to (-pi, pi], rad."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)
