"""Random numbers that depend on a seed and a tick alone."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.random import SFC64, Generator
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import NDArray
from scipy.special import ndtri

from systems.framework.compiling import njit

#: Tick of what is drawn once, when a block is built; no run gets there.
BEFORE_THE_RUN = 2**62

_WORD = (1 << 64) - 1

# By which the state of splitmix64 grows from word to word.
_STEP = np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True)
def _scrambled(word: int | np.uint64) -> np.uint64:  # pragma: no cover  (compiled)
    """The finaliser of splitmix64: every bit of the result hangs on every bit."""
    word = np.uint64(word) + _STEP
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@njit(cache=True)
def _tick_word(
    seed: int | np.uint64, tick: int | np.uint64
) -> np.uint64:  # pragma: no cover  (compiled)
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

    Args:
        seed: Of the block.
        tick: Number of the tick; 0 is at 0 s.

    Returns:
        A generator whose numbers only these two decide.
    """
    # numpy's stub forgets ISeedSequence, which its documentation names.
    return Generator(SFC64(_TickSeed(seed, tick)))  # type: ignore[arg-type]


def _quantiles() -> NDArray[np.float32]:
    """(65536,) of the normal distribution, of variance 1/2."""
    quantiles = ndtri((np.arange(65_536) + 0.5) / 65_536)
    return (quantiles / np.std(quantiles) * np.sqrt(0.5)).astype(np.float32)


_QUANTILES = _quantiles()


@njit(cache=True)
def _add_quantiles(
    seed: np.uint64,
    tick: np.uint64,
    quantiles: NDArray[np.float32],
    out: NDArray[np.float64],
) -> None:  # pragma: no cover  (compiled)
    """Fills out from the words of splitmix64 after theirs, two numbers a word."""
    state, low = _tick_word(seed, tick), np.uint64(0xFFFF)
    for k in range(0, out.size, 2):
        word = _scrambled(state)
        state += _STEP
        first, second = word & low, (word >> np.uint64(16)) & low
        out[k] = quantiles[first] + quantiles[second]
        if k + 1 < out.size:
            third, fourth = (word >> np.uint64(32)) & low, word >> np.uint64(48)
            out[k + 1] = quantiles[third] + quantiles[fourth]


def standard_normals(
    shape: tuple[int, int], seed: int, tick: int
) -> NDArray[np.float64]:
    """A few normal numbers for one tick of one block; for many see ``frame_noise``.

    Sums of two numbers from a table of 65 536 quantiles, normal up to 5.9 standard
    deviations, where they end. Their words are those of splitmix64 from a place
    hashed from seed and tick.

    Args:
        shape: Rows and columns.
        seed: Of the block.
        tick: Number of the tick.

    Returns:
        (rows, columns) of unit variance.
    """
    out = np.empty(shape)
    words = np.uint64(seed & _WORD), np.uint64(tick & _WORD)
    _add_quantiles(*words, _QUANTILES, out.reshape(-1))
    return out


class TickNoise(NamedTuple):
    """What ``standard_normals`` of a block are made from, in compiled code."""

    seed: np.uint64
    quantiles: NDArray[np.float32]


def tick_noise(seed: int) -> TickNoise:
    """That of a block.

    Args:
        seed: Of the block.

    Returns:
        For ``tick_normals``.
    """
    return TickNoise(np.uint64(seed & _WORD), _QUANTILES)


