"""Channels that repeat another one: no two microphones hear alike.

Two microphones may hear the same sound at the same time. Their own noise, and that
of their converters, is not the same: what one channel holds beyond the other, but
for a gain and a delay of whole samples, is then no less than that noise.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from systems.framework.compiling import njit

# A copy is off by its rounding alone, a twelfth of a squared step; or by less than
# this share of its power.
_ROUNDING = 0.1
_EXACT_SHARE = 1e-6

# And by less than this share, so that a channel of next to nothing copies none.
_LIKE_SHARE = 0.01

# Two inputs of one microphone differ by their converters' noise: by less than the
# first share of the sound, and than the second one of what is left in the pauses,
# which are quieter by the third.
_SHARED_SOUND, _SHARED_PAUSE, _PAUSE = 1e-3, 0.02, 0.01

# Samples of a frame by which most pairs are told to be no copies, and how much
# larger the difference may be in them than in the frame.
_PROBE, _PROBE_MARGIN = 128, 4.0

# The loudest stretch and the quietest one that are looked at, s.
_LOUD_S, _PAUSE_S = 0.25, 0.05


def repeats(
    first: NDArray[np.float32 | np.float64 | np.int16],
    second: NDArray[np.float32 | np.float64 | np.int16],
    lag: int,
    step: float,
) -> bool:
    """Whether one channel is the other one but for a gain and its rounding.

    Args:
        first: (n,) samples.
        second: (n,) samples.
        lag: By how many samples the second is later.
        step: Between two values that samples can have, in their unit.

    Returns:
        True where the residue after the best gain is no more than rounding leaves.
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
    """Whether a channel of a frame repeats another one, at a lag or at none.

    Args:
        frame: (n, samples) channels; counts, where they are integers.
        pairs: (p, 2) channels to compare.
        later: (n - 1,) by how many samples the channels are later than channel 0.
        at_once: (p,) whether equal channels repeat each other; False where
            microphones may hear the same at the same time.
        noisy: Whether there is noise to tell a later sound from a copy. Without any,
            what is later by whole samples is no copy yet.

    Returns:
        True where one of the pairs does.
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
            # A literal 0 would be compiled anew.
            left, power, _ = _difference(a, b, none)
            # The middle of the frame speaks for a copy, or against it.
            if left < _PROBE_MARGIN * max(_EXACT_SHARE * power, rounding):
                left, power, other = _difference(frame[i], frame[j], lag)
                if _is_copy(left, power, other, rounding):
                    return True
    return False


@njit(cache=True)
def _is_copy(
    left: float, power: float, other: float, rounding: float
) -> bool:  # pragma: no cover  (compiled)
    """From what ``_difference`` returns."""
    least = max(_EXACT_SHARE * power, rounding)
    return power > 0.0 and other > 0.0 and left < min(least, _LIKE_SHARE * power)


def copied_pairs(
    samples: NDArray[np.float64], sample_rate_hz: float
) -> list[tuple[int, int]]:
    """Pairs of channels of which one repeats the other.

    Args:
        samples: (n, samples) channels that hold something, without NaN.
        sample_rate_hz: Rate of the samples, Hz.

    Returns:
        (i, j) of each such pair, i < j, channels from 0.
    """
    loud, most = _block(samples, _LOUD_S, sample_rate_hz, np.argmax)
    pause, least = _block(samples, _PAUSE_S, sample_rate_hz, np.argmin)
    steps = [_step(channel) for channel in loud]
    # A pause that holds more than rounding, in every channel.
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
    """(n, size) of a stretch chosen by its power, and (n,) that power.

    Digital silence, of one value, is not chosen.
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
    """Least difference of two values that occur."""
    values = np.unique(channel)
    return float(np.diff(values).min()) if values.size > 1 else 0.0


def _shares(block: NDArray[np.float64], i: int, j: int, lag: int) -> float:
    left, power, _ = _difference(block[i], block[j], lag)
    return left / max(power, 1e-300)


@njit(cache=True)
def _difference(
    first: NDArray[Any], second: NDArray[Any], lag: int
) -> tuple[float, float, float]:  # pragma: no cover  (compiled)
    """Variances of what the second channel holds beyond the first, and of both."""
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
