"""How near estimators come to the Cramer-Rao bound in the free field.

A resting source and resting microphones, one frame a trial, noise of a given
level at the array. Sound travels and is converted by the blocks' own functions;
no diagram is built, so that a trial costs little more than the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.hearing.cramer_rao import (
    LocalizationBound,
    SlopeEnergy,
    polar_point,
    position_bound,
)
from analysis.hearing.estimation_errors import (
    Consistency,
    consistency,
    rms_ratio,
    stated_ratio,
)
from analysis.reporting.intervals import Estimate
from systems.framework.signals import FRAME_SAMPLES, SAMPLE_RATE_HZ, TICK_S, Emission
from systems.hearing.localise import Localiser
from systems.hearing.parameters import TDOAParameters
from systems.hearing.source_fix import SourceFix
from systems.sound.adc import convert
from systems.sound.array_shape import ArrayShape
from systems.sound.parameters import EDGE_S, MicArrayParameters, SoundParameters
from systems.sound.propagation import propagate
from systems.sound.waveforms import make_waveform

#: Full scale of the converter over the largest sample.
_HEADROOM = 1.2

#: An error beyond so many bounds is an outlier.
_OUTLIER = 8.0

#: From the loudspeaker's first sample to the first frame, at least, s; also the
#: farthest that sound may have travelled.
_LEAD_S = 0.1

Estimator = Callable[[NDArray[np.float32]], SourceFix | None]


def frame_estimator(
    parameters: TDOAParameters, shape: ArrayShape, c: float, *, limited: bool = True
) -> Estimator:
    """What ``TDOAEstimator`` does to a (n, samples) frame, the first that it hears.

    Args:
        parameters: Of the estimator.
        shape: The n microphones.
        c: Speed of sound, m/s.
        limited: See ``Localiser``.

    Returns:
        From a frame to a fix, or None where nothing is heard.
    """
    localiser = Localiser(parameters, shape, c, limited=limited)
    return lambda frame: localiser.localise(frame, localiser.blank())[0]


@dataclass(frozen=True)
class Loudspeaker:
    """A sound that goes on for all trials, and the energy of its slope."""

    samples: NDArray[np.float32]
    """(n,) Pa at 1 m."""
    energy: SlopeEnergy
    level_pa: float
    """RMS of the samples, Pa at 1 m."""

    @classmethod
    def of(cls, kind: str, seed: int, seconds: float = 2.0) -> Loudspeaker:
        """Chirp or band noise of 0.5-8 kHz.

        Args:
            kind: ``chirp`` or ``band_noise``.
            seed: Of the noise.
            seconds: Length of the sound, s.

        Returns:
            The sound at 100 kHz, its slope energy and its level.
        """
        sound = SoundParameters.model_validate(
            {"kind": kind, "on_s": seconds, "period_s": seconds}
        )
        samples = make_waveform(sound, seed)
        edge = round(EDGE_S * SAMPLE_RATE_HZ)
        level = float(np.sqrt(np.mean(samples[edge:-edge] ** 2, dtype=float)))
        return cls(samples, SlopeEnergy.of(samples, SAMPLE_RATE_HZ), level)

    @property
    def seconds(self) -> float:
        """Its length, s."""
        return len(self.samples) / SAMPLE_RATE_HZ

    def pressure(
        self,
        begin: ArrayLike,
        p_AS: NDArray[np.float64],
        p_AM: NDArray[np.float64],
        c: float,
    ) -> NDArray[np.float32]:
        """A frame, source and microphones at rest.

        Args:
            begin: Time of the frame's first sample, (n,) of every channel or one
                for all, s.
            p_AS: (2,) source, m.
            p_AM: (n, 2) microphones, m.
            c: Speed of sound, m/s.

        Returns:
            (n, samples) Pa.
        """
        emission = Emission(
            samples=self.samples,
            start_time=0.0,
            sample_rate_hz=float(SAMPLE_RATE_HZ),
            knot_times=np.array([0.0, self.seconds]),
            p_WS=np.tile(p_AS, (2, 1)),
            v_WS=np.zeros((2, 2)),
            level_pa=self.level_pa,
            sounding=True,
        )
        begins = np.broadcast_to(begin, len(p_AM))
        times = np.stack((begins, begins + TICK_S), axis=1)
        p_WM = np.repeat(p_AM[:, None, :], 2, axis=1)
        return propagate(emission, times, p_WM, np.zeros(p_WM.shape), FRAME_SAMPLES, c)


@dataclass(frozen=True)
class FreeFieldCell:
    """The trials of one place: errors, what was stated of them, and the bound."""

    range_m: float
    bearing_deg: float
    trials: int
    unheard: int
    """Trials in which nothing was heard."""
    rangeless: int
    """Trials with a bearing but no range."""
    bearing_errors: NDArray[np.float64]
    """(k,) of the trials with a range, rad."""
    range_errors: NDArray[np.float64]
    """(k,) m."""
    position_errors: NDArray[np.float64]
    """(k, 2) m."""
    bearing_stds: NDArray[np.float64]
    """(k,) stated, rad."""
    range_stds: NDArray[np.float64]
    """(k,) stated, m."""
    covariances: NDArray[np.float64]
    """(k, 2, 2) stated, of the position, m^2."""
    bearing_bounds: NDArray[np.float64]
    """(k,) rad; the sound differs from frame to frame."""
    range_bounds: NDArray[np.float64]
    """(k,) m."""

    @property
    def outliers(self) -> int:
        """Trials without a range, or in error by more than eight bounds."""
        wild = (np.abs(self.bearing_errors) > _OUTLIER * self.bearing_bounds) | (
            np.abs(self.range_errors) > _OUTLIER * self.range_bounds
        )
        return self.unheard + self.rangeless + int(wild.sum())

    @property
    def bearing_ratio(self) -> Estimate:
        """RMSE of the bearing over its bound."""
        return rms_ratio(self.bearing_errors, self.bearing_bounds)

    @property
    def range_ratio(self) -> Estimate:
        """RMSE of the range over its bound."""
        return rms_ratio(self.range_errors, self.range_bounds)

    @property
    def stated_bearing_ratio(self) -> float:
        """Stated standard deviation over RMSE."""
        return stated_ratio(self.bearing_stds, self.bearing_errors)

    @property
    def stated_range_ratio(self) -> float:
        """Stated standard deviation over RMSE."""
        return stated_ratio(self.range_stds, self.range_errors)

    @property
    def consistency(self) -> Consistency:
        """Of the position with its stated covariance."""
        return consistency(self.position_errors, self.covariances)


def total_consistency(cells: Iterable[FreeFieldCell]) -> Consistency:
    """Over all trials of some cells."""
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
    """Runs the trials of one cell.

    Each trial takes a stretch of the sound at random, and fresh noise; the
    converter has 10 bits and a full scale of 1.2 times the largest sample. All
    estimators get the same frames.

    Args:
        loudspeaker: What sounds.
        estimators: By name, as ``frame_estimator`` makes them.
        range_m: Of the source, from the microphones' centroid, m.
        bearing_deg: Of the source, deg.
        shape: The microphones, in the plane.
        snr_db: Level of the sound at the centroid over the noise from 0 to
            50 kHz, dB.
        c: Speed of sound, m/s.
        trials: Number of frames.
        seed: Of stretches and noise.

    Returns:
        A cell for each estimator.
    """
    rng = np.random.default_rng(seed)
    p_AS = polar_point(range_m, bearing_deg)
    noise_pa = loudspeaker.level_pa / range_m * 10.0 ** (-snr_db / 20.0)
    fixes: dict[str, list[SourceFix | None]] = {name: [] for name in estimators}
    bounds = []
    for _ in range(trials):
        begin = rng.uniform(_LEAD_S, loudspeaker.seconds - _LEAD_S)
        pressure = loudspeaker.pressure(begin, p_AS, shape.p_AM, c)
        noise = rng.standard_normal(pressure.shape, dtype=np.float32)
        loudest = np.abs(pressure + np.float32(noise_pa) * noise).max()
        converter = _fitted_converter(float(loudest))
        counts = convert(pressure, noise, noise_pa, converter)
        for name, estimate in estimators.items():
            fixes[name].append(estimate(counts.astype(np.float32)))
        rounding_pa = 1.0 / converter.counts_per_pa / math.sqrt(12.0)
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


def _fitted_converter(peak_pa: float) -> MicArrayParameters:
    """The default converter with a full scale of 1.2 times a peak in Pa."""
    return MicArrayParameters(full_scale_pa=_HEADROOM * peak_pa)


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
