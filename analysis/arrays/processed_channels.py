"""Finds channels that hold processed sound instead of that of a microphone.

Some devices record, beside their microphones, a channel that they compute from them. It
is a mix of the microphones, or it comes late and its gain changes with the sound.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.signal import stft

from systems.sound.array_shape import ArrayShape

# Largest number of samples of all channels together that are examined.
_MOST_SAMPLES = 2**21

# Level of a channel that counts as silent, as a share of the loudest.
_SILENT = 0.01

# Length of a frame, s, and the band, Hz and share of the sample rate.
_FRAME_S, _LOWEST_HZ, _TOP_OF_RATE = 0.064, 300.0, 0.45

# _MOST_LATE_S: longest delay of processing that is searched for, s.
# _LATE_S: least delay beyond the travel time of sound along the array, s.
# _LEAST_PEAK: least height of a peak, as a multiple of the correlation of noise.
# _ABOVE_DIRECT: least height of a peak, as a multiple of that of direct sound.
_MOST_LATE_S, _LATE_S, _LEAST_PEAK, _ABOVE_DIRECT = 0.25, 2e-3, 10.0, 3.0

# A gain changes if its deviation over the frames is above both limits: dB, and a
# multiple of the median deviation of the other channels.
_CHANGES_DB, _CHANGES = 1.5, 3.0

# _MIXED: largest share of the power of a mix that the other channels do not explain.
# _APART: least share that is left of any other combination of channels. Below it, the
#   microphones hear the same, and each of them looks like a mix of the others.
# _PART: least weight of a part of a mix, as a share of the largest weight.
# _LEADS: least ratio of the weight of the mix and the weights of its parts.
_MIXED, _APART, _PART, _LEADS = 3e-3, 0.1, 0.2, 1.2

# Share of the frames that are quiet.
_QUIET = 0.15

# Least power of a frequency that counts, as a share of that of the strongest, and least
# share of such frequencies.
_FILLED, _LEAST_FILLED = 1e-5, 0.25


def processed_channel(
    columns: NDArray[np.float64],
    chosen: Sequence[int],
    shape: ArrayShape,
    c: float,
    sample_rate_hz: float,
) -> tuple[int, str] | None:
    """Finds a channel of the array that holds processed sound.

    Args:
        columns: (m, samples) all columns of the recording, also those that the array
            does not use.
        chosen: Column of each microphone.
        shape: The n microphones.
        c: Speed of sound, m/s.
        sample_rate_hz: Sample rate, Hz.

    Returns:
        Number of the microphone, from 0, and the observation. None if there is no such
        channel.
    """
    middle, half = columns.shape[1] // 2, _MOST_SAMPLES // len(columns) // 2
    part = columns[:, max(middle - half, 0) : middle + half]
    level = np.nan_to_num(part.std(axis=1), posinf=0.0)
    alive = np.flatnonzero(level > _SILENT * level.max()).tolist()
    part = part[alive]
    size = round(_FRAME_S * sample_rate_hz)
    if len(part) < 3 or part.shape[1] < 8 * size:
        return None
    part = (part - part.mean(axis=1, keepdims=True)) / part.std(axis=1, keepdims=True)
    reach = round((shape.max_delay(c) + _LATE_S) * sample_rate_hz)
    late = _late(part, reach, round(_MOST_LATE_S * sample_rate_hz))
    for k, lag in late.items():
        part[k] = np.roll(part[k], -lag)
    frequency, _, spectra = stft(part, sample_rate_hz, nperseg=size)
    spacing = np.linalg.norm(shape.p_AM[:, np.newaxis] - shape.p_AM, axis=2)
    nearest = float(spacing[np.triu_indices(shape.count, 1)].min())
    found = {
        k: f"comes {1e3 * late[k] / sample_rate_hz:.3g} ms late and its gain changes"
        for k in _changing(spectra, frequency, sample_rate_hz)
        if k in late
    }
    # At lower frequencies, neighbors hear almost the same.
    low_hz = max(_LOWEST_HZ, c / (2.0 * np.pi * nearest))
    band = (frequency >= low_hz) & (frequency <= _TOP_OF_RATE * sample_rate_hz)
    if np.count_nonzero(band) >= 8 and (mix := _mix(spectra[:, band])) is not None:
        found[mix] = "is a mix of other channels"
    for k, observation in found.items():
        if alive[k] in chosen:
            return list(chosen).index(alive[k]), observation
    return None


def _late(part: NDArray[np.float64], reach: int, most: int) -> dict[int, int]:
    """Returns channels that come later than others, with their delays in samples.

    The delays against different channels must agree. Those of echoes do not.
    """
    size = fft.next_fast_len(2 * part.shape[1], real=True)
    spectra = fft.rfft(part, size)
    spectra /= np.maximum(np.abs(spectra), 1e-12)
    total, found = spectra.sum(axis=0), {}
    for k, spectrum in enumerate(spectra):
        lag = _lag(spectrum, total - spectrum, size, reach, most)
        if lag is None:
            continue
        others = [
            _lag(spectrum, s, size, reach, most) for s in np.delete(spectra, k, 0)
        ]
        lags = [other for other in others if other is not None]
        if len(lags) >= max(2, len(others) - 2) and np.ptp(lags) <= 2 * reach:
            found[k] = lag
    return found


def _lag(
    first: NDArray[np.complex128],
    second: NDArray[np.complex128],
    size: int,
    reach: int,
    most: int,
) -> int | None:
    """Returns the delay of the first of two channels, if it is more than ``reach``.

    An echo can be louder than the direct sound, but both are heard. Sound that comes
    late has no peak within ``reach``.
    """
    correlation = np.abs(fft.irfft(first * np.conj(second), size))
    lag = int(correlation[: most + 1].argmax())
    if lag <= reach:
        return None
    noise = float(np.median(correlation)) / 0.6745
    direct = max(correlation[: reach + 1].max(), correlation[-reach:].max())
    clear = correlation[lag] > max(_LEAST_PEAK * noise, _ABOVE_DIRECT * direct)
    return lag if clear else None


def _changing(
    spectra: NDArray[np.complex128], frequency: NDArray[np.float64], rate: float
) -> list[int]:
    """Returns channels whose gain changes far more than that of the others.

    ``spectra`` has the shape (channels, frequencies, frames). Only the louder half of
    the frames counts, where the noise of the channels matters little.
    """
    band = (frequency >= _LOWEST_HZ) & (frequency <= _TOP_OF_RATE * rate)
    level = 10.0 * np.log10(np.sum(np.abs(spectra[:, band]) ** 2, axis=1) + 1e-30)
    usual = np.median(level, axis=0)
    gain = (level - usual)[:, usual >= np.median(usual)]
    off = np.abs(gain - np.median(gain, axis=1, keepdims=True))
    deviation = np.median(off, axis=1) / 0.6745
    limit = max(_CHANGES_DB, _CHANGES * float(np.median(deviation)))
    return [int(k) for k in np.flatnonzero(deviation > limit)]


def _mix(spectra: NDArray[np.complex128]) -> int | None:
    """Returns the channel that is a weighted sum of others at the same time.

    ``spectra`` has the shape (channels, frequencies, frames). Only the quietest frames
    count. In them, the microphones have noise of their own, and a limiter has no
    effect.
    """
    power = np.sum(np.abs(spectra) ** 2, axis=(0, 1))
    heard = power > 1e-9 * power.max()
    quiet = spectra[:, :, heard & (power <= np.quantile(power[heard], _QUIET))]
    if not quiet.size:
        return None
    of_bin = np.mean(np.abs(quiet) ** 2, axis=(0, 2))
    filled = of_bin > _FILLED * of_bin.max()
    if np.mean(filled) < _LEAST_FILLED:
        return None  # tones are combinations of each other
    white = quiet[:, filled] / np.sqrt(of_bin[filled])[:, np.newaxis]
    rows = white.reshape(len(white), -1)
    covariance = np.real(rows @ rows.conj().T)
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    weights = vectors[:, 0] / vectors[np.abs(vectors[:, 0]).argmax(), 0]
    k = int(np.abs(weights).argmax())
    others = -np.delete(weights, k)
    if values[1] < _APART or np.count_nonzero(others > _PART) < 2:
        return None
    if others.max() * _LEADS > 1.0 or others.min() < -_PART:
        return None
    rest = np.abs(np.tensordot(weights / scale, white, 1)) ** 2
    whole = np.abs(white[k] / scale[k]) ** 2
    share = rest.mean(axis=1) / np.maximum(whole.mean(axis=1), 1e-30)
    return k if np.median(share) < _MIXED else None
