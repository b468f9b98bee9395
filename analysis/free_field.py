"""How near an estimator comes to the Cramer-Rao bound in the free field.

A resting source and resting microphones, one frame a trial, noise of a given
level at the array. Sound travels and is converted by the blocks' own functions;
no diagram is built, so that a trial costs little more than the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2

from analysis.cramer_rao import SlopeEnergy, position_bound
from systems.adc import MicArrayParameters, convert
from systems.mic_array import FRAME_SAMPLES, frame_instants
from systems.near_field import NearFieldFix
from systems.propagation import propagate
from systems.signals import FRAME_PERIOD_S, SAMPLE_RATE_HZ, Emission
from systems.waveforms import EDGE_S, SoundParameters, make_waveform

__all__ = ["PAPER_CELLS", "FreeFieldCell", "Interval", "Loudspeaker", "run_cell"]

#: Range (m) and bearing (deg) of the cells of Han 2019, tables 1 and 2.
PAPER_CELLS = tuple((r, b) for r in (1.0, 2.0, 3.0, 4.0) for b in (0.0, 30.0, 60.0))

#: Full scale of the converter over the largest sample.
_HEADROOM = 1.2

#: An error beyond so many bounds is an outlier.
_OUTLIER = 8.0

#: Of all intervals.
_CONFIDENCE = 0.95


@dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % confidence interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Loudspeaker:
    """A sound that goes on for the whole trial, and the energy of its slope."""

    samples: NDArray[np.float32]
    """(n,) Pa at 1 m."""
    energy: SlopeEnergy
    level_pa: float
    """RMS of the samples, Pa at 1 m."""

    @classmethod
    def of(cls, kind: str, seed: int, seconds: float = 2.0) -> Loudspeaker:
        """Chirp or band noise of 0.5-8 kHz."""
        sound = SoundParameters.model_validate(
            {"kind": kind, "on_s": seconds, "period_s": seconds}
        )
        samples = make_waveform(sound, seed)
        edge = round(EDGE_S * SAMPLE_RATE_HZ)
        level = float(np.sqrt(np.mean(samples[edge:-edge] ** 2, dtype=float)))
        return cls(samples, SlopeEnergy.of(samples, SAMPLE_RATE_HZ), level)

    def emission(self, p_WS: ArrayLike) -> Emission:
        """What has left the loudspeaker, at rest in one place."""
        end = len(self.samples) / SAMPLE_RATE_HZ
        return Emission(
            samples=self.samples,
            start_time=0.0,
            sample_rate_hz=float(SAMPLE_RATE_HZ),
            knot_times=np.array([0.0, end]),
            p_WS=np.tile(np.asarray(p_WS, dtype=float), (2, 1)),
            v_WS=np.zeros((2, 2)),
            level_pa=self.level_pa,
            sounding=True,
        )


@dataclass(frozen=True)
class FreeFieldCell:
    """The trials of one place: errors, what was stated of them, and the bound."""

    range_m: float
    bearing_deg: float
    snr_db: float
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
        """Trials without a fix, or in error by more than eight bounds."""
        wild = (np.abs(self.bearing_errors) > _OUTLIER * self.bearing_bounds) | (
            np.abs(self.range_errors) > _OUTLIER * self.range_bounds
        )
        return self.unheard + self.rangeless + int(wild.sum())

    @property
    def bearing_ratio(self) -> Interval:
        """RMSE of the bearing over its bound."""
        return _rms_ratio(self.bearing_errors, self.bearing_bounds)

    @property
    def range_ratio(self) -> Interval:
        """RMSE of the range over its bound."""
        return _rms_ratio(self.range_errors, self.range_bounds)

    @property
    def bearing_honesty(self) -> float:
        """Stated standard deviation over RMSE."""
        return 1.0 / _rms_ratio(self.bearing_errors, self.bearing_stds).value

    @property
    def range_honesty(self) -> float:
        """Stated standard deviation over RMSE."""
        return 1.0 / _rms_ratio(self.range_errors, self.range_stds).value

    @property
    def normalised_errors(self) -> NDArray[np.float64]:
        """(k,) e^T C^-1 e: chi-square of two degrees where C is right."""
        solved = np.linalg.solve(self.covariances, self.position_errors[:, :, None])
        return np.einsum("ki,ki->k", self.position_errors, solved[:, :, 0])


def nees(cells: Iterable[FreeFieldCell]) -> tuple[float, float, float]:
    """Mean normalised estimation error squared over cells.

    Returns:
        The mean, and the interval that holds it with 95 % where the stated
        covariances are right.
    """
    errors = np.concatenate([cell.normalised_errors for cell in cells])
    low, high = chi2.interval(_CONFIDENCE, 2 * len(errors)) / np.array(len(errors))
    return float(errors.mean()), float(low), float(high)


def _rms_ratio(errors: NDArray[np.float64], stds: NDArray[np.float64]) -> Interval:
    """RMS of errors over that of their standard deviations."""
    if len(errors) == 0:
        return Interval(math.inf, 0.0, math.inf)
    square = np.mean(errors**2) / np.mean(stds**2)
    low, high = chi2.interval(_CONFIDENCE, len(errors)) / np.array(len(errors))
    return Interval(math.sqrt(square), math.sqrt(square / high), math.sqrt(square / low))


def run_cell(
    loudspeaker: Loudspeaker,
    estimate: Callable[[NDArray[np.float32]], NearFieldFix | None],
    range_m: float,
    bearing_deg: float,
    *,
    p_AM: NDArray[np.float64],
    snr_db: float,
    c: float,
    trials: int,
    seed: int,
) -> FreeFieldCell:
    """Runs the trials of one cell.

    Each trial takes a stretch of the sound at random, and fresh noise; the
    converter has 10 bits and a full scale of 1.2 times the largest sample.

    Args:
        loudspeaker: What sounds.
        estimate: From a (n, samples) frame in counts to a fix.
        range_m: Of the source, from the microphones' centroid, m.
        bearing_deg: Of the source, deg.
        p_AM: (n, 2) microphones from their centroid, m.
        snr_db: Level of the sound at the centroid over the noise from 0 to
            50 kHz, dB.
        c: Speed of sound, m/s.
        trials: Number of frames.
        seed: Of stretches and noise.
    """
    rng = np.random.default_rng(seed)
    angle = math.radians(bearing_deg)
    p_AS = range_m * np.array([math.cos(angle), math.sin(angle)])
    emission = loudspeaker.emission(p_AS)
    noise_pa = loudspeaker.level_pa / range_m * 10.0 ** (-snr_db / 20.0)
    first, last = 0.1, len(loudspeaker.samples) / SAMPLE_RATE_HZ - 0.1
    rows = []
    for _ in range(trials):
        begin = round(rng.uniform(first, last) * SAMPLE_RATE_HZ) / SAMPLE_RATE_HZ
        pressure = hear(emission, begin, p_AM, c)
        noise = rng.standard_normal(pressure.shape, dtype=np.float32)
        loudest = float(np.abs(pressure + np.float32(noise_pa) * noise).max())
        converter = fitted_converter(loudest)
        fix = estimate(
            convert(pressure, noise, noise_pa, converter).astype(np.float32)
        )
        rounding_pa = 1.0 / converter.counts_per_pa / math.sqrt(12.0)
        bound = position_bound(
            loudspeaker.energy, begin, begin + FRAME_PERIOD_S, p_AS, p_AM,
            math.hypot(noise_pa, rounding_pa), sample_rate_hz=SAMPLE_RATE_HZ, c=c,
        )  # fmt: skip
        rows.append((fix, bound))
    found = [(fix, bound) for fix, bound in rows if fix is not None and fix.range_valid]
    return FreeFieldCell(
        range_m=range_m,
        bearing_deg=bearing_deg,
        snr_db=snr_db,
        trials=trials,
        unheard=sum(fix is None for fix, _ in rows),
        rangeless=sum(fix is not None and not fix.range_valid for fix, _ in rows),
        bearing_errors=np.array([fix.bearing - angle for fix, _ in found]),
        range_errors=np.array([fix.range - range_m for fix, _ in found]),
        position_errors=np.array([fix.p_MS - p_AS for fix, _ in found]),
        bearing_stds=np.array([fix.bearing_std for fix, _ in found]),
        range_stds=np.array([fix.range_std for fix, _ in found]),
        covariances=np.array([fix.covariance for fix, _ in found]),
        bearing_bounds=np.array([bound.bearing_std for _, bound in found]),
        range_bounds=np.array([bound.range_std for _, bound in found]),
    )


def hear(
    emission: Emission, begin: float, p_AM: NDArray[np.float64], c: float
) -> NDArray[np.float32]:
    """(n, samples) sound pressure of the frame that begins then, Pa."""
    instants = begin + frame_instants(MicArrayParameters())
    p_WM = np.repeat(p_AM[:, None, :], instants.shape[1], axis=1)
    pressure = propagate(
        emission, instants, p_WM, np.zeros(p_WM.shape), FRAME_SAMPLES, c
    )
    assert pressure is not None
    return pressure


def fitted_converter(peak_pa: float) -> MicArrayParameters:
    """The default converter with a full scale of 1.2 times a peak in Pa."""
    default = MicArrayParameters()
    volt_per_pa = default.counts_per_pa * default.adc_full_scale_v / default.full_scale
    return MicArrayParameters(adc_full_scale_v=_HEADROOM * peak_pa * volt_per_pa)
