"""Finds channels from recorders whose clocks drift apart.

The delays of a moving source change as well, but at each time, they are those of a
wave front. Drifting clocks change delays so that they fit a wave front less and less,
or become longer than sound takes from one microphone to another. If a drift changes the
delays like a source that turns around the array, the two cannot be distinguished, until
the delays are too long for the array.

The recording is cut into short stretches. The delays of each stretch are the peaks of
cross-correlations with the phase transform (Knapp and Carter 1976). The search covers
all delays that drifting clocks may have reached.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import fft
from scipy.stats import theilslopes

from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.known_medians import known_medians
from analysis.arrays.wave_fronts import wave_front_misfits
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
_LEAST, _LEAST_S, _MOST = 12, 4.0, 240

# Number of stretches before and after a stretch with which its delays are compared.
_BESIDE = 6

# The misfits of a drift grow by more than the larger of two limits:
# - _GROWTH_S: a time that is longer than the errors of delays in rooms, s.
# - _GROWTH_SHARE: a share of the travel time of sound along the array.
_GROWTH_S, _GROWTH_SHARE = 1.2e-4, 0.05

# The misfits of a drift grow steadily:
# - _HALFWAY: at half time, the growth is at least this share of the whole growth, and
#   at most 1 minus this share.
# - _SCATTER: largest median deviation within a third of the time, as a share of the
#   growth. A linear growth has a share of 1/8.
_HALFWAY, _SCATTER = 0.2, 0.35

# Channels drift together if their delays grow by at least this share of the fastest
# drift, in the same direction.
_TOGETHER = 0.5

# Delays that are off a straight line by more than this share of their change are those
# of a moving source. They do not tell which channels drift.
_MOVES = 0.12

# A motion looks like two clocks that drift apart in these conditions:
# - _STEADY_S: it lasts at least this time, s.
# - _ALIKE: the slopes of the delays differ by at most this share of the largest.
# - _FLAT_M: microphones within this distance of a line or plane count as on it, m.
# - _CURVED_M: from this aperture on, delays also depend on the range, m.
_STEADY_S, _ALIKE, _FLAT_M, _CURVED_M = 10.0, 0.15, 1e-3, 0.5

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
    memory: MisfitMemory | None = None,
) -> ChannelFault | None:
    """Finds channels whose delays leave those of any source further and further.

    If the array has no spare delays, a fault of the kind ``moves`` says that a steady
    motion could also be a drift.

    The delays ``lags`` are the results of ``common_lags`` for k stretches, with the
    shape (k, n - 1), and ``t_s`` are the middles of the stretches. ``p_AM`` contains
    the positions of all microphones, m. If the n channels are not all channels,
    ``channels`` lists their numbers from 0.
    Calls with the same microphones and mostly the same delays may share a ``memory``.
    """
    numbers = list(range(len(p_AM)) if channels is None else channels)
    places = p_AM[numbers]
    lags = _without_echoes(lags, np.linalg.norm(places[1:] - places[0], axis=1) / c)
    heard = np.isfinite(lags).any(axis=1)
    t_s, lags = t_s[heard], lags[heard]
    if len(t_s) < _LEAST or t_s[-1] - t_s[0] < _LEAST_S:
        return None
    misfits = (memory or MisfitMemory()).misfits(lags, places, c)
    # The delays may leave those of a source only in the second half of the time.
    parts = (misfits, misfits[-max(_LEAST, len(t_s) // 2) :])
    leaves = any(_leaves(part, places, c) for part in parts)
    growth = _Growth.of(t_s, lags)
    if leaves and not growth.linear:
        return ChannelFault(
            "drift",
            (),
            "channels: their clocks drift apart, because their delays fit a source "
            "less and less; record all channels with one clock",
        )
    late, others = (
        [k for k, drifts in zip(numbers, growth.drifting, strict=True) if drifts == one]
        for one in (True, False)
    )
    by = f"by {1e6 * growth.fastest:.0f} us per second"
    if leaves and growth.fastest < _MOST_DRIFT:
        clock = "its clock drifts" if len(late) == 1 else "their clock drifts"
        return ChannelFault(
            "drift",
            tuple(late),
            f"{_names(late)}: {clock} from that of {_names(others)} {by}; record all "
            "channels with one clock",
        )
    if not leaves and _spare_delays(places) <= 0 and growth.imitates:
        return ChannelFault(
            "moves",
            tuple(late),
            f"{_names(late)}: delays change steadily {by}: the source moves, or the "
            f"clock drifts from that of {_names(others)}; record all channels with one "
            "clock to be sure",
        )
    return None


class MisfitMemory:
    """Remembers the misfits of the last delays, because they take long to compute."""

    def __init__(self) -> None:
        self._known: dict[bytes, NDArray[np.float64]] = {}

    def misfits(
        self, lags: NDArray[np.float64], places: NDArray[np.float64], c: float
    ) -> NDArray[np.float64]:
        """Computes ``wave_front_misfits`` for rows of delays that are not known yet."""
        keys = [row.tobytes() for row in lags]
        new = [k for k, key in enumerate(keys) if key not in self._known]
        found = wave_front_misfits(lags[new], places, c)
        known = self._known | dict(zip([keys[k] for k in new], found, strict=True))
        self._known = {key: known[key] for key in keys}
        return np.array([known[key] for key in keys])


@dataclass(frozen=True)
class _Growth:
    """Straight lines through the delays of all channels."""

    slopes: NDArray[np.float64]
    """(n,) slopes relative to channel 0, s/s."""
    off_s: float
    """Largest usual distance of a delay from its line, s."""
    seconds: float
    """Time from the first to the last stretch, s."""

    @classmethod
    def of(cls, t_s: NDArray[np.float64], lags: NDArray[np.float64]) -> _Growth:
        lines = [_line(t_s, lag) for lag in lags.T]
        slopes = np.array([0.0, *(slope for slope, _ in lines)])
        return cls(slopes, max(off for _, off in lines), float(t_s[-1] - t_s[0]))

    @property
    def fastest(self) -> float:
        """Largest magnitude of a slope, s/s."""
        return float(np.abs(self.slopes).max())

    @property
    def linear(self) -> bool:
        """Whether the delays are on straight lines, unlike those of most motions."""
        return self.fastest > 0.0 and self.off_s <= _MOVES * self.fastest * self.seconds

    @property
    def drifting(self) -> NDArray[np.bool_]:
        """(n,) whether each channel drifts together with the fastest."""
        fastest = self.slopes[np.abs(self.slopes).argmax()]
        return np.asarray(self.slopes / (fastest or 1.0) > _TOGETHER)

    @property
    def imitates(self) -> bool:
        """Whether a motion is so steady, and so alike in channels, as two clocks."""
        if not self.linear or self.seconds < _STEADY_S:
            return False
        share = np.abs(self.slopes) / self.fastest
        alike = np.all(np.minimum(share, np.abs(1.0 - share)) < _ALIKE)
        return bool(alike) and self.fastest * self.seconds > _GROWTH_S


def _spare_delays(places: NDArray[np.float64]) -> int:
    """Returns how many delays a source does not explain by its direction, and range.

    The range counts only if the array is so large that waves are curved.
    """
    aperture = float(np.linalg.norm(places[:, np.newaxis] - places, axis=2).max())
    angles = int(np.linalg.matrix_rank(places - places[0], tol=_FLAT_M))
    return len(places) - 1 - angles - (aperture > _CURVED_M)


def _without_echoes(
    lags: NDArray[np.float64], allowed_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns (k, n - 1) delays without those that no source can have beside the rest.

    Each delay is compared with the median of its neighbors in time. The delays of two
    sources differ by at most twice the travel time between the two microphones.
    """
    padded = np.pad(lags, ((_BESIDE, _BESIDE), (0, 0)), constant_values=np.nan)
    windows = sliding_window_view(padded, 2 * _BESIDE + 1, axis=0)
    off = np.abs(lags - known_medians(windows))
    return np.where(off < 2.0 * allowed_s + _GROWTH_S, lags, np.nan)


