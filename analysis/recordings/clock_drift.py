"""Channels of recorders whose clocks drift apart.

Sound cannot come later at one microphone than at another by more than it takes between
them. Delays that grow steadily until they are longer are those of two clocks. They are
looked for over all that clocks may have drifted by, in cross-correlations with phase
transform of short stretches (Knapp and Carter 1976).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.stats import theilslopes

from analysis.recordings.channel_faults import ChannelFault
from systems.delays.correlations import correlations_at_lags

#: Length of a stretch, s: clocks that are off by 100 ppm drift by 50 us in it.
STRETCH_S = 0.5

# Delays up to this are looked for, s.
_REACH_S = 0.05

# Highest frequency that counts: drift within a stretch blurs those above, Hz.
_BAND_HZ = (200.0, 4_000.0)

# A peak is one if it stands so many times above the root mean square beside it.
_STANDS_OUT = 6.0

# Stretches that are needed, and the time that they have to span, s.
_LEAST, _LEAST_S, _MOST = 8, 4.0, 240

# By how much delays have to exceed what the array allows.
_BEYOND = 1.15

# Channels whose delays grow by at least this share of the fastest drift with it.
_TOGETHER = 0.5

# Clocks that are worse than this are no clocks, 1.
_MOST_DRIFT = 2e-3


def common_lags(
    samples: NDArray[np.floating], sample_rate_hz: float
) -> NDArray[np.float64]:
    """Delays of a stretch of sound.

    Args:
        samples: (n, k) channels.
        sample_rate_hz: Their rate, Hz.

    Returns:
        (n - 1,) delay after channel 0 of each further one, s; NaN where they have
        nothing in common.
    """
    length = samples.shape[1]
    size = int(fft.next_fast_len(2 * length, real=True))
    spectra = fft.rfft(samples * np.hanning(length).astype(samples.dtype), size)
    f = fft.rfftfreq(size, 1.0 / sample_rate_hz)
    spectra[:, (f < _BAND_HZ[0]) | (f > _BAND_HZ[1])] = 0.0
    cross = spectra[0].conj() * spectra[1:]
    size_of = np.abs(cross)
    white = np.divide(cross, size_of, out=np.zeros_like(cross), where=size_of > 0.0)
    reach = min(round(_REACH_S * sample_rate_hz), length - 1)
    values = correlations_at_lags(white, slice(None), size, reach)
    lags = (values.argmax(axis=1) - reach) / sample_rate_hz
    noise = np.sqrt(np.mean(values**2, axis=1))
    heard = values.max(axis=1) > _STANDS_OUT * np.maximum(noise, 1e-12)
    return np.where(heard, lags, np.nan)


def clock_drift(
    t_s: NDArray[np.float64],
    lags: NDArray[np.float64],
    p_AM: NDArray[np.float64],
    c: float,
    channels: Sequence[int] | None = None,
) -> ChannelFault | None:
    """Channels whose delays grow steadily beyond what the array allows.

    Args:
        t_s: (k,) middles of stretches, s.
        lags: (k, n - 1) their delays, as ``common_lags`` tells them.
        p_AM: (m, 2 or 3) places of all microphones, m.
        c: Speed of sound, m/s.
        channels: Numbers of the n that are looked at, from 0; none: all.

    Returns:
        Which ones, and how fast; None: no drift can be told.
    """
    numbers = list(range(len(p_AM)) if channels is None else channels)
    allowed = np.linalg.norm(p_AM[numbers[1:]] - p_AM[numbers[0]], axis=1) / c
    found = [_slope(t_s, lag, most) for lag, most in zip(lags.T, allowed, strict=True)]
    beyond = [slope for slope, is_beyond in found if is_beyond]
    if not beyond:
        return None
    fastest = max(beyond, key=abs)
    drifting = [False, *(slope / fastest > _TOGETHER for slope, _ in found)]
    late, others = (
        [k for k, drifts in zip(numbers, drifting, strict=True) if drifts == which]
        for which in (True, False)
    )
    clock = "its clock drifts" if len(late) == 1 else "their clock drifts"
    return ChannelFault(
        "drift",
        tuple(late),
        f"{_names(late)}: {clock} from that of {_names(others)} by "
        f"{1e6 * abs(fastest):.0f} us per second; record all channels with one clock",
    )


def _names(channels: Sequence[int]) -> str:
    word = "channel" if len(channels) == 1 else "channels"
    return f"{word} {' and '.join(str(k + 1) for k in channels)}"


def recording_drift(
    samples: NDArray[np.float64],
    sample_rate_hz: float,
    p_AM: NDArray[np.float64],
    c: float,
) -> ChannelFault | None:
    """The same for a whole recording.

    Args:
        samples: (n, k) channels without NaN.
        sample_rate_hz: Their rate, Hz.
        p_AM: (n, 2 or 3) places of the microphones, m.
        c: Speed of sound, m/s.

    Returns:
        As ``clock_drift``.
    """
    size = round(STRETCH_S * sample_rate_hz)
    starts = np.arange(0, samples.shape[1] - size + 1, size)
    starts = starts[:: -(-len(starts) // _MOST) or 1]
    if len(starts) < _LEAST:
        return None
    lags = np.array(
        [common_lags(samples[:, k : k + size], sample_rate_hz) for k in starts]
    )
    return clock_drift((starts + 0.5 * size) / sample_rate_hz, lags, p_AM, c)


def _slope(
    t_s: NDArray[np.float64], lag: NDArray[np.float64], allowed: float
) -> tuple[float, bool]:
    """Of a line through delays, and whether that leads out of what is allowed."""
    heard = np.isfinite(lag)
    if np.count_nonzero(heard) < _LEAST:
        return 0.0, False
    t, lag = t_s[heard], lag[heard]
    if t[-1] - t[0] < _LEAST_S:
        return 0.0, False
    slope, offset, low, high = theilslopes(lag, t)
    line = offset + slope * t
    off = float(np.median(np.abs(lag - line)))
    leaves = float(np.abs(line[[0, -1]]).max()) > _BEYOND * allowed
    grows = abs(slope) * (t[-1] - t[0]) > allowed and low * high > 0.0
    steady = off < allowed and abs(slope) < _MOST_DRIFT
    return float(slope), leaves and grows and steady
