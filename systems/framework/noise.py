"""Makes random numbers that depend only on a seed and a tick (control period)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.random import SFC64, Generator
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import NDArray
from scipy.special import ndtri

from systems.framework.compiling import njit

#: Tick for numbers that a block draws once, before the run. No run reaches this tick.
BEFORE_THE_RUN = 2**62

_WORD = (1 << 64) - 1

# Increment of the state of splitmix64 per word.
_STEP = np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True)
def _scrambled(word: int | np.uint64) -> np.uint64:  # pragma: no cover  (compiled)
    """Applies the finalizer of splitmix64, which mixes all bits of a word."""
    word = np.uint64(word) + _STEP
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@njit(cache=True)
def _tick_word(
    seed: int | np.uint64, tick: int | np.uint64
) -> np.uint64:  # pragma: no cover  (compiled)
    """Hashes a seed and a tick to a word."""
    return _scrambled(_scrambled(seed) ^ tick)


class _TickSeed(ISeedSequence):
    """Three words from seed and tick. numpy's own sequence takes 15 us longer."""

    def __init__(self, seed: int, tick: int) -> None:
        words = [_tick_word(np.uint64(seed & _WORD), np.uint64(tick & _WORD))]
        for _ in range(2):
            words.append(_scrambled(np.uint64(words[-1])))
        self._words = np.array(words, dtype=np.uint64)

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> Any:
        """Returns the three 64-bit words for SFC64."""
        if n_words != 3 or np.dtype(dtype) != np.uint64:
            raise ValueError("a tick's seed serves SFC64 only")
        return self._words


def tick_generator(seed: int, tick: int) -> Generator:
    """Makes a generator of random numbers for one control period (tick) of a block.

    Blocks do not store a generator. Therefore the noise is the same if Drake evaluates
    a block twice, or repeats a run from the same context. The generator is SFC64, the
    fastest one of numpy. It starts from a hash of seed and tick, so that the numbers of
    different ticks are independent.

    Args:
        seed: Seed of the block.
        tick: Number of the tick. Tick 0 is at 0 s.

    Returns:
        A generator whose numbers depend only on ``seed`` and ``tick``.
    """
    # The type stub of numpy lacks ISeedSequence, but the documentation allows it.
    return Generator(SFC64(_TickSeed(seed, tick)))  # type: ignore[arg-type]


def _quantiles() -> NDArray[np.float32]:
    """Returns (65536,) quantiles of a normal distribution with variance 1/2."""
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
    """Fills ``out`` with normal numbers, two from each random word of splitmix64.

    Each number is the sum of two entries of ``quantiles``. Sixteen bits of the word are
    the index of each entry.
    """
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
    """Draws a few normal numbers of unit variance for one control period of one block.

    Each number is the sum of two entries of a table with 65 536 quantiles. The
    generator splitmix64 selects the entries. It starts from a hash of seed and tick.
    The distribution is normal up to 5.9 standard deviations, and no number is larger.
    If many numbers are needed, use ``frame_noise``.

    Args:
        shape: Numbers of rows and columns.
        seed: Seed of the block.
        tick: Number of the control period (tick).

    Returns:
        (rows, columns) numbers.
    """
    out = np.empty(shape)
    words = np.uint64(seed & _WORD), np.uint64(tick & _WORD)
    _add_quantiles(*words, _QUANTILES, out.reshape(-1))
    return out


class TickNoise(NamedTuple):
    """Seed and table of ``standard_normals`` for compiled code."""

    seed: np.uint64
    quantiles: NDArray[np.float32]


def tick_noise(seed: int) -> TickNoise:
    """Returns the seed and the table of quantiles that ``tick_normals`` needs."""
    return TickNoise(np.uint64(seed & _WORD), _QUANTILES)


