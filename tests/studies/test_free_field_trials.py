"""Free-field trials: the frames that estimators get, and what is counted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import fft

from analysis.arrays.single_frames import Loudspeaker, frame_estimator
from studies.support.free_field_trials import run_cell, total_consistency
from systems.base.robot import RobotParameters
from systems.hearing.parameters import TDOAParameters
from systems.hearing.source_fix import RANGED, SourceFix
from systems.sound.array_shape import ArrayShape

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
LOUDSPEAKER = Loudspeaker.of("band_noise", seed=3)


def trials(estimate, **changes):
    settings = {
        "shape": SHAPE, "snr_db": 20.0, "c": C, "trials": 40, "seed": 1, **changes
    }  # fmt: skip
    return run_cell(LOUDSPEAKER, {"it": estimate}, 2.0, 30.0, **settings)["it"]


def test_frames_have_the_level_and_noise_asked_for():
    """Beyond the sound's band the counts hold noise, and rounding, alone."""
    frames = []

    def keep(frame):
        frames.append(frame)

    cell = trials(keep, snr_db=20.0)
    assert (cell.unheard, cell.outliers) == (40, 40)
    spectra = np.abs(fft.rfft(np.array(frames), axis=-1)) ** 2
    frequency = fft.rfftfreq(2500, 1e-5)
    noise = spectra[..., frequency > 20_000].mean() * len(frequency)
    noise_db = 10.0 * np.log10(spectra.sum(axis=-1).mean() / noise - 1.0)
    # Distances differ by 20 %, hence levels by 0.1 dB on average.
    assert noise_db == pytest.approx(20.0, abs=0.3)
    # Full scale is 512 counts.
    assert np.abs(frames).max() == pytest.approx(512 / 1.2, abs=1)


def test_errors_and_bounds_of_an_estimator_that_knows():
    """It errs by a stated covariance, so that all that is counted is known."""
    rng = np.random.default_rng(4)
    angle = math.radians(30.0)
    truth = 2.0 * np.array([math.cos(angle), math.sin(angle)])
    sigma = 0.01
    template = SourceFix(
        bearing=angle, bearing_std=sigma / 2.0, elevation=None, elevation_std=None,
        range=2.0, range_status=RANGED, range_std=sigma, p_AS=truth,
        covariance=sigma**2 * np.eye(2),
    )  # fmt: skip

    def estimate(_frame):
        p = truth + sigma * rng.standard_normal(2)
        return replace(
            template,
            p_AS=p,
            bearing=math.atan2(p[1], p[0]),
            range=float(np.linalg.norm(p)),
        )

    cell = trials(estimate, trials=400)
    assert cell.consistency.holds
    assert cell.stated_bearing_ratio == pytest.approx(1.0, abs=0.15)
    assert cell.stated_range_ratio == pytest.approx(1.0, abs=0.15)
    expected = sigma / np.sqrt(np.mean(cell.range_bounds**2))
    assert cell.range_ratio.low <= expected <= cell.range_ratio.high


def test_estimates_without_range_are_counted():
    nothing = trials(lambda _frame: None)
    assert nothing.bearing_errors.shape == (0,)
    assert (nothing.unheard, nothing.rangeless, nothing.outliers) == (40, 0, 40)


def test_the_blocks_estimator_stays_near_the_bound():
    cell = trials(frame_estimator(TDOAParameters(), SHAPE, C), trials=100)
    assert cell.outliers == 0
    assert cell.bearing_ratio.low < 1.25
    assert cell.range_ratio.low < 1.25
    assert total_consistency([cell]).mean == pytest.approx(cell.consistency.mean)
