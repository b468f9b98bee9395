"""Checks whether delays fit the size of the array, and the order of its channels.

Sound takes at most the straight travel time from one microphone to another. The delays
of all pairs can be much shorter in only one case. In this case, the source is straight
ahead of a row, or straight above a plane. It is also far away, because the wave fronts
must be nearly flat.

The delays cannot reveal the following exchanges:

- Some exchanges turn the array into its own mirror image. Examples are the ends of a
  symmetric row and opposite corners of a square.
- Two different exchanges can give mirror images of each other. For example, exchanging
  the two ends of one side of a square gives the mirror image of exchanging the ends of
  the opposite side. Both exchanges are then reported.
- If a source is straight ahead of a row, all delays are equal. They then reveal no
  exchange.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.body_delays import free_air_delays
from analysis.arrays.far_field import locate_far_source
from systems.hearing.coherent import arrival_delays
from systems.hearing.multilateration import locate_source
from systems.hearing.source_fix import NEAREST_M, SourceFix
from systems.sound.array_shape import ArrayShape

# Delays fit if their error is below the largest of three tolerances:
# - _FIT_SAMPLES: share of a sample.
# - _FIT_SHARE: share of the time that sound needs to cross the array.
# - _FIT_DEVIATIONS: multiple of the standard deviation of the microphone positions.
_FIT_SAMPLES = 0.25
_FIT_SHARE = 0.05
_FIT_DEVIATIONS = 5.0

# Least number of frames in which all pairs agree. Fewer frames prove nothing.
_LEAST_FRAMES = 5

# Largest number of trials. Each trial tests one exchange on one frame.
_MOST_TRIALS = 20_000

# Shares of the agreeing frames that fit a source position:
# - _WRONG: largest share for a wrong geometry.
# - _RIGHT: least share for a correct geometry.
# - _ALIKE: largest difference between two shares that count as equal.
# - _HOPELESS: below this share, the geometry is reported as wrong.
_WRONG, _RIGHT, _ALIKE, _HOPELESS = 0.35, 0.6, 0.1, 0.1

# Least spread of the expected levels at which levels say something about the range:
# - _LEAST_SPREAD_DB: in dB.
# - _LEAST_SPREAD: in standard deviations of the channel gains.
_LEAST_SPREAD_DB, _LEAST_SPREAD = 3.0, 1.5

#: If delays do not fit the array, the search covers delays up to these path lengths, m.
REACHES_M = (0.3, 3.0)

# Least share of the frames that agree on delays of any size.
_LEAST_SHARE = 0.2

# Limits of delays, as a share of the longest possible delay:
# - _IMPOSSIBLE: if half of the frames exceed this share, the delays are too long.
# - _NOTHING: if the share _MOST of the frames stays below this, the delays are too
#   short. They may also be those of a source straight above the array.
# - _MOST: share of the frames for _NOTHING.
# For comparison, positions in inches give a share of 0.025, and positions in cm 0.01.
_IMPOSSIBLE, _NOTHING = 1.5, 0.03
_MOST = 0.75

# Least distance of a pair as a share of the aperture. The delays of shorter pairs are
# too short to compare.
_LONG = 0.3

# Possible error of a delay, samples, and its usual standard deviation.
_SAMPLES, _NEAR_SAMPLES = 1.0, 0.1

# Largest ratio of the stated speed of sound to another speed, and largest scatter of
# this ratio. Echoes in phase at near microphones may shorten delays by a third.
_FASTER, _SCATTER = 0.5, 0.3


@dataclass(frozen=True)
class FrameDelays:
    """Delays of p pairs of n microphones in f frames of a recording."""

    lags: NDArray[np.float64]
    """(f, p) delays of the pairs in ``shape.pairs``, samples."""
    levels: NDArray[np.float64]
    """(f, n) levels of the channels, in any unit."""
    shape: ArrayShape
    """The n microphones."""
    meters_per_sample: float
    """Speed of sound divided by the sample rate, m per sample."""
    position_std_m: float = 0.0
    """Standard deviation of the microphone positions, root mean square, m."""
    gain_std_db: float = 0.0
    """Standard deviation of the channel gains, dB."""

    @property
    def tolerance_m(self) -> float:
        """Largest error of delays that fit a source position, as a distance, m."""
        across = _FIT_SHARE * self.shape.aperture_m
        return max(_FIT_SAMPLES * self.meters_per_sample, across, self.misplaced_m)

    @property
    def misplaced_m(self) -> float:
        """Largest error of delays from wrong microphone positions, as a distance, m."""
        return _FIT_DEVIATIONS * self.position_std_m

    def agreeing(
        self, tolerance_m: float = np.inf
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns the frames in which all pairs agree on the delays.

        The results are the (k, n - 1) differences of the distances of the source from
        microphones 1 ... n - 1 and from microphone 0, m, and the (k, n) levels. The
        root-mean-square disagreement of the pairs is below ``tolerance_m``, or below
        ``self.tolerance_m`` if this is smaller.
        """
        i, j = self.shape.pairs.T
        identity = np.eye(self.shape.count)
        to_pairs = (identity[j] - identity[i])[:, 1:]
        d = self.lags * self.meters_per_sample
        differences = d @ np.linalg.pinv(to_pairs).T
        errors = np.sqrt(np.mean((d - differences @ to_pairs.T) ** 2, axis=1))
        agree = errors < min(self.tolerance_m, tolerance_m)
        return differences[agree], self.levels[agree]