@njit(cache=True)
def tick_normals(
    noise: TickNoise, tick: int, rows: int, columns: int
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes in compiled code what ``standard_normals`` computes in Python.

    The numbers have double precision. Single precision would make compiled code and
    Drake differ. The product of a single-precision number and a Python float has single
    precision in numpy, but double precision in compiled code.

    Args:
        noise: Seed and table from ``tick_noise``.
        tick: Number of the control period (tick).
        rows: Number of rows.
        columns: Number of columns.

    Returns:
        (rows, columns) normal numbers of unit variance.
    """
    out = np.empty((rows, columns))
    _add_quantiles(noise.seed, np.uint64(tick), noise.quantiles, out.reshape(-1))
    return out


def _polynomial(function: Any, low: float, high: float, degree: int) -> tuple[Any, ...]:
    """Fits a polynomial at Chebyshev points. The lowest coefficient is first."""
    fit = np.polynomial.Chebyshev.interpolate(function, degree, [low, high])
    coefficients = fit.convert(kind=np.polynomial.Polynomial).coef
    return tuple(coefficients.astype(np.float32))


# Three polynomials, accurate to single precision:
# - ln(1 + f) / f as a function of f, for 1 + f between sqrt(1/2) and sqrt(2)
# - sin(a) / a as a function of a^2, for a up to 45 degrees
# - cos(a) as a function of a^2, for a up to 45 degrees
_LN = _polynomial(lambda f: np.log1p(f) / f, 2.0**-0.5 - 1.0, 2.0**0.5 - 1.0, 8)
_SINC = _polynomial(lambda y: np.sinc(np.sqrt(y) / np.pi), 0.0, (np.pi / 4.0) ** 2, 3)
_COS = _polynomial(lambda y: np.cos(np.sqrt(y)), 0.0, (np.pi / 4.0) ** 2, 4)
_LN_2 = np.float32(np.log(2.0))
_ANGLE_UNIT = np.float32(np.pi / 4.0 / 2.0**23)
_ROOT_HALF_BITS = np.float32(np.sqrt(0.5)).view(np.int32)

# Number of pairs computed at once. The scratch arrays then fit into the fastest cache.
_PAIRS = 625


@njit(cache=True, error_model="numpy")
def _normal_pairs(
    state: np.uint64,
    uniform: NDArray[np.float32],
    angle: NDArray[np.float32],
    turn: NDArray[np.int32],
    out: NDArray[np.float32],
) -> None:  # pragma: no cover  (compiled)
    """Fills ``out`` (2 n,) with n pairs of normal numbers (Box and Muller, 1958).

    A pair is r cos(a) and r sin(a), with a random radius r and a random angle a. Each
    pair needs one random word of splitmix64, whose bits are used as follows:

    - 23 bits give a uniform number u, and r = sqrt(-2 ln u).
    - 24 bits give an angle between -45 and 45 deg.
    - 3 bits decide whether to swap the two numbers, and choose their signs. The angles
      therefore cover the whole circle.

    Polynomials replace the functions of ``math``, because the compiler can vectorize
    polynomials.

    Args:
        state: State of splitmix64 before the first word.
        uniform: (n,) scratch memory.
        angle: (n,) scratch memory.
        turn: (n,) scratch memory.
        out: The first numbers of all pairs, then the second numbers of all pairs.
    """
    n, half = uniform.size, np.float32(0.5)
    # Splits each word into u, the angle and three bits.
    for k in range(n):
        word = _scrambled(state + np.uint64(k) * _STEP)
        share = np.int32(word >> np.uint64(41))
        uniform[k] = (np.float32(share) + half) * np.float32(2.0**-23)
        share = np.int32(word >> np.uint64(8)) >> np.int32(8)
        angle[k] = (np.float32(share) + half) * _ANGLE_UNIT
        turn[k] = np.int32(word & np.uint64(7))
    bits = uniform.view(np.int32)
    for k in range(n):
        # Writes u as (1 + f) 2^exponent, with 1 + f from sqrt(1/2) to sqrt(2).
        exponent = (bits[k] - _ROOT_HALF_BITS) >> np.int32(23)
        bits[k] -= exponent << np.int32(23)
        f = uniform[k] - np.float32(1.0)
        p = (_LN[8] * f + _LN[7]) * f + _LN[6]
        p = ((p * f + _LN[5]) * f + _LN[4]) * f + _LN[3]
        p = ((p * f + _LN[2]) * f + _LN[1]) * f + _LN[0]
        radius = np.sqrt(np.float32(-2.0) * (np.float32(exponent) * _LN_2 + f * p))
        # Sine and cosine of the angle.
        a, y = angle[k], angle[k] * angle[k]
        sine = a * (((_SINC[3] * y + _SINC[2]) * y + _SINC[1]) * y + _SINC[0])
        cosine = (((_COS[4] * y + _COS[3]) * y + _COS[2]) * y + _COS[1]) * y + _COS[0]
        # The three bits: swap, sign of the first number, sign of the second number.
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
    """Fills ``out`` (n,) with normal numbers, ``_PAIRS`` pairs at a time."""
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
        # A slice assignment would add seconds to the compilation.
        for k in range(whole, out.size):
            out[k] = last[k - whole]


def frame_noise(shape: tuple[int, int], seed: int, tick: int) -> NDArray[np.float32]:
    """Draws white Gaussian noise of unit variance for one frame of audio.

    The function is nine times as fast as numpy's generator. No number is larger than
    5.8 standard deviations. The random words come from the generator splitmix64, which
    starts from a hash of seed and tick.

    Args:
        shape: Numbers of rows (channels) and columns (samples).
        seed: Seed of the block.
        tick: Number of the control period (tick) of the frame.

    Returns:
        (rows, columns) numbers.
    """
    out = np.empty(shape, dtype=np.float32)
    words = np.uint64(seed & _WORD), np.uint64(tick & _WORD)
    _fill_with_normals(*words, out.reshape(-1))
    return out
