"""Compares the levels of bins with those of weak bins, of echoes and of steady sound.

A bin is one frequency in one group of frames. All limits adapt from group to group, so
they are the same for a recording and for a stream.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

# _WEAKEST: share of the bins that do not vote because their power is lowest.
# _FOLLOW: rate at which the power limit of these bins adapts, per hop.
_WEAKEST, _FOLLOW = 0.3, 0.1

# _RISE: least power of a voting bin, as a multiple of the remaining echo.
# _DECAY_DB_S: decay of the echo, dB/s, as in a room with the reverberation time T60 = 1
#   s.
_RISE, _DECAY_DB_S = 1.6, 62.5

# Number of frequencies whose levels are stored.
_LEVELS = 24

# The level of the steady sound in a bin is a low quantile of its levels:
# - _STEADY_RISES_DB_S: rate at which it rises while the level is above it, dB/s.
# - _STEADY_FALLS_DB_S: rate at which it falls while the level is below it, dB/s.
# The quantile is the rate of rising over the sum of both rates.
_STEADY_RISES_DB_S, _STEADY_FALLS_DB_S = 6.0, 24.0

# Above the first level over the steady one, sound begins to stand out; above the
# second, it does so entirely, dB. The votes of Gaussian noise, which scatters by 3 dB,
# are mostly below the first.
_STANDS_OUT_DB = (7.0, 12.0)

_LEAST_POWER = 1e-30


def levels_db(powers: NDArray[np.float32]) -> NDArray[np.float64]:
    """Returns (g, 24) levels of single bins in dB, with equal numbers per octave."""
    chosen = powers[:, _kept_bins(powers.shape[1])].astype(np.float64)
    return np.asarray(10.0 * np.log10(np.maximum(chosen, _LEAST_POWER)))


@cache
def _kept_bins(count: int) -> NDArray[np.int64]:
    return np.rint(np.geomspace(1.0, count, _LEVELS)).astype(int) - 1


def no_levels() -> NDArray[np.float32]:
    """Returns the steady levels before the first group."""
    return np.empty(0, np.float32)


@cache
def a_weight(start: int, stop: int, per_hz: float) -> NDArray[np.float32]:
    """Returns the A-weighting of power (IEC 61672-1) at bins, at 1 kHz about 1."""
    f = np.arange(start, stop) / per_hz
    weight = 12194.0**2 * f**4 / ((f**2 + 20.6**2) * (f**2 + 12194.0**2))
    weight /= np.sqrt((f**2 + 107.7**2) * (f**2 + 737.9**2))
    return np.asarray((1.259 * weight) ** 2, dtype=np.float32)


def louder_bins(
    powers: NDArray[np.float32], level: float
) -> tuple[NDArray[np.bool_], float]:
    """Finds the (g, b) bins whose power is above an adaptive limit.

    The limit adapts from group to group, so that about 30 % of the bins are below it.
    The other result is the limit after the last group.
    """
    loud = np.zeros(powers.shape, dtype=bool)
    for row, kept in zip(powers, loud, strict=True):
        if not level > 0.0:
            level = float(np.quantile(row, _WEAKEST))
        np.greater(row, level, out=kept)
        below = 1.0 - kept.mean()
        level *= math.exp(_FOLLOW * (_WEAKEST - below))
    return loud, level


def risen_bins(
    powers: NDArray[np.float32], echo: NDArray[np.float32], hop_s: float
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """Finds the (g, b) bins that are louder than the echo of earlier sound.

    The other result is the (b,) largest possible echo after the last group.
    """
    decay = np.float32(10.0 ** (-0.1 * _DECAY_DB_S * hop_s))
    fresh = np.empty(powers.shape, dtype=bool)
    for row, kept in zip(powers, fresh, strict=True):
        np.greater(row, np.float32(_RISE) * echo, out=kept)
        echo = np.maximum(row, decay * echo)
    return fresh, echo


def standing_out(
    powers: NDArray[np.float32], steady_db: NDArray[np.float32], hop_s: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Returns how far the (g, b) bins stand out from steady sound, 0 to 1.

    The other result is the (b,) level of the steady sound after the last group, dB.
    """
    level = 10.0 * np.log10(np.maximum(powers, np.float32(_LEAST_POWER)))
    level = level.astype(np.float32)
    if not steady_db.size:
        steady_db = level[0]
    up, down = np.float32(_STEADY_RISES_DB_S * hop_s), _STEADY_FALLS_DB_S * hop_s
    over = np.empty_like(level)
    for row, above in zip(level, over, strict=True):
        steady_db = np.where(
            row > steady_db,
            np.minimum(row, steady_db + up),
            np.maximum(row, steady_db - np.float32(down)),
        )
        np.subtract(row, steady_db, out=above)
    first, last = _STANDS_OUT_DB
    return np.clip((over - first) / (last - first), 0.0, 1.0), steady_db