def exchanged_channels(delays: FrameDelays) -> list[tuple[int, int]]:
    """Finds the exchanges of two channels that make the delays fit a source position.

    If there are several pairs of channel numbers, one of them is the exchange. The list
    is empty if the delays fit as they are, if no exchange helps, or if the pairs agree
    in too few frames.
    """
    (d, levels), shape = delays.agreeing(), delays.shape
    if len(d) < _LEAST_FRAMES or _fitting(d, levels, delays)[0] > _WRONG:
        return []
    # Microphones that are nearer to each other may really be in the other order.
    apart = shape.distances_m > np.sqrt(2.0) * delays.misplaced_m
    exchanges = [(int(i), int(j)) for i, j in shape.pairs[apart]]
    if not exchanges:
        return []
    trials = len(d) * len(exchanges)
    every = max(1, min(trials // _MOST_TRIALS, len(d) // _LEAST_FRAMES))
    d, levels = d[::every], levels[::every]
    turned = (
        replace(delays, shape=_with_exchanged(shape, *pair)) for pair in exchanges
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
    """Returns the share of the agreeing frames that fit no source position.

    It is None if more than 10 % of these frames fit, or if too few frames agree.
    """
    d, levels = delays.agreeing()
    if len(d) < 2 * _LEAST_FRAMES:
        return None
    share, _ = _fitting(d, levels, delays)
    return 1.0 - share if share < _HOPELESS else None


def slower_than_stated(delays: FrameDelays) -> float | None:
    """Returns the ratio of the stated speed of sound to the speed that delays fit.

    Only microphones in space measure the speed. The result is None unless the speed is
    at least twice the stated one: a near source causes short delays as well, but its
    levels differ. It is also None if too few frames agree.
    """
    shape = delays.shape
    d, levels = delays.agreeing()
    if shape.kind != "space" or len(d) < 2 * _LEAST_FRAMES:
        return None
    later = np.hstack((np.zeros((len(d), 1)), d))
    later -= later.mean(axis=1, keepdims=True)
    ratios = np.linalg.norm(later @ np.linalg.pinv(shape.p_AM).T, axis=1)
    low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75))
    if not _NOTHING < middle < _FASTER or high - low > _SCATTER * middle:
        return None
    covariance = (_NEAR_SAMPLES * delays.meters_per_sample) ** 2 * (
        np.eye(shape.count - 1) + 1.0
    )
    near = 0
    for each, level in zip(d, levels, strict=True):
        fix = locate_source(each, covariance, shape, 1.0)
        off = arrival_delays(fix, shape, 1.0) - each
        fits = fix.range_valid and np.abs(off).max() < delays.tolerance_m
        near += bool(fits and _follows_range(level, fix, shape) > 0.5)
    return None if 2 * near > len(d) else float(middle)


def near_range_m(delays: FrameDelays) -> float | None:
    """Returns the distance of a source that is too near to the middle of the array, m.

    The result is None if most of the frames do not fit such a position, or if the
    levels of the channels do not differ as they would for it.
    """
    shape = delays.shape
    d, levels = delays.agreeing()
    if len(d) < 2 * _LEAST_FRAMES:
        return None
    sigma = _NEAR_SAMPLES * delays.meters_per_sample
    covariance = sigma**2 * (np.eye(shape.count - 1) + 1.0)
    ranges = []
    for each, level in zip(d, levels, strict=True):
        fix = locate_source(each, covariance, shape, 1.0)
        near = fix.range_valid and fix.range < NEAREST_M
        if near and not levels_contradict(level, fix, shape, delays.gain_std_db):
            ranges.append(fix.range)
    if 2 * len(ranges) < len(d):
        return None
    return float(np.median(ranges))


def exchanged(rows: NDArray[np.float64], i: int, j: int) -> NDArray[np.float64]:
    """Returns a copy of an array with the rows i and j exchanged."""
    order = np.arange(len(rows))
    order[[i, j]] = j, i
    return rows[order]


def _with_exchanged(shape: ArrayShape, i: int, j: int) -> ArrayShape:
    body = shape.body
    if body is not None:
        body = replace(body, toward=exchanged(body.toward, i, j))
    return replace(shape, p_AM=exchanged(shape.p_AM, i, j), body=body)


def _fitting(
    differences: NDArray[np.float64], levels: NDArray[np.float64], delays: FrameDelays
) -> tuple[float, float]:
    """Returns the share of frames that fit a position outside the array, and the error.

    The error is the root mean square over these frames, m, or infinite if there are
    none.
    """
    shape, tolerance = delays.shape, delays.tolerance_m
    gain_std_db = delays.gain_std_db
    covariance = (0.5 * tolerance) ** 2 * (np.eye(shape.count - 1) + 1.0)
    if shape.body is not None:
        free = [free_air_delays(d, covariance, shape, 1.0) for d in differences]
        differences = np.reshape(free, differences.shape)
    if shape.kind == "plane" and shape.dimension == 2:
        # The source may be above or below the plane.
        shape = ArrayShape.of(np.column_stack((shape.p_AM, np.zeros(shape.count))))
    errors = []
    for d, level in zip(differences, levels, strict=True):
        # On a body, only the delays of distant sources are known.
        locate = locate_source if shape.body is None else locate_far_source
        fix = locate(d, covariance, shape, 1.0)
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
    """Returns whether the (n,) measured levels contradict a near source position.

    The level of sound from a near source falls as 1/R with the distance R. The check
    rejects wrong near positions. For example, if two neighbors in a row are exchanged,
    the delays can be those of a source very near to the array. Levels contradict a
    position if they vary by less than half of what the law 1/R requires. They never
    contradict a position without a range, or one for which the law requires nearly
    equal levels.
    """
    if not fix.range_valid:
        return False
    expected = _expected_db(fix, shape)
    if np.ptp(expected) < max(_LEAST_SPREAD_DB, _LEAST_SPREAD * gain_std_db):
        return False
    return _follows_range(levels, fix, shape) < 0.5


def _expected_db(fix: SourceFix, shape: ArrayShape) -> NDArray[np.float64]:
    ranges = np.linalg.norm(shape.p_AM - fix.p_AS, axis=1)
    return -20.0 * np.log10(np.maximum(ranges, 1e-3))


def _follows_range(
    levels: NDArray[np.float64], fix: SourceFix, shape: ArrayShape
) -> float:
    """Returns how far levels vary as those of a source: 1 as there, 0 not at all."""
    expected = _expected_db(fix, shape)
    expected -= expected.mean()
    measured = 20.0 * np.log10(np.maximum(levels, 1e-300))
    return float(measured @ expected) / max(float(expected @ expected), 1e-30)


class DelayScale(NamedTuple):
    """Ratio of measured delays to the longest delays that the array allows."""

    kind: Literal["beyond", "nothing"]
    share: float
    """Delay divided by the longest delay that the array allows. If ``kind`` is
    ``beyond``, it is the median of all frames. If ``kind`` is ``nothing``, three
    quarters of the frames have a smaller value."""
    least_range_m: float
    """Least distance of the source, m, if the array really has the stated size."""


def delay_scale(delays: FrameDelays) -> DelayScale | None:
    """Checks whether delays are too long or too short for the size of the array.

    The result is None if the delays match this size, or if the pairs agree in too few
    frames.
    """
    shape, error = delays.shape, _SAMPLES * delays.meters_per_sample
    d, _ = delays.agreeing(error)
    if len(d) < max(_LEAST_FRAMES, _LEAST_SHARE * len(delays.lags)):
        return None
    later = np.hstack((np.zeros((len(d), 1)), d))
    i, j = shape.pairs.T
    paths = np.abs(later[:, j] - later[:, i])
    certain = paths - error - delays.misplaced_m
    over = float(np.median((certain / shape.distances_m).max(axis=1)))
    if over > _IMPOSSIBLE:
        return DelayScale("beyond", over, 0.0)
    long = shape.distances_m > _LONG * shape.aperture_m
    shares = (paths / shape.distances_m)[:, long].max(axis=1)
    share = float(np.quantile(shares, _MOST))
    if share > _NOTHING:
        return None
    # At the edge of the aperture a, a wave front from the distance R differs from a
    # plane by a^2 / (8 R). As a share of the aperture, this is a / (8 R).
    flat = max(share, 0.25 * delays.meters_per_sample / shape.aperture_m)
    return DelayScale("nothing", share, shape.aperture_m / (8.0 * flat))
