"""Finds channels from recorders whose clocks drift apart.

Sound can arrive at two microphones with a delay of at most the travel time between
them. If a delay grows steadily beyond this limit, the two channels have different
clocks.

The recording is cut into short stretches. The delays of each stretch are the peaks of
cross-correlations with the phase transform (Knapp and Carter 1976). The search covers
all delays that drifting clocks may have reached.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.stats import theilslopes

from analysis.arrays.channel_fault import ChannelFault
from systems.delays.correlations import correlations_at_lags

#: Length of a stretch, s. If clocks differ by 100 ppm, they drift by 50 us in this
#: time.
STRETCH_S = 0.5

# Largest delay in the search, s.
_REACH_S = 0.05

# Lowest and highest frequency in use, Hz. At higher frequencies, the drift within a
# stretch blurs the correlation.
_BAND_HZ = (200.0, 4_000.0)

# Least height of a peak, as a multiple of the root mean square of the correlation.
_STANDS_OUT = 6.0

# _LEAST: least number of stretches.
# _LEAST_S: least time from the first to the last stretch, s.
# _MOST: largest number of stretches.
_LEAST, _LEAST_S, _MOST = 8, 4.0, 240

# Least ratio between a delay and the longest delay that the array allows.
_BEYOND = 1.15

# Channels drift together if their delays grow by at least this share of the fastest
# drift, in the same direction.
_TOGETHER = 0.5

# Largest relative drift of a clock, s/s. A faster change has another cause.
_MOST_DRIFT = 2e-3


def common_lags(
    samples: NDArray[np.floating], sample_rate_hz: float
) -> NDArray[np.float64]:
    """Measures the (n - 1,) delays of channels 1 ... n - 1 after channel 0, s.

    The samples are one stretch of sound with the shape (n, k). The delay is NaN for a
    channel that has no sound in common with channel 0.
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
    """Finds channels whose delays grow steadily beyond what the array allows.

    The delays ``lags`` are the results of ``common_lags`` for k stretches, with the
    shape (k, n - 1), and ``t_s`` are the middles of the stretches. ``p_AM`` contains
    the positions of all microphones, m. If the n channels are not all channels,
    ``channels`` lists their numbers from 0.
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
    """Finds channels of a whole (n, k) recording without NaN whose clocks drift."""
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
    """Returns the slope of a line through delays, and whether it shows a drift."""
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
