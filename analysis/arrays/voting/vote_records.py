"""Holds votes for directions of sound, and the levels of the sound over time."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.bin_levels import levels_db


class DirectionVotes(NamedTuple):
    """Votes for directions in the order of time, and levels of the sound over time.

    A vote is an estimated direction of the sound in a group of consecutive frames.
    """

    t_s: NDArray[np.float64]
    """(k,) middles of the groups of the votes, s from the first sample."""
    azimuth: NDArray[np.float64]
    """(k,) azimuths from +x toward +y, in (-pi, pi], rad. They are on the side of
    ``shape.ahead``."""
    elevation: NDArray[np.float64]
    """(k,) elevations above the x-y plane, rad. NaN if the array cannot measure them.
    """
    weight: NDArray[np.float64]
    """(k,) weights. The weight of a single bin is its frequency, Hz. The weight of a
    steered vote is its response, 0 to 1."""
    power: NDArray[np.float64]
    """(k,) A-weighted power of the bin of each vote, or of the whole group for a
    steered vote."""
    rises: NDArray[np.float64]
    """(k,) how far the sound stands out from the steady level of its bin, 0 to 1."""
    steered: NDArray[np.bool_]
    """(k,) True for a vote of the steered response, False for a vote of a single bin.
    """
    group_t_s: NDArray[np.float64]
    """(g,) middles of all groups of frames, s from the first sample."""
    group_levels_db: NDArray[np.float64]
    """(g, 24) power of all channels at 24 frequencies of the band, dB relative to the
    unit of the samples."""
    group_fits: NDArray[np.float64]
    """(g, 2) number of bins with one wave in each group, and number of those in which
    the phases are clearly those of a plane wave at the speed of sound."""

    def part(self, votes: Any, groups: slice) -> DirectionVotes:
        """Returns the votes with some indices, and the levels of some groups."""
        kept = [each[votes] for each in self[:7]] + [each[groups] for each in self[7:]]
        return DirectionVotes._make(kept)


def join_votes(parts: list[DirectionVotes]) -> DirectionVotes:
    """Joins the votes for directions from several blocks in the order of time."""
    if not parts:
        return no_votes()
    joined = DirectionVotes._make(
        np.concatenate(each) for each in zip(*parts, strict=True)
    )
    order = np.argsort(joined.t_s, kind="stable")
    return joined.part(order, slice(None))


def no_votes() -> DirectionVotes:
    """Returns votes of nothing."""
    none = np.empty(0)
    return cast_of(none, none, none, none, none, none, steered=False)


def cast_of(
    t_s: NDArray[np.float64],
    azimuth: NDArray[np.float64],
    elevation: NDArray[np.float64],
    weight: NDArray[np.float64],
    power: NDArray[np.float64],
    rises: NDArray[np.float64],
    *,
    steered: bool,
) -> DirectionVotes:
    """Makes votes of one kind, without the times and levels of the groups."""
    return DirectionVotes(
        t_s,
        azimuth,
        elevation,
        weight,
        np.asarray(power, dtype=np.float64),
        np.asarray(rises, dtype=np.float64),
        np.full(len(t_s), steered),
        np.empty(0),
        levels_db(np.empty((0, 1), np.float32)),
        np.empty((0, 2)),
    )
