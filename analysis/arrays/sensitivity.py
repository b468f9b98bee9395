"""Effects of array errors and of the speed of sound on bearing and range.

- The prediction is of first order. An error changes the delays. The estimated position
  then moves until its delays at the array as stated equal the changed delays.
- The measurement simulates arrays with random errors. The estimator locates the sound
  as if the arrays had no errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.cramer_rao import polar_gradients, polar_point
from analysis.arrays.paper_tables import PaperCell
from analysis.arrays.single_frames import Estimator, Loudspeaker
from systems.framework.signals import TICK_S
from systems.sound.array_shape import ArrayShape

#: Quantiles of a Gaussian at one standard deviation below and above the mean.
_ONE_SIGMA = (0.158655, 0.841345)


@dataclass(frozen=True)
class ArrayErrors:
    """Standard deviations of independent errors of the array and the speed of sound."""

    position_m: float = 0.0
    """Error of each coordinate of each microphone, m."""
    delay_s: float = 0.0
    """Delay error of each channel, s."""
    sound_speed_share: float = 0.0
    """Error of the speed of sound over its stated value."""
    gain_db: float = 0.0
    """Gain error of each channel, dB."""


@dataclass(frozen=True)
class PolarStd:
    """Standard deviations of a source's bearing, rad, and range, m."""

    bearing: float
    range: float


#: Errors in the sensitivity table: 1 mm, 1 us, 1 % and 1 dB.
UNIT_ERRORS = (
    ArrayErrors(position_m=1e-3),
    ArrayErrors(delay_s=1e-6),
    ArrayErrors(sound_speed_share=0.01),
    ArrayErrors(gain_db=1.0),
)


def predicted_std(
    errors: ArrayErrors, p_AS: NDArray[np.float64], shape: ArrayShape, c: float
) -> PolarStd:
    """Predicts the standard deviations due to errors, to first order.

    Gain errors have no effect, because they do not change delays. The (2,) position
    p_AS of the source begins at the centroid of the microphones, which lie in the
    plane.
    """
    rays = p_AS - shape.p_AM
    ranges = np.linalg.norm(rays, axis=1)
    rays /= ranges[:, None]
    times = np.hstack(
        (
            -errors.position_m * rays[:, [0]] * np.eye(shape.count) / c,
            -errors.position_m * rays[:, [1]] * np.eye(shape.count) / c,
            -errors.delay_s * np.eye(shape.count),
            -errors.sound_speed_share * ranges[:, None] / c,
        )
    )
    to_delays = np.hstack((-np.ones((shape.count - 1, 1)), np.eye(shape.count - 1)))
    moves = np.linalg.pinv(to_delays @ rays / c) @ to_delays @ times
    of_bearing, of_range = (gradient @ moves for gradient in polar_gradients(p_AS))
    return PolarStd(
        bearing=float(np.linalg.norm(of_bearing)), range=float(np.linalg.norm(of_range))
    )


def measured_std(
    errors: ArrayErrors,
    p_AS: NDArray[np.float64],
    shape: ArrayShape,
    c: float,
    *,
    loudspeaker: Loudspeaker,
    estimate: Estimator,
    trials: int,
    seed: int,
) -> PolarStd:
    """Measures the standard deviations due to Gaussian errors in noise-free frames.

    The other arguments are those of ``predicted_std``. Large errors give the
    distribution of the range a long tail. The result is therefore half the width of the
    central 68 % of the estimates. For a Gaussian distribution, this half width equals
    the standard deviation. A frame without a valid range counts as infinitely far. The
    standard deviation of the range may thus be infinite. Raises ``ValueError`` if a
    frame has no detectable sound.
    """
    rng = np.random.default_rng(seed)
    bearings, ranges = np.empty(trials), np.empty(trials)
    for k in range(trials):
        p_AM = shape.p_AM + errors.position_m * rng.standard_normal(shape.p_AM.shape)
        late = errors.delay_s * rng.standard_normal(shape.count)
        speed = c * (1.0 + errors.sound_speed_share * rng.standard_normal())
        gains = 10.0 ** (errors.gain_db * rng.standard_normal(shape.count) / 20.0)
        begin = rng.uniform(0.1, loudspeaker.seconds - 0.1 - TICK_S)
        pressure = loudspeaker.pressure(begin + late, p_AS, p_AM, speed)
        fix = estimate(pressure * gains[:, None].astype(np.float32))
        if fix is None:
            raise ValueError(f"nothing was heard from {p_AS} with {errors}")
        bearings[k] = fix.bearing
        ranges[k] = fix.range if fix.range_valid else math.inf
    return PolarStd(bearing=_half_width(bearings), range=_half_width(ranges))


def _half_width(values: NDArray[np.float64]) -> float:
    low, high = np.quantile(values, _ONE_SIGMA, method="nearest")
    return float(high - low) / 2.0


def sensitivity_table(
    places: Sequence[PaperCell],
    shape: ArrayShape,
    c: float,
    estimate: Estimator,
    *,
    trials: int,
    seed: int,
) -> list[dict[str, Any]]:
    """Computes the effect of each unit error for each position of the source.

    The unit errors are 1 mm, 1 us, 1 % of the speed of sound, and 1 dB. Each row of the
    table is computed from ``trials`` audio frames of its own. An infinite standard
    deviation of the range is None, because JSON has no infinite numbers.
    """
    loudspeaker = Loudspeaker.of("chirp", seed)
    rows = []
    for number, (errors, cell) in enumerate(
        (errors, cell) for cell in places for errors in UNIT_ERRORS
    ):
        p_AS = polar_point(cell.range_m, cell.bearing_deg)
        predicted = predicted_std(errors, p_AS, shape, c)
        measured = measured_std(
            errors,
            p_AS,
            shape,
            c,
            loudspeaker=loudspeaker,
            estimate=estimate,
            trials=trials,
            seed=seed + number,
        )
        (kind,) = [f.name for f in fields(errors) if getattr(errors, f.name)]
        rows.append(
            {
                "range_m": cell.range_m,
                "bearing_deg": cell.bearing_deg,
                "error": kind,
                "size": getattr(errors, kind),
                "predicted_range_m": predicted.range,
                "measured_range_m": measured.range
                if math.isfinite(measured.range)
                else None,
                "predicted_bearing_deg": math.degrees(predicted.bearing),
                "measured_bearing_deg": math.degrees(measured.bearing),
            }
        )
    return rows
