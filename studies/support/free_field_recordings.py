"""Recordings of resting sources by microphones anywhere in the free field."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft


def free_field(
    sounds: list[tuple[NDArray[np.float64], tuple[float, ...]]],
    microphones: NDArray[np.float64],
    rate: float,
    c: float = 343.0,
) -> NDArray[np.float64]:
    """Returns the (n, samples) sound at (n, d) microphones, without noise.

    Each sound has its samples at 1 m, from the start of the recording, and its place,
    m. All sounds have the same number of samples. Sound that would arrive after the
    last sample is cut off.
    """
    heard = np.zeros((len(microphones), sounds[0][0].size))
    for samples, place in sounds:
        distance = np.linalg.norm(microphones - np.array(place), axis=1)
        most = int(np.ceil(distance.max() / c * rate)) + 64
        size = fft.next_fast_len(samples.size + most, real=True)
        spectrum = fft.rfft(samples, size)
        w = 2.0 * np.pi * rate * fft.rfftfreq(size)
        for k, r in enumerate(distance):
            delayed = fft.irfft(spectrum * np.exp(-1j * w * r / c), size)
            heard[k] += delayed[: heard.shape[1]] / r
    return heard


def with_noise(
    heard: NDArray[np.float64], snr_db: float, seed: int, *, of_nearest: bool = False
) -> NDArray[np.float64]:
    """Adds white noise of equal level to all channels.

    The ratio compares the noise with the peak level of the sound, its largest mean
    power over 1 % of the recording. It applies to the median channel, or to the loudest
    one.
    """
    size = max(1, heard.shape[1] // 100)
    blocks = heard[:, : heard.shape[1] // size * size].reshape(len(heard), -1, size)
    power = (blocks**2).mean(axis=2).max(axis=1)
    level = power.max() if of_nearest else np.median(power)
    noise = np.random.default_rng(seed).standard_normal(heard.shape)
    return heard + np.sqrt(level * 10.0 ** (-snr_db / 10.0)) * noise


def sweep(
    from_hz: float, to_hz: float, seconds: float, rate: float
) -> NDArray[np.float64]:
    """Returns a linear sweep with a smooth rise and fall."""
    t = np.arange(round(seconds * rate)) / rate
    phase = from_hz * t + 0.5 * (to_hz - from_hz) / seconds * t**2
    edge = np.minimum(1.0, np.minimum(t, t[::-1]) / (0.1 * seconds))
    return np.sin(2.0 * np.pi * phase) * np.sin(0.5 * np.pi * edge) ** 2


def song(seed: int, seconds: float, rate: float) -> NDArray[np.float64]:
    """Returns a bird's call: two to five notes within 2 to 8 kHz."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    notes = []
    for _ in range(count):
        low, high = np.sort(rng.uniform(2000.0, 8000.0, 2))
        ends = (low, high) if rng.random() < 0.5 else (high, low)
        notes.append(sweep(*ends, 0.8 * seconds / count, rate))
        notes.append(np.zeros(round(0.2 * seconds / count * rate)))
    return np.concatenate(notes)


def shot(rate: float) -> NDArray[np.float64]:
    """Returns a muzzle blast: a Friedlander wave of 3 ms."""
    t = np.arange(round(0.03 * rate)) / rate
    return (1.0 - t / 0.003) * np.exp(-t / 0.003)


def at_times(
    sound: NDArray[np.float64], times_s: list[float], seconds: float, rate: float
) -> NDArray[np.float64]:
    """Returns a recording of the sound that begins at each of the times."""
    out = np.zeros(round(seconds * rate))
    for t_s in times_s:
        first = round(t_s * rate)
        part = sound[: max(0, out.size - first)]
        out[first : first + part.size] += part
    return out
