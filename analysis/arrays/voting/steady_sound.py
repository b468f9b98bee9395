"""Detects steady sound, in which no time or frequency contains only one source.

The level of a steady sound in a narrow band scatters like that of Gaussian noise. For
the four windows of a vote, the scatter is 3.1 dB. It is smaller if several sources or
echoes reach the microphones. The level of speech and other changing sounds scatters by
5 dB or more, even in reverberant rooms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.direction_votes import DirectionVotes

# Largest scatter of the level of steady sound, dB. The value is halfway between noise
# and speech.
_STEADY_DB = 4.4

# A group of frames counts as sounding if its level is within _SOUNDS_DB of the quantile
# _LOUD_SHARE of all levels. The sound must last at least _LEAST_S, s.
_SOUNDS_DB, _LOUD_SHARE = 10.0, 0.9
_LEAST_S = 0.5

# Quantile of the scatter over the bands. If there is noise, only some bands contain the
# source.
_OF_BANDS = 0.75


def is_steady(votes: DirectionVotes) -> bool:
    """Returns whether a sound is so steady that its sources cannot be separated.

    Args:
        votes: Votes of a span of time, with the levels of the sound.

    Returns:
        True for a steady sound. False also if the sound lasts less than 0.5 s, because
        its steadiness is then unknown.
    """
    scatter = level_scatter_db(votes)
    return scatter is not None and scatter < _STEADY_DB


def level_scatter_db(votes: DirectionVotes) -> float | None:
    """Computes how much the level in narrow bands scatters while there is sound.

    Args:
        votes: Votes of a span of time, with the levels of the sound.

    Returns:
        Standard deviation of the level, dB; a quarter of the bands exceed it. None if
        the sound lasts less than 0.5 s.
    """
    levels, t_s = votes.group_levels_db, votes.group_t_s
    if len(levels) < 2:
        return None
    loud = levels[_sounds(levels)]
    if len(loud) * float(t_s[1] - t_s[0]) < _LEAST_S:
        return None
    return float(np.quantile(loud.std(axis=0), _OF_BANDS))


def steered_only(votes: DirectionVotes) -> DirectionVotes:
    """Removes the votes of single frequencies, and keeps those of the steered response.

    The steered response measures how well all frequencies together agree on a
    direction. If several steady sources sound together, single frequencies vote for
    directions between the sources.

    Args:
        votes: Votes of a span of time.

    Returns:
        Votes of the steered response, with all levels.
    """
    kept = votes.steered
    return DirectionVotes._make([*(each[kept] for each in votes[:5]), *votes[5:]])


def _sounds(levels_db: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Returns for each of g groups whether it is nearly as loud as the loudest."""
    whole = 10.0 * np.log10(np.sum(10.0 ** (0.1 * levels_db), axis=1))
    return np.asarray(whole >= np.quantile(whole, _LOUD_SHARE) - _SOUNDS_DB)
