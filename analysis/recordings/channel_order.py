"""Whether delays belong to a place, or only do so with two channels exchanged.

Not to be seen from sound is an exchange that makes the array its own mirror
image (the ends of a symmetric row, opposite corners of a square), and which of
two exchanges it was if they differ by such an image (the two ends of either
side of a square: both are named). A source straight ahead of a row shows no
exchange at all, for all its delays are alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from systems.hearing.coherent import arrival_delays
from systems.hearing.multilateration import locate_source
from systems.hearing.source_fix import SourceFix
from systems.sound.array_shape import ArrayShape

# Delays fit where they are right to this part of a sample, to this share of what
# sound needs across the array, or to so many deviations of the microphones' places.
_FIT_SAMPLES = 0.25
_FIT_SHARE = 0.05
_FIT_DEVIATIONS = 5.0

# Fewer frames whose pairs agree prove nothing.
_LEAST_FRAMES = 5

# Exchanges times frames that are tried, at most.
_MOST_TRIALS = 20_000

# Shares of such frames that fit a wrong geometry at most, and a right one at
# least; shares nearer to each other than this are alike; and one that is hopeless.
_WRONG, _RIGHT, _ALIKE, _HOPELESS = 0.35, 0.6, 0.1, 0.1

# Spread of 1/R below which levels say nothing of a range, dB, and in deviations of
# the channels' gains.
_LEAST_SPREAD_DB, _LEAST_SPREAD = 3.0, 1.5


@dataclass(frozen=True)
class FrameDelays:
    """Delays of all pairs of microphones in f frames of a recording."""

    lags: NDArray[np.float64]
    """(f, p) of ``shape.pairs``, samples."""
    levels: NDArray[np.float64]
    """(f, n) of the channels, any unit."""
    shape: ArrayShape
    """The n microphones."""
    metres_per_sample: float
    """Speed of sound over the sample rate."""
    position_std_m: float = 0.0
    """Of the microphones' places, root mean square."""
    gain_std_db: float = 0.0
    """Of the channels, dB."""

    @property
    def tolerance_m(self) -> float:
        """By how much delays may be off that fit a place, m."""
        across = _FIT_SHARE * self.shape.aperture_m
        return max(_FIT_SAMPLES * self.metres_per_sample, across, self.misplaced_m)

    @property
    def misplaced_m(self) -> float:
        """By how much the microphones' places alone may put delays off, m."""
        return _FIT_DEVIATIONS * self.position_std_m

    def agreeing(
        self, tolerance_m: float = np.inf
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Differences of range, and levels, of the frames in which all pairs agree.

        Args:
            tolerance_m: How well they agree, m, where that is less than what serves
                to find a place.

        Returns:
            (k, n - 1) range from each microphone less that from microphone 0, m, and
            levels (k, n); k frames of f.
        """
        i, j = self.shape.pairs.T
        identity = np.eye(self.shape.count)
        to_pairs = (identity[j] - identity[i])[:, 1:]
        d = self.lags * self.metres_per_sample
        differences = d @ np.linalg.pinv(to_pairs).T
        errors = np.sqrt(np.mean((d - differences @ to_pairs.T) ** 2, axis=1))
        agree = errors < min(self.tolerance_m, tolerance_m)
        return differences[agree], self.levels[agree]


def exchanged_channels(delays: FrameDelays) -> list[tuple[int, int]]:
    """Exchanges, each of two channels, of which one makes the delays fit.

    Returns:
        Pairs of numbers from 0. Empty where the delays fit as they are, or where
        no exchange helps.
    """
    (d, levels), shape = delays.agreeing(), delays.shape
    if len(d) < _LEAST_FRAMES or _fitting(d, levels, delays)[0] > _WRONG:
        return []
    # Nearer ones may well stand the other way round.
    apart = shape.distances_m > np.sqrt(2.0) * delays.misplaced_m
    exchanges = [(int(i), int(j)) for i, j in shape.pairs[apart]]
    if not exchanges:
        return []
    trials = len(d) * len(exchanges)
    every = max(1, min(trials // _MOST_TRIALS, len(d) // _LEAST_FRAMES))
    d, levels = d[::every], levels[::every]
    turned = (
        replace(delays, shape=replace(shape, p_AM=exchanged(shape.p_AM, *pair)))
        for pair in exchanges
    )
    found = [_fitting(d, levels, other) for other in turned]
    best = max(share for share, _ in found)
    if best < _RIGHT:
        return []
    least = min(error for share, error in found if share > best - _ALIKE)
    limit = 1.5 * least + 0.05 * delays.tolerance_m
    return [
        pair
        for pair, (share, error) in zip(exchanges, found, strict=True)
        if share > best - _ALIKE and error < limit
    ]


def misfit(delays: FrameDelays) -> float | None:
    """Share of the frames that fit no place, if it is hopeless; else None.

    Returns:
        0 to 1, or None where too few frames agree or enough of them fit.
    """
    d, levels = delays.agreeing()
    if len(d) < 2 * _LEAST_FRAMES:
        return None
    share, _ = _fitting(d, levels, delays)
    return 1.0 - share if share < _HOPELESS else None


def exchanged(rows: NDArray[np.float64], i: int, j: int) -> NDArray[np.float64]:
    """An array with two of its rows exchanged.

    Args:
        rows: (n, ...).
        i: Number of one row, from 0.
        j: Number of the other one.

    Returns:
        (n, ...), a copy.
    """
    order = np.arange(len(rows))
    order[[i, j]] = j, i
    return rows[order]


def _fitting(
    differences: NDArray[np.float64],
    levels: NDArray[np.float64],
    delays: FrameDelays,
) -> tuple[float, float]:
    """Share of the frames that a place outside the array explains, and RMS error.

    The error in m is that of the frames that it explains.
    """
    shape, tolerance = delays.shape, delays.tolerance_m
    gain_std_db = delays.gain_std_db
    if shape.kind == "plane" and shape.dimension == 2:
        # The source need not lie in the plane.
        shape = ArrayShape.of(np.column_stack((shape.p_AM, np.zeros(shape.count))))
    covariance = (0.5 * tolerance) ** 2 * (np.eye(shape.count - 1) + 1.0)
    errors = []
    for d, level in zip(differences, levels, strict=True):
        fix = locate_source(d, covariance, shape, 1.0)
        off = arrival_delays(fix, shape, 1.0) - d
        fits = np.abs(off).max() < tolerance
        if fits and not levels_contradict(level, fix, shape, gain_std_db):
            errors.append(off)
    if not errors:
        return 0.0, np.inf
    return len(errors) / len(differences), float(np.sqrt(np.mean(np.square(errors))))


def levels_contradict(
    levels: NDArray[np.float64],
    fix: SourceFix,
    shape: ArrayShape,
    gain_std_db: float = 0.0,
) -> bool:
    """Whether a near source would be heard at other levels than these.

    Exchanged neighbours in a row, for one, make the delays of a source very
    near to the array. Its levels would fall as 1/R.

    Args:
        levels: (n,) RMS of the channels' sound, any unit.
        fix: A fix, with a range or without.
        shape: The n microphones.
        gain_std_db: Standard deviation of the channels' gains, dB.

    Returns:
        True where the levels follow less than half of what 1/R asks for.
    """
    if not fix.range_valid:
        return False
    ranges = np.linalg.norm(shape.p_AM - fix.p_AS, axis=1)
    expected = -20.0 * np.log10(np.maximum(ranges, 1e-3))
    if np.ptp(expected) < max(_LEAST_SPREAD_DB, _LEAST_SPREAD * gain_std_db):
        return False
    expected -= expected.mean()
    measured = 20.0 * np.log10(np.maximum(levels, 1e-300))
    return bool(measured @ expected < 0.5 * (expected @ expected))
