"""Measures how near estimators come to the Cramer-Rao bound in the free field.

Source and microphones are at rest. Each trial is one frame (25 ms of audio), with noise
of a given level at the array. The trials call the functions of the blocks for sound
propagation and analog-to-digital conversion, without building a diagram. A trial
therefore takes little more time than the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.cramer_rao import LocalizationBound, polar_point, position_bound
from analysis.arrays.single_frames import Estimator, Loudspeaker
from analysis.report.intervals import Estimate
from studies.support.estimation_errors import (
    Consistency,
    consistency,
    rms_ratio,
    stated_ratio,
)
from systems.framework.signals import SAMPLE_RATE_HZ, TICK_S
from systems.hearing.source_fix import SourceFix
from systems.sound.adc import convert
from systems.sound.array_shape import ArrayShape
from systems.sound.parameters import MicArrayParameters

#: Ratio of the converter's full scale to the largest sample.
_HEADROOM = 1.2

#: An error of more than this many bounds is an outlier.
_OUTLIER = 8.0

#: Least time between the loudspeaker's first sample and a frame, s. Sound may travel
#: for at most this time.
_LEAD_S = 0.1


@dataclass(frozen=True)
class FreeFieldCell:
    """Trials with the source at one position: errors, stated uncertainties and bounds.

    The arrays cover the k trials that gave a range.
    """

    range_m: float
    bearing_deg: float
    trials: int
    unheard: int
    """Number of trials without detectable sound."""
    rangeless: int
    """Number of trials with a bearing but no range."""
    bearing_errors: NDArray[np.float64]
    """(k,) errors of the bearing, rad."""
    range_errors: NDArray[np.float64]
    """(k,) errors of the range, m."""
    position_errors: NDArray[np.float64]
    """(k, 2) errors of the position, m."""
    bearing_stds: NDArray[np.float64]
    """(k,) stated standard deviations of the bearing, rad."""
    range_stds: NDArray[np.float64]
    """(k,) stated standard deviations of the range, m."""
    covariances: NDArray[np.float64]
    """(k, 2, 2) stated covariances of the position, m^2."""
    bearing_bounds: NDArray[np.float64]
    """(k,) bounds of the bearing, rad. The bounds vary, as the sound does."""
    range_bounds: NDArray[np.float64]
    """(k,) bounds of the range, m."""

    @property
    def outliers(self) -> int:
        """Number of trials without a range, or with an error above eight bounds."""
        wild = (np.abs(self.bearing_errors) > _OUTLIER * self.bearing_bounds) | (
            np.abs(self.range_errors) > _OUTLIER * self.range_bounds
        )
        return self.unheard + self.rangeless + int(wild.sum())

    @property
    def bearing_ratio(self) -> Estimate:
        """RMS error of the bearing over its bound."""
        return rms_ratio(self.bearing_errors, self.bearing_bounds)

    @property
    def range_ratio(self) -> Estimate:
        """RMS error of the range over its bound."""
        return rms_ratio(self.range_errors, self.range_bounds)

    @property
    def stated_bearing_ratio(self) -> float:
        """Stated standard deviation of the bearing over its RMS error."""
        return stated_ratio(self.bearing_stds, self.bearing_errors)

    @property
    def stated_range_ratio(self) -> float:
        """Stated standard deviation of the range over its RMS error."""
        return stated_ratio(self.range_stds, self.range_errors)

    @property
    def consistency(self) -> Consistency:
        """Consistency of the position errors with their stated covariances."""
        return consistency(self.position_errors, self.covariances)


def total_consistency(cells: Iterable[FreeFieldCell]) -> Consistency:
    """Consistency of the position errors over all trials of several cells."""
    cells = list(cells)
    return consistency(
        np.concatenate([cell.position_errors for cell in cells]),
        np.concatenate([cell.covariances for cell in cells]),
    )


def run_cell(
    loudspeaker: Loudspeaker,
    estimators: Mapping[str, Estimator],
    range_m: float,
    bearing_deg: float,
    *,
    shape: ArrayShape,
    snr_db: float,
    c: float,
    trials: int,
    seed: int,
) -> dict[str, FreeFieldCell]:
    """Runs the trials for one position of the source.

    Each trial takes a random part of the sound, with new noise. The analog-to-digital
    converter has 10 bits, and a full scale of 1.2 times the largest sample. All
    estimators get the same frames.

    Args:
        loudspeaker: The sound of the source.
        estimators: Estimators by name, as made by ``frame_estimator``.
        range_m: Distance of the source from the microphones' centroid, m.
        bearing_deg: Bearing of the source, deg.
        shape: The microphones, in the plane.
        snr_db: Level of the sound at the centroid, relative to the noise from 0 to 50
            kHz, dB.
        c: Speed of sound, m/s.
        trials: Number of frames.
        seed: Seed of the parts of the sound and of the noise.

    Returns:
        Results of the trials by name of the estimator.
    """
    rng = np.random.default_rng(seed)
    p_AS = polar_point(range_m, bearing_deg)
    noise_pa = loudspeaker.level_pa / range_m * 10.0 ** (-snr_db / 20.0)
    fixes: dict[str, list[SourceFix | None]] = {name: [] for name in estimators}
    bounds = []
    converter = MicArrayParameters()
    for _ in range(trials):
        begin = rng.uniform(_LEAD_S, loudspeaker.seconds - _LEAD_S)
        pressure = loudspeaker.pressure(begin, p_AS, shape.p_AM, c)
        noise = rng.standard_normal(pressure.shape, dtype=np.float32)
        loudest = np.abs(pressure + np.float32(noise_pa) * noise).max()
        full_scale_pa = _HEADROOM * float(loudest)
        counts = convert(
            pressure, noise, noise_pa, converter, full_scale_pa=full_scale_pa
        )
        for name, estimate in estimators.items():
            fixes[name].append(estimate(counts.astype(np.float32)))
        rounding_pa = 1.0 / (converter.full_scale / full_scale_pa) / math.sqrt(12.0)
        bounds.append(
            position_bound(
                loudspeaker.energy,
                begin,
                begin + TICK_S,
                p_AS,
                shape.p_AM,
                math.hypot(noise_pa, rounding_pa),
                sample_rate_hz=SAMPLE_RATE_HZ,
                c=c,
            )
        )
    return {
        name: _cell(found, bounds, range_m, bearing_deg)
        for name, found in fixes.items()
    }


def _cell(
    fixes: list[SourceFix | None],
    bounds: list[LocalizationBound],
    range_m: float,
    bearing_deg: float,
) -> FreeFieldCell:
    angle, p_AS = math.radians(bearing_deg), polar_point(range_m, bearing_deg)
    pairs = zip(fixes, bounds, strict=True)
    ranged = [(fix, b) for fix, b in pairs if fix is not None and fix.range_valid]
    found = [fix for fix, _ in ranged]
    return FreeFieldCell(
        range_m=range_m,
        bearing_deg=bearing_deg,
        trials=len(fixes),
        unheard=sum(fix is None for fix in fixes),
        rangeless=sum(fix is not None and not fix.range_valid for fix in fixes),
        bearing_errors=np.array([fix.bearing - angle for fix in found]),
        range_errors=np.array([fix.range - range_m for fix in found]),
        position_errors=np.reshape([fix.p_AS - p_AS for fix in found], (-1, 2)),
        bearing_stds=np.array([fix.bearing_std for fix in found]),
        range_stds=np.array([fix.range_std for fix in found]),
        covariances=np.reshape([fix.covariance for fix in found], (-1, 2, 2)),
        bearing_bounds=np.array([bound.bearing_std for _, bound in ranged]),
        range_bounds=np.array([bound.range_std for _, bound in ranged]),
    )