def _leaves(
    misfits: NDArray[np.float64], places: NDArray[np.float64], c: float
) -> bool:
    """Returns whether (k, n) misfits of wave fronts grow steadily over k stretches.

    The misfits of the first, middle and last third of the stretches are compared by
    their medians, because echoes cause large errors in some stretches.
    """
    thirds = [_median(part) for part in np.array_split(misfits, 3)]
    growth = thirds[2] - thirds[0]
    known = np.isfinite(growth + thirds[1])
    if not known.any():
        return False
    size = float(np.linalg.norm(growth[known]))
    aperture_s = float(np.linalg.norm(places[:, np.newaxis] - places, axis=2).max()) / c
    if size < max(_GROWTH_S, _GROWTH_SHARE * aperture_s):
        return False
    along = growth[known] / size
    halfway = float((thirds[1] - thirds[0])[known] @ along) / size
    scatter = max(
        float(known_medians(np.abs((part - middle)[:, known] @ along)))
        for part, middle in zip(np.array_split(misfits, 3), thirds, strict=True)
    )
    return _HALFWAY < halfway < 1.0 - _HALFWAY and scatter < _SCATTER * size


def _median(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the medians of columns; NaN for a column with fewer than 3 numbers."""
    known = np.isfinite(values).sum(axis=0) >= 3
    return np.where(known, known_medians(values, axis=0), np.nan)


def _names(channels: Sequence[int]) -> str:
    *first, last = (str(k + 1) for k in channels)
    return f"channels {', '.join(first)} and {last}" if first else f"channel {last}"


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


def _line(t_s: NDArray[np.float64], lag: NDArray[np.float64]) -> tuple[float, float]:
    """Returns the slope of a line through delays, s/s, and their usual distance, s."""
    heard = np.isfinite(lag)
    if np.count_nonzero(heard) < _LEAST:
        return 0.0, 0.0
    t_s, lag = t_s[heard], lag[heard]
    slope, offset, _, _ = theilslopes(lag, t_s)
    return float(slope), float(np.median(np.abs(lag - offset - slope * t_s)))
