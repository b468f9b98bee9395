"""Whether a sound is steady: then no time or frequency holds one source of it alone.

Of a stationary sound the level in a narrow band scatters as that of Gaussian noise
does, by 3.1 dB for the four windows of a vote, and by less where several sources or
echoes reach the microphones. Speech, and what else comes and goes, scatters by 5 dB and
more, in reverberation too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.voting.direction_votes import DirectionVotes

# Steady is what scatters by less; halfway, in dB, from noise to speech.
_STEADY_DB = 4.4

# It counts while it sounds: within this of its loudest parts, and for so long, s.
_SOUNDS_DB, _LOUD_SHARE = 10.0, 0.9
_LEAST_S = 0.5

# In noise only some of the bands hold the source.
_OF_BANDS = 0.75


def is_steady(votes: DirectionVotes) -> bool:
    """Whether too little of a sound comes and goes to tell its sources apart.

    Args:
        votes: Of a span of time, with its levels.

    Returns:
        False for what sounds for less than half a second: that is not known.
    """
    scatter = level_scatter_db(votes)
    return scatter is not None and scatter < _STEADY_DB


def level_scatter_db(votes: DirectionVotes) -> float | None:
    """By how much narrow bands scatter in level while there is sound.

    Args:
        votes: Of a span of time, with its levels.

    Returns:
        Standard deviation, dB, of which a quarter of the bands have more. None where
        it sounds for less than half a second.
    """
    levels, t_s = votes.group_levels_db, votes.group_t_s
    if len(levels) < 2:
        return None
    loud = levels[_sounds(levels)]
    if len(loud) * float(t_s[1] - t_s[0]) < _LEAST_S:
        return None
    return float(np.quantile(loud.std(axis=0), _OF_BANDS))


def steered_only(votes: DirectionVotes) -> DirectionVotes:
    """Without the votes of single bins, which point between steady sources.

    Args:
        votes: Of a span of time.

    Returns:
        Its steered votes, with all levels.
    """
    kept = votes.steered
    return DirectionVotes._make([*(each[kept] for each in votes[:5]), *votes[5:]])


def _sounds(levels_db: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(g,) groups that are nearly as loud as the loudest."""
    whole = 10.0 * np.log10(np.sum(10.0 ** (0.1 * levels_db), axis=1))
    return np.asarray(whole >= np.quantile(whole, _LOUD_SHARE) - _SOUNDS_DB)
