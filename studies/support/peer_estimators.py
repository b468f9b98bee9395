"""Estimators that stand beside one another: ours, and pyroomacoustics' own."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pyroomacoustics as pra
from numpy.typing import NDArray

from analysis.arrays.single_frames import frame_estimator
from systems.base.robot import RobotParameters
from systems.framework.signals import SAMPLE_RATE_HZ
from systems.hearing.multilateration import locate_source
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
BAND_HZ = [500.0, 8_000.0]

#: Points between two samples of pyroomacoustics' correlation.
INTERPOLATION = 16

#: Short-time spectra for the searches over directions: of 256 ... 2048 points
#: these serve both best. Hann windows, ten in a frame.
N_FFT, HOP = 1024, 256

Frame = NDArray[np.float32]
#: Bearing in rad and range in m, NaN where there is none, of a (3, 2500) frame.
Estimator = Callable[[Frame], tuple[float, float]]


def ours(method: str) -> Estimator:
    """The estimator of ``TDOAEstimator``."""
    parameters = TDOAParameters.model_validate({"method": method})
    localize = frame_estimator(parameters, SHAPE, C)

    def estimate(frame: Frame) -> tuple[float, float]:
        fix = localize(frame)
        if fix is None:
            return math.nan, math.nan
        return fix.bearing, fix.range if fix.range_valid else math.nan

    return estimate


def by_tdoa(*, phat: bool) -> Estimator:
    """``pyroomacoustics.experimental.tdoa`` and our closed form.

    It takes no band. With 16 points a sample its lags end at 156 samples, less
    than sound can take along the row: delays are those of neighbors.
    """
    step = 1.0 / (INTERPOLATION * SAMPLE_RATE_HZ)
    covariance = step**2 / 12.0 * np.array([[1.0, 1.0], [1.0, 2.0]])

    def estimate(frame: Frame) -> tuple[float, float]:
        steps = [
            pra.experimental.tdoa(
                frame[k + 1], frame[k], INTERPOLATION, SAMPLE_RATE_HZ, phat
            )
            for k in range(2)
        ]
        fix = locate_source(np.cumsum(steps), covariance, SHAPE, C)
        return fix.bearing, fix.range if fix.range_valid else math.nan

    return estimate


def by_direction(name: str, **grid: Any) -> Estimator:
    """One of ``pyroomacoustics.doa.algorithms``: far field, no range."""
    search = pra.doa.algorithms[name](
        SHAPE.p_AM.T.copy(), SAMPLE_RATE_HZ, N_FFT, c=C, num_src=1, **grid
    )
    window = pra.hann(N_FFT)

    def estimate(frame: Frame) -> tuple[float, float]:
        spectra = pra.transform.stft.analysis(frame.T, N_FFT, HOP, win=window)
        search.locate_sources(spectra.transpose(2, 1, 0), freq_range=BAND_HZ)
        if len(search.azimuth_recon) == 0:
            return math.nan, math.nan
        # A row cannot tell front from back: what is found behind is mirrored.
        return math.asin(math.sin(search.azimuth_recon[0])), math.nan

    return estimate


def estimators() -> dict[str, Estimator]:
    """All, by name."""
    fine = np.deg2rad(np.linspace(-90.0, 90.0, 1801))
    return {
        "gcc": ours("gcc"),
        "ml": ours("ml"),
        "pra tdoa, PHAT": by_tdoa(phat=True),
        "pra tdoa, plain": by_tdoa(phat=False),
        "pra SRP, 1 deg": by_direction("SRP"),
        "pra SRP, 0.1 deg": by_direction("SRP", azimuth=fine),
        "pra NormMUSIC, 1 deg": by_direction("NormMUSIC"),
        "pra NormMUSIC, 0.1 deg": by_direction("NormMUSIC", azimuth=fine),
    }
