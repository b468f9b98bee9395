"""Finds channels of a recording that repeat another channel.

Two microphones may record the same sound at the same time, but their noise and the
noise of their converters differ. The functions match two channels by the best gain and
the best delay in whole samples. The difference that remains is at least this noise for
two real channels, and only rounding for a copy.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from systems.framework.compiling import njit

# The mean square difference between a channel and its copy is below the larger of two
# limits.
# First limit, as a share of the squared step between two sample values. Rounding alone
# causes a share of 1/12.
_ROUNDING = 0.1
# Second limit, as a share of the power of the copy.
_EXACT_SHARE = 1e-6

# The mean square difference must also be below this share of the power of the copy. An
# almost silent channel is therefore no copy.
_LIKE_SHARE = 0.01

# Two inputs of one microphone differ by the noise of their converters. Three limits
# apply to this difference:
# - _SHARED_SOUND: largest share of the power of a sound, during the sound.
# - _SHARED_PAUSE: largest share of the power in a pause, during the pause.
# - _PAUSE: largest ratio of the power in a pause to the power of a sound.
_SHARED_SOUND, _SHARED_PAUSE, _PAUSE = 1e-3, 0.02, 0.01

# First, only _PROBE samples in the middle of a frame are compared. This comparison
# excludes most pairs. The limit of the difference is _PROBE_MARGIN times the limit for
# the whole frame.
_PROBE, _PROBE_MARGIN = 128, 4.0

# Length of the loudest section that is examined, then length of the quietest one, s.
_LOUD_S, _PAUSE_S = 0.25, 0.05


def repeats(
    first: NDArray[np.float32 | np.float64 | np.int16],
    second: NDArray[np.float32 | np.float64 | np.int16],
    lag: int,
    step: float,
) -> bool:
    """Returns whether a channel equals another channel, apart from gain and rounding.

    Args:
        first: (n,) samples of the first channel.
        second: (n,) samples of the second channel.
        lag: Delay of the second channel, samples.
        step: Smallest difference between two values of a sample, in the unit of the
            samples.

    Returns:
        True if rounding explains the difference that remains after the best gain.
    """
    left, power, other = _difference(first, second, lag)
    return bool(_is_copy(left, power, other, _ROUNDING * step**2))


def frame_repeats(
    frame: NDArray[np.float32 | np.int16],
    pairs: NDArray[np.int64],
    later: NDArray[np.float64],
    at_once: NDArray[np.bool_],
    *,
    noisy: bool,
) -> bool:
    """Returns whether a channel of an audio frame repeats another channel.

    The function compares the channels of each pair at lag 0, and at the lag of the
    sound.

    Args:
        frame: (n, samples) channels. Integers are counts of the converter.
        pairs: (p, 2) channels to compare.
        later: (n - 1,) delays of the channels 1 ... n - 1 relative to channel 0,
            samples.
        at_once: (p,) Boolean values: whether to compare each pair at lag 0. The value
            must be False if the two microphones may record the same signal at the same
            time.
        noisy: Whether the frames contain noise. Without noise, a sound that arrives
            later by whole samples looks like a copy, so the function compares pairs
            only at lag 0.

    Returns:
        True if at least one pair contains a copy.
    """
    step = 1.0 if frame.dtype == np.int16 else 0.0
    rounding = _ROUNDING * step**2
    return bool(_frame_repeats(frame, pairs, later, at_once, noisy, rounding))


@njit(cache=True)
def _frame_repeats(
    frame: NDArray[np.float32 | np.int16],
    pairs: NDArray[np.int64],
    later: NDArray[np.float64],
    at_once: NDArray[np.bool_],
    noisy: Any,
    rounding: float,
) -> bool:  # pragma: no cover  (compiled)
    middle = frame.shape[1] // 2
    for p in range(len(pairs)):
        i, j = pairs[p]
        delay = later[j - 1] - (later[i - 1] if i > 0 else 0.0)
        for lag in (0, int(np.rint(delay))):
            first = middle - lag
            if (lag == 0 and not at_once[p]) or (lag != 0 and not noisy):
                continue
            if first < 0 or first + _PROBE > frame.shape[1]:
                continue
            a = frame[i, first : first + _PROBE]
            b, none = frame[j, middle : middle + _PROBE], lag - lag
            # numba would compile a literal 0 anew.
            left, power, _ = _difference(a, b, none)
            # Most pairs that are no copies already differ in the middle of the frame.
            if left < _PROBE_MARGIN * max(_EXACT_SHARE * power, rounding):
                left, power, other = _difference(frame[i], frame[j], lag)
                if _is_copy(left, power, other, rounding):
                    return True
    return False


@njit(cache=True)
def _is_copy(
    left: float, power: float, other: float, rounding: float
) -> bool:  # pragma: no cover  (compiled)
    """Returns whether the results of ``_difference`` are those of a copy."""
    least = max(_EXACT_SHARE * power, rounding)
    return power > 0.0 and other > 0.0 and left < min(least, _LIKE_SHARE * power)


def copied_pairs(
    samples: NDArray[np.float64], sample_rate_hz: float
) -> list[tuple[int, int]]:
    """Finds the pairs of channels of a recording that repeat each other.

    The function compares each pair at the lag of its highest correlation. A pair
    repeats if the two channels differ only by rounding in the loudest section of the
    recording. If the recording has a pause, the function also finds pairs that record
    one microphone through two inputs.

    Args:
        samples: (n, samples) channels that are not silent, without NaN.
        sample_rate_hz: Rate of the samples, Hz.

    Returns:
        Channel numbers (i, j) of each pair that repeats, counted from 0, with i < j.
    """
    loud, most = _block(samples, _LOUD_S, sample_rate_hz, np.argmax)
    pause, least = _block(samples, _PAUSE_S, sample_rate_hz, np.argmin)
    steps = [_step(channel) for channel in loud]
    # Whether there is a pause that contains more than rounding in every channel.
    paused = np.all(least > 4.0 * np.square(steps)) and np.all(least < _PAUSE * most)
    size = loud.shape[1]
    spectra = fft.rfft(loud - loud.mean(axis=1, keepdims=True), 2 * size)
    found = []
    for i, j in combinations(range(len(samples)), 2):
        correlation = fft.irfft(spectra[i].conj() * spectra[j], 2 * size)
        lag = int(np.abs(correlation).argmax())
        lag -= 2 * size * (lag > size)
        if abs(lag) > size // 2:
            continue
        if repeats(loud[i], loud[j], lag, max(steps[i], steps[j])) or (
            paused
            and _shares(loud, i, j, lag) < _SHARED_SOUND
            and _shares(pause, i, j, lag) < _SHARED_PAUSE
        ):
            found.append((i, j))
    return found


def _block(
    samples: NDArray[np.float64],
    seconds: float,
    sample_rate_hz: float,
    choose: Callable[[NDArray[np.float64]], np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns a section (n, size) of a recording, and the (n,) powers of its channels.

    The function ``choose`` gets the powers of all sections and returns the index of the
    chosen section. Sections in which a channel is constant (digital silence) do not
    take part.
    """
    size = min(round(seconds * sample_rate_hz), samples.shape[1])
    count = samples.shape[1] // size
    blocks = samples[:, : count * size].reshape(len(samples), count, size)
    power = np.array([channel.var(axis=1) for channel in blocks])
    held = np.flatnonzero(np.all(power > 0.0, axis=0))
    if not held.size:
        held = np.arange(count)
    mean = np.maximum(power.mean(axis=1, keepdims=True), 1e-300)
    best = held[choose((power / mean).mean(axis=0)[held])]
    return blocks[:, best], power[:, best]


def _step(channel: NDArray[np.float64]) -> float:
    """Returns the least difference between two values of a channel."""
    values = np.unique(channel)
    return float(np.diff(values).min()) if values.size > 1 else 0.0


def _shares(block: NDArray[np.float64], i: int, j: int, lag: int) -> float:
    left, power, _ = _difference(block[i], block[j], lag)
    return left / max(power, 1e-300)


@njit(cache=True)
def _difference(
    first: NDArray[Any], second: NDArray[Any], lag: int
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Computes how much the second channel differs from the first channel.

    The function returns three variances: that of the difference that remains after the
    best gain, that of the second channel, and that of the first channel.
    """
    begin, end = max(0, lag), min(second.size, second.size + lag)
    count = end - begin
    a, b, aa, bb, ab = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(begin, end):
        x, y = float(first[k - lag]), float(second[k])
        a += x
        b += y
        aa += x * x
        bb += y * y
        ab += x * y
    aa -= a * a / count
    bb -= b * b / count
    ab -= a * b / count
    left = bb - ab * ab / aa if aa > 0.0 else bb
    return max(left, 0.0) / count, bb / count, aa / count