@njit(cache=True)
def tick_normals(
    noise: TickNoise, tick: int, rows: int, columns: int
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """``standard_normals`` of a tick.

    They are double precision: the product of a Python float and a number of single
    precision is single precision in numpy and double precision in compiled code, so
    that the two engines would differ.

    Args:
        noise: Of the block.
        tick: Number of the tick.
        rows: How many.
        columns: How many.

    Returns:
        (rows, columns) of unit variance.
    """
    out = np.empty((rows, columns))
    _add_quantiles(noise.seed, np.uint64(tick), noise.quantiles, out.reshape(-1))
    return out


def _polynomial(function: Any, low: float, high: float, degree: int) -> tuple[Any, ...]:
    """Coefficients in single precision, lowest first, of a fit at Chebyshev points."""
    fit = np.polynomial.Chebyshev.interpolate(function, degree, [low, high])
    coefficients = fit.convert(kind=np.polynomial.Polynomial).coef
    return tuple(coefficients.astype(np.float32))


# ln(1 + f) / f for 1 + f between the roots of 1/2 and of 2; sin(a) / a and cos(a) over
# a^2 up to 45 degrees. All are right to single precision.
_LN = _polynomial(lambda f: np.log1p(f) / f, 2.0**-0.5 - 1.0, 2.0**0.5 - 1.0, 8)
_SINC = _polynomial(lambda y: np.sinc(np.sqrt(y) / np.pi), 0.0, (np.pi / 4.0) ** 2, 3)
_COS = _polynomial(lambda y: np.cos(np.sqrt(y)), 0.0, (np.pi / 4.0) ** 2, 4)
_LN_2 = np.float32(np.log(2.0))
_ANGLE_UNIT = np.float32(np.pi / 4.0 / 2.0**23)
_ROOT_HALF_BITS = np.float32(np.sqrt(0.5)).view(np.int32)

# Pairs of numbers that are made at once: their scratch fits the fastest cache.
_PAIRS = 625


@njit(cache=True, error_model="numpy")
def _normal_pairs(
    state: np.uint64,
    uniform: NDArray[np.float32],
    angle: NDArray[np.float32],
    turn: NDArray[np.int32],
    out: NDArray[np.float32],
) -> None:  # pragma: no cover  (compiled)
    """Fills out (2 n,) from n words: the method of Box and Muller (1958).

    Of each word 23 bits decide on the radius, 24 on the angle within an eighth of
    the circle to either side of an axis, and 3 on the axis and the signs. Every
    step vectorises, which the functions of ``math`` would not.

    Args:
        state: Of splitmix64, before these words.
        uniform: (n,) float32, scratch.
        angle: (n,) float32, scratch.
        turn: (n,) int32, scratch.
        out: First the n first numbers of the pairs, then their partners.
    """
    n, half = uniform.size, np.float32(0.5)
    for k in range(n):
        word = _scrambled(state + np.uint64(k) * _STEP)
        share = np.int32(word >> np.uint64(41))
        uniform[k] = (np.float32(share) + half) * np.float32(2.0**-23)
        share = np.int32(word >> np.uint64(8)) >> np.int32(8)
        angle[k] = (np.float32(share) + half) * _ANGLE_UNIT
        turn[k] = np.int32(word & np.uint64(7))
    bits = uniform.view(np.int32)
    for k in range(n):
        exponent = (bits[k] - _ROOT_HALF_BITS) >> np.int32(23)
        bits[k] -= exponent << np.int32(23)
        f = uniform[k] - np.float32(1.0)  # the number was 1 + f times 2^exponent
        p = (_LN[8] * f + _LN[7]) * f + _LN[6]
        p = ((p * f + _LN[5]) * f + _LN[4]) * f + _LN[3]
        p = ((p * f + _LN[2]) * f + _LN[1]) * f + _LN[0]
        radius = np.sqrt(np.float32(-2.0) * (np.float32(exponent) * _LN_2 + f * p))
        a, y = angle[k], angle[k] * angle[k]
        sine = a * (((_SINC[3] * y + _SINC[2]) * y + _SINC[1]) * y + _SINC[0])
        cosine = (((_COS[4] * y + _COS[3]) * y + _COS[2]) * y + _COS[1]) * y + _COS[0]
        upright = turn[k] & np.int32(1)
        first = radius * (sine if upright else cosine)
        second = radius * (cosine if upright else sine)
        out[k] = first * np.float32(np.int32(1) - (turn[k] & np.int32(2)))
        sign = np.int32(1) - ((turn[k] >> np.int32(1)) & np.int32(2))
        out[n + k] = second * np.float32(sign)


@njit(cache=True)
def _fill_with_normals(
    seed: np.uint64, tick: np.uint64, out: NDArray[np.float32]
) -> None:  # pragma: no cover  (compiled)
    """Fills out (n,) from the words of splitmix64, block after block."""
    state, block = _tick_word(seed, tick), 2 * _PAIRS
    uniform = np.empty(_PAIRS, dtype=np.float32)
    angle = np.empty(_PAIRS, dtype=np.float32)
    turn = np.empty(_PAIRS, dtype=np.int32)
    whole = out.size - out.size % block
    for begin in range(0, whole, block):
        _normal_pairs(state, uniform, angle, turn, out[begin : begin + block])
        state += np.uint64(_PAIRS) * _STEP
    if whole < out.size:
        last = np.empty(block, dtype=np.float32)
        _normal_pairs(state, uniform, angle, turn, last)
        # An assignment to a slice compiles words about shapes too: seconds of it.
        for k in range(whole, out.size):
            out[k] = last[k - whole]


def frame_noise(shape: tuple[int, int], seed: int, tick: int) -> NDArray[np.float32]:
    """White Gaussian noise of unit variance that only the seed and the tick decide.

    Nine times as fast as numpy's numbers; they end at 5.8 standard deviations. Their
    words are those of splitmix64 from a place hashed from seed and tick.

    Args:
        shape: Rows and columns: channels and samples.
        seed: Of the block.
        tick: Number of the tick.

    Returns:
        (rows, columns) of unit variance.
    """
    out = np.empty(shape, dtype=np.float32)
    words = np.uint64(seed & _WORD), np.uint64(tick & _WORD)
    _fill_with_normals(*words, out.reshape(-1))
    return out
