"""Finds out whether the main source is an echo that is louder than the direct sound.

A loud echo repeats at all microphones a sound that came from another direction before.
Channels are therefore correlated with the sum of the channels aligned to the main
direction. If a peak comes before the main sound, the delays of this peak tell from
where the first sound came. After the direct sound of a usual room come many such peaks,
but none of them comes before.

The pitch of a voice causes peaks before and after the main sound alike, from its own
direction. So a peak before the main sound counts only if it is higher than all peaks
after it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import uniform_filter1d

from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.recording_spectra import RecordingSpectra
from analysis.arrays.steered_response import SearchGrid, centroid_delays
from systems.delays.correlations import correlations_at_lags
from systems.sound.array_shape import ArrayShape

# Shortest and longest time between the direct sound and its echo, s. Reflections before
# this time are those of ``near_reflector``.
_EARLIEST_S, _LATEST_S = 1.0e-3, 22e-3

# The echo comes at least this multiple of the travel time along the array later.
_TRAVELS = 1.5

# Longest travel time along an array at which sources are far away, s.
_LONGEST_S = 1.2e-3

# Length of a window, s. It is several times as long as the latest echo.
_WINDOW_S = 0.128

# Width of the bands whose levels are made equal, Hz. An echo after more than 2 ms
# changes the spectrum within such a band, and this change must remain.
_SMOOTH_HZ = 500.0

# Highest frequency in use, and number of correlation values per period of it.
_HIGHEST_HZ, _DENSITY = 8_000.0, 6

# Frequency at which the grid of directions is as fine as the peaks, as a share of the
# highest frequency.
_GRID = 0.4

# Least change of the delays between two directions, root mean square over the
# microphones, as a share of their distances from the middle.
_ELSEWHERE = 0.3

# _LEAST: least height of the peak of the first sound. The peak of the main sound has
#   the height 1. The echo of +10 dB causes peaks of 0.25 to 0.3.
# _HIGHER: least ratio of this peak to the highest peak after the main sound. Simulated
#   rooms have ratios of up to 1.05, and loud echoes have 1.2 to 7.
_LEAST, _HIGHER = 0.2, 1.15

_BLOCK = 64


class FirstSound(NamedTuple):
    """The direct sound before an echo that is louder."""

    u: NDArray[np.float64]
    """(d,) unit vector to its source."""
    earlier_s: float
    """Time between the direct sound and the echo, s."""
    height: float
    """Height of its peak, 0 to 1."""
    ratio: float
    """Ratio of its peak to the highest peak after the main sound."""


def loud_echo(
    recording: RecordingSpectra,
    shape: ArrayShape,
    c: float,
    bearing_deg: float,
    elevation_deg: float | None,
) -> ChannelFault | None:
    """Returns a warning if the main source is an echo of sound from elsewhere."""
    azimuth, height = math.radians(bearing_deg), math.radians(elevation_deg or 0.0)
    level = math.cos(height)
    u = np.array(
        [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(height)]
    )[: shape.dimension]
    first = first_sound(recording, shape, c, u)
    if first is None or first.height < _LEAST or first.ratio < _HIGHER:
        return None
    bearing = math.degrees(math.atan2(first.u[1], first.u[0]))
    return ChannelFault(
        "echo",
        (),
        f"the sound from {bearing_deg:.0f} deg is an echo: the same sound came "
        f"{1e3 * first.earlier_s:.1f} ms before from about {bearing:.0f} deg, less "
        "loud; the source is probably there; move the array away from reflecting "
        "surfaces, or remove what hides the source",
    )


def first_sound(
    recording: RecordingSpectra,
    shape: ArrayShape,
    c: float,
    u: NDArray[np.float64],
) -> FirstSound | None:
    """Finds the most likely first sound before the sound from the direction ``u``.

    The result is None if the array is too large, or if the recording is too short.
    """
    travel_s = shape.max_delay(c)
    high_hz = min(recording.high_hz, _HIGHEST_HZ)
    rate = recording.sample_rate_hz
    size = int(fft.next_fast_len(round(_WINDOW_S * rate), real=True))
    short = recording.channels.shape[1] < size
    if short or travel_s > _LONGEST_S or high_hz <= recording.low_hz + _SMOOTH_HZ:
        return None
    main_s = centroid_delays(u[np.newaxis], np.zeros(1), shape, c)[0]
    points = int(fft.next_fast_len(math.ceil(_DENSITY * high_hz * size / rate)))
    lag_rate = points / size * rate
    reach = math.ceil((_LATEST_S + 2.0 * travel_s) * lag_rate)
    band = (recording.low_hz, high_hz)
    cross, bins = _cross_spectra(recording, size, band, main_s)
    values = correlations_at_lags(cross, bins, max(points, size), reach)
    top = float(values[:, reach].mean())
    grid = SearchGrid.of(shape, c, _GRID * high_hz, _WINDOW_S)
    far = grid.p_AS[grid.inverse_range == 0.0]
    change_s = centroid_delays(far, np.zeros(len(far)), shape, c) - main_s
    away = np.sqrt(np.mean(change_s**2, axis=1)) > _ELSEWHERE * _radius(shape) / c
    if top <= 0.0 or not away.any():
        return None
    far, steps = far[away], np.rint(change_s[away] * lag_rate).astype(np.int64)
    earliest = max(_EARLIEST_S, _TRAVELS * travel_s)
    lags = np.arange(round(earliest * lag_rate), round(_LATEST_S * lag_rate))
    before = _heights(values, reach - lags, steps)
    after = _heights(values, reach + lags, steps)
    place, lag = np.unravel_index(int(before.argmax()), before.shape)
    height = float(before[place, lag])
    return FirstSound(
        u=far[place],
        earlier_s=float(lags[lag]) / lag_rate,
        height=height / top,
        ratio=height / max(float(after.max()), 1e-9 * top),
    )


def _cross_spectra(
    recording: RecordingSpectra,
    size: int,
    band_hz: tuple[float, float],
    main_s: NDArray[np.float64],
) -> tuple[NDArray[np.complex64], slice]:
    """Correlates channels, aligned by (n,) delays, with their mean.

    Returns the (n, f) cross-spectra with bands of equal level, and their bins.
    """
    channels, step_hz = recording.channels, recording.sample_rate_hz / size
    first, last = math.ceil(band_hz[0] / step_hz), math.floor(band_hz[1] / step_hz)
    bins = slice(first, last + 1)
    w = 2.0 * math.pi * step_hz * np.arange(first, last + 1)
    aligned = np.exp(1j * np.outer(main_s, w)).astype(np.complex64)[:, np.newaxis]
    window = np.hanning(size).astype(np.float32)
    cross = np.zeros((len(channels), w.size), dtype=np.complex64)
    power = np.zeros(w.size)
    starts = np.arange(0, channels.shape[1] - size + 1, size // 2)
    for k in range(0, starts.size, _BLOCK):
        take = starts[k : k + _BLOCK, np.newaxis] + np.arange(size)
        spectra = fft.rfft(channels[:, take] * window, axis=-1)[..., bins] * aligned
        cross += np.einsum("nkf,kf->nf", spectra, spectra.mean(axis=0).conj())
        power += np.mean(np.abs(spectra) ** 2, axis=0).sum(axis=0)
    level = uniform_filter1d(power, max(1, round(_SMOOTH_HZ / step_hz)))
    level += 1e-3 * level.max() + np.finfo(np.float32).tiny
    return (cross / level).astype(np.complex64), bins


def _heights(
    values: NDArray[np.float32], columns: NDArray[np.int64], steps: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Returns (g, l) means over channels at the columns, shifted by (g, n) steps."""
    heights = np.zeros((len(steps), columns.size), dtype=np.float32)
    for row, step in zip(values, steps.T, strict=True):
        heights += row[columns + step[:, np.newaxis]]
    return heights / np.float32(len(values))


def _radius(shape: ArrayShape) -> float:
    return float(np.sqrt(np.mean(np.sum(shape.p_AM**2, axis=1))))
