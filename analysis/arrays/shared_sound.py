"""Finds channels that have no sound in common with the others.

Two microphones record the same sound if their correlation is high. In a room with
echoes, the correlation falls with the distance of the microphones: the echoes at two
places agree only up to frequencies of about c / (2 d). A channel far from the others
may thus have a low correlation although its microphone is in order. The level of its
sound then still follows the levels of the others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.channel_fault import ChannelFault, FaultKind
from analysis.arrays.pair_correlations import PairCorrelations
from systems.sound.array_shape import ArrayShape

#: Limit of a correlation, as a multiple of the correlation of noise. Above it, two
#: channels share a sound.
COHERENT = 5.0
# Below this limit, two channels share nothing.
_INCOHERENT = 2.5

# A pair is a standard for a channel if its distance is at least this share of the
# distance between the channel and its nearest neighbor.
_AS_FAR = 0.8

# Least standard deviation of levels at which one channel can follow the others, dB.
_VARIES_DB = 2.0
# Least correlation of the levels of a channel that follows the others, and its least
# value in standard deviations of independent levels.
_FOLLOWS, _DEVIATIONS = 0.5, 3.0
# Largest correlation that is required of few frames.
_ALIKE = 0.9
# A level that varies less than this does not vary, dB.
_STEADY_DB = 1e-6

_DEAD = (
    "dead, it has nothing in common with the sound in the others; check its "
    "microphone, or leave it out of the geometry"
)
_APART = (
    "little in common with the others, so its delays are uncertain; in a room with "
    "echoes, place the microphones nearer to each other or to the source"
)


def strangers(
    measured: PairCorrelations, use: NDArray[np.int64], shape: ArrayShape
) -> list[ChannelFault]:
    """Finds channels whose correlations with all others are those of noise.

    A channel is dead if its level does not follow the levels of the others. If these do
    not vary, it is dead if pairs of others that are as far apart share a sound.
    Otherwise its microphone may only be
    far from the others. ``use`` lists the channels of ``measured``.
    """
    table = np.zeros((use.size, use.size))
    table[tuple(measured.pairs.T)] = measured.shared
    table += table.T
    best = table.max(axis=0)
    if use.size < 3:
        return []
    coherent = bool(best.max() > COHERENT)
    p = shape.p_AM[use]
    apart = np.linalg.norm(p[:, np.newaxis] - p, axis=2)
    np.fill_diagonal(apart, np.inf)
    strange = best < _INCOHERENT
    faults = []
    for k in np.flatnonzero(strange):
        others = np.flatnonzero(~strange)
        as_far = np.triu(apart[np.ix_(others, others)] >= _AS_FAR * apart[k].min(), 1)
        standard = np.any(table[np.ix_(others, others)][as_far] > COHERENT)
        follows = _follows(measured.levels, int(k))
        if not coherent and follows is not False:
            continue
        dead = not follows if follows is not None else bool(standard)
        channel, text = int(use[k]), _DEAD if dead else _APART
        kind: FaultKind = "dead" if dead else "apart"
        faults.append(ChannelFault(kind, (channel,), f"channel {channel + 1}: {text}"))
    return faults


def _follows(levels: NDArray[np.float64], k: int) -> bool | None:
    """Returns whether the level of a channel follows the levels of the others.

    It is None if fewer than two others vary together. The (f, n) ``levels`` are those
    of frames.
    """
    level_db = 20.0 * np.log10(np.maximum(levels, 1e-30))
    others = np.delete(level_db, k, axis=1)
    median_db = np.median(others, axis=1)
    if len(levels) < 3 or median_db.std() < _VARIES_DB:
        return None
    least = max(_FOLLOWS, min(_DEVIATIONS / np.sqrt(len(levels)), _ALIKE))
    alike = [_correlation(other, median_db) > least for other in others.T]
    if np.count_nonzero(alike) < 2:
        return None
    return _correlation(level_db[:, k], median_db) > least


def _correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    if min(one.std(), other.std()) < _STEADY_DB:
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])
