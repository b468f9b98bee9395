"""Random numbers that depend on a seed and a tick alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.random import SFC64, Generator
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import NDArray
from scipy.special import ndtri

__all__ = ["BEFORE_THE_RUN", "standard_normals", "tick_generator"]

#: Tick of what is drawn once, when a block is built; no run gets there.
BEFORE_THE_RUN = 2**62

_WORD = (1 << 64) - 1


@njit(cache=True)
def _scrambled(word):  # pragma: no cover  (compiled)
    """The finaliser of splitmix64: every bit of the result hangs on every bit."""
    word = np.uint64(word) + np.uint64(0x9E3779B97F4A7C15)
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@njit(cache=True)
def _tick_word(seed, tick):  # pragma: no cover  (compiled)
    """A word for a seed and a tick."""
    return _scrambled(_scrambled(seed) ^ tick)


class _TickSeed(ISeedSequence):
    """Three words from seed and tick; numpy's own sequence takes 15 us more."""

    def __init__(self, seed: int, tick: int) -> None:
        words = [_tick_word(np.uint64(seed & _WORD), np.uint64(tick & _WORD))]
        for _ in range(2):
            words.append(_scrambled(np.uint64(words[-1])))
        self._words = np.array(words, dtype=np.uint64)

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> Any:
        """What SFC64 asks for: three 64-bit words."""
        if n_words != 3 or np.dtype(dtype) != np.uint64:
            raise ValueError("a tick's seed serves SFC64 only")
        return self._words


def tick_generator(seed: int, tick: int) -> Generator:
    """A fresh generator for one tick of one block.

    Blocks keep no generator: a context that is run again, or a block that is
    read twice, must see the same noise. SFC64 is numpy's fastest; its start
    from hashed words makes the streams of different ticks independent.
    """
    # numpy's stub forgets ISeedSequence, which its documentation names.
    return Generator(SFC64(_TickSeed(seed, tick)))  # type: ignore[arg-type]


def _quantiles() -> NDArray[np.float32]:
    """(65536,) of the normal distribution, of variance 1/2."""
    quantiles = ndtri((np.arange(65_536) + 0.5) / 65_536)
    return (quantiles / np.std(quantiles) * np.sqrt(0.5)).astype(np.float32)


_QUANTILES = _quantiles()


@njit(cache=True)
def _add_quantiles(seed, tick, quantiles, out):  # pragma: no cover  (compiled)
    """Fills out from the words of splitmix64 after theirs, two numbers a word."""
    state, low = _tick_word(seed, tick), np.uint64(0xFFFF)
    for k in range(0, out.size, 2):
        word = _scrambled(state)
        state += np.uint64(0x9E3779B97F4A7C15)
        first, second = word & low, (word >> np.uint64(16)) & low
        out[k] = quantiles[first] + quantiles[second]
        if k + 1 < out.size:
            third, fourth = (word >> np.uint64(32)) & low, word >> np.uint64(48)
            out[k + 1] = quantiles[third] + quantiles[fourth]


def standard_normals(
    shape: tuple[int, int], seed: int, tick: int
) -> NDArray[np.float32]:
    """Many normal numbers for one tick of one block.

    Sums of two numbers from a table of 65 536 quantiles: several times as fast
    as numpy's, and normal up to 5.9 standard deviations, where they end. Their
    words are those of splitmix64 from a place hashed from seed and tick.
    """
    out = np.empty(shape, dtype=np.float32)
    words = np.uint64(seed & _WORD), np.uint64(tick & _WORD)
    _add_quantiles(*words, _QUANTILES, out.reshape(-1))
    return out
