"""Delays of a frame: known shifts, bounds, ambiguity, silence."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.random import Generator, Philox

from systems.delays.delay_plan import DelayPlan
from systems.delays.delay_search import amdf
from systems.delays.delays import METHODS, estimate_delays, look
from systems.sound.array_shape import ArrayShape

FS = 100_000.0
N = 2500
ROW = ArrayShape.of([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
PLAN = DelayPlan(ROW, 340.0, FS, N, 300.0, 15_000.0)
# Whitened bins that hold little but the frame's edges weigh as much as others.
ACCURACY = {"gcc": 0.02, "gcc_phat": 0.15}


def band_noise(count, low, high, seed=0):
    spectrum = np.fft.rfft(Generator(Philox(key=seed)).standard_normal(count))
    f = np.fft.rfftfreq(count, 1 / FS)
    spectrum[(f < low) | (f > high)] = 0.0
    return np.fft.irfft(spectrum, count)


def shifted(signal, delays):
    """Frames cut from a periodic signal that is delayed by whole and part samples."""
    spectrum = np.fft.rfft(signal)
    f = np.fft.rfftfreq(len(signal))
    rows = [
        np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * d), len(signal))[500 : 500 + N]
        for d in delays
    ]
    return np.array(rows)


def noisy(rows, snr_db, seed):
    noise = Generator(Philox(key=seed)).standard_normal(rows.shape)
    level = rows.std() * 10 ** (-snr_db / 20)
    return (rows + level * noise).astype(np.float32)


def measured(rows, method="gcc"):
    found = estimate_delays(rows, PLAN, method)
    assert found is not None
    return found


@pytest.mark.parametrize("method", ACCURACY)
@pytest.mark.parametrize("shifts", [(0, 0, 0), (0, 30.37, 75.81), (40.25, 12.5, 0)])
def test_known_shifts(method, shifts):
    rows = shifted(band_noise(5000, 500, 8_000), shifts)
    found = measured(noisy(rows, 40.0, 1), method)
    assert found.tau[0] * FS == pytest.approx(
        shifts[1] - shifts[0], abs=ACCURACY[method]
    )
    assert found.tau[1] * FS == pytest.approx(
        shifts[2] - shifts[0], abs=ACCURACY[method]
    )
    assert found.correlation > 0.98
    assert found.ambiguity < 0.5


def test_the_band_of_a_long_frame_is_found_in_hertz():
    """2 s at 8 kHz: bins are less than 1 Hz apart; smoothing adds 200 Hz a side.

    The frame's ends add some more.
    """
    rate, count = 8_000.0, 16_000
    plan = DelayPlan(ROW, 340.0, rate, count, 100.0, 4_000.0)
    spectrum = np.fft.rfft(Generator(Philox(key=3)).standard_normal(count))
    f = np.fft.rfftfreq(count, 1 / rate)
    spectrum[(f < 1_000.0) | (f > 2_000.0)] = 0.0
    rows = noisy(np.tile(np.fft.irfft(spectrum, count), (3, 1)), 40.0, 4)
    seen = look(rows, plan, find_band=True)
    assert seen is not None
    hertz = rate / plan.length
    assert seen[1].start * hertz == pytest.approx(800.0, abs=25.0)
    assert seen[1].stop * hertz == pytest.approx(2_200.0, abs=25.0)


def test_amdf_finds_whole_samples_of_either_sign():
    rows = shifted(band_noise(5000, 500, 8_000), (20, 0, 15))
    found = measured(noisy(rows, 30.0, 1), "amdf")
    assert found.tau[0] * FS == pytest.approx(-20, abs=1e-9)
    assert found.tau[1] * FS == pytest.approx(-5, abs=1e-9)


def test_whole_samples_cost_a_twelfth_of_one_a_pair():
    """The variance of rounding, 1/12, beside which that of noise is nothing."""
    signal = band_noise(4 * N, 500, 8_000)
    rows = noisy(shifted(signal, [0, 12, 31]), 60.0, 1)
    rounded = measured(rows, "amdf").covariance * FS**2
    np.testing.assert_allclose(np.diag(rounded), 1.0 / 12.0, rtol=0.01)
    np.testing.assert_allclose(rounded[0, 1], 1.0 / 24.0, rtol=0.01)


def test_amdf_is_the_mean_over_the_overlap():
    """Against a plain loop over the definition."""
    x = Generator(Philox(key=4)).standard_normal((2, 50)).astype(np.float32)
    found = amdf(x[0], x[1], 20)
    for lag in range(-20, 21):
        pairs = [(k, k + lag) for k in range(50) if 0 <= k + lag < 50]
        expected = np.mean([abs(x[0, k] - x[1, j]) for k, j in pairs])
        assert found[lag + 20] == pytest.approx(expected, rel=1e-5)


def test_printed_amdf_prefers_large_lags():
    """The sum of Han 2019, eq. 5, shrinks with its terms; ours does not."""
    x = Generator(Philox(key=4)).standard_normal((2, 400)).astype(np.float32)
    means = amdf(x[0], x[1], 300)
    printed = means * (400 - np.abs(np.arange(-300, 301)))
    assert abs(np.argmin(printed) - 300) == 300
    assert means.min() > 0.5 * means.mean()


def test_equal_signals_have_no_delay():
    """The printed similarity is 1/0 there."""
    rows = np.tile(band_noise(N, 500, 8_000), (3, 1)).astype(np.float32)
    for method in METHODS:
        found = measured(rows, method)
        assert found.tau[0] == pytest.approx(0.0, abs=1e-9)
        assert found.correlation == pytest.approx(1.0, abs=1e-6)
        assert np.isfinite(found.covariance).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("silent", [(0,), (1,), (0, 1, 2)])
def test_silent_channels_give_nothing(method, silent):
    rows = np.tile(band_noise(N, 500, 8_000), (3, 1)).astype(np.float32)
    rows[list(silent)] = 0.0
    assert estimate_delays(rows, PLAN, method) is None


@pytest.mark.parametrize("method", METHODS)
def test_single_impulse_at_the_edge_is_no_crash(method):
    rows = np.zeros((3, N), dtype=np.float32)
    rows[0, 0] = rows[1, N - 1] = rows[2, 3] = 1.0
    assert estimate_delays(rows, PLAN, method) is None
    # The same impulses within the time that sound takes across the row.
    rows[1] = np.roll(rows[1], 61)
    delays = measured(rows, method).tau * FS
    assert delays == pytest.approx([60.0, 3.0], abs=0.01)


@pytest.mark.parametrize("method", METHODS)
def test_tone_is_ambiguous(method):
    """Its correlation has a peak every period, 12.2 samples at 8.19 kHz."""
    tone = np.sin(2 * np.pi * 8_190.0 * np.arange(5000) / FS)
    found = measured(noisy(shifted(tone, (0, 17.3, 30.1)), 30.0, 2), method)
    assert found.ambiguity > 0.9


def test_scatter_is_at_the_cramer_rao_bound():
    """Knapp and Carter (1976): flat signal of band f1-f2 in white noise.

    var = 3 N B_n / (8 pi^2 T S (f2^3 - f1^3)) x 2 channels at high SNR, where
    S and N are the powers of the signal and of noise per hertz and T the time.
    """
    low, high, snr_db = 500.0, 8_000.0, 20.0
    shifts = np.array([0.0, 20.4, 33.9])
    rows = shifted(band_noise(5000, low, high, seed=3), shifts)
    errors, stated = [], []
    for seed in range(120):
        found = measured(noisy(rows, snr_db, seed))
        errors.append((found.tau[0] - 20.4 / FS, found.tau[1] - 33.9 / FS))
        stated.append(found.covariance)
    # Power densities: signal 1 / (high - low), noise 10^-2 / (FS / 2).
    ratio = (FS / 2) / (high - low) * 10 ** (snr_db / 10)
    duration = (N - 33.9) / FS
    variance = 3 / (8 * np.pi**2 * duration * ratio * (high**3 - low**3)) * 2
    scatter = np.std(errors, axis=0)
    # 120 trials: a deviation's own error is 6.5 %.
    np.testing.assert_allclose(scatter, np.sqrt(variance), rtol=0.25)
    mean = np.mean(stated, axis=0)
    np.testing.assert_allclose(np.sqrt(np.diag(mean)), scatter, rtol=0.25)
    correlation = mean[0, 1] / np.sqrt(mean[0, 0] * mean[1, 1])
    # Both delays share the noise of the first channel.
    assert correlation == pytest.approx(0.5, abs=0.05)


def test_errors_of_channels_with_unequal_noise_are_their_own():
    """The noise of one channel against the signal of the next, by hand and by trial.

    var of t_k - t_0 is the sum of what channels 0 and k add, and their covariance
    what channel 0 adds. At high SNR a channel adds in proportion to its noise.
    """
    levels = np.array([0.05, 0.1, 0.2])
    rows = shifted(band_noise(5000, 500.0, 8_000.0, seed=3), [0.0, 20.4, 33.9])
    errors, stated = [], []
    for seed in range(150):
        noise = Generator(Philox(key=seed)).standard_normal(rows.shape)
        found = measured((rows + rows.std() * levels[:, None] * noise).astype("f4"))
        errors.append((found.tau[0] - 20.4 / FS, found.tau[1] - 33.9 / FS))
        stated.append(found.covariance)
    mean = np.mean(stated, axis=0)
    scatter = np.sqrt(np.mean(np.square(errors), axis=0))
    np.testing.assert_allclose(np.sqrt(np.diag(mean)), scatter, rtol=0.25)
    # All pairs joined, each channel's part is the mean over its two neighbors.
    share = mean[0, 1] / (mean[1, 1] - mean[0, 1])
    assert share == pytest.approx((levels[0] / levels[2]) ** 2, rel=0.3)


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"high_hz": 60_000.0}, "half the sample rate"),
        ({"low_hz": 16_000.0}, "band"),
        ({"c": 30.0}, "longer frames"),
    ],
)
def test_plan_that_cannot_work(settings, complaint):
    fields = {
        "shape": ROW,
        "c": 340.0,
        "sample_rate_hz": FS,
        "frame_samples": N,
        "low_hz": 300.0,
        "high_hz": 15_000.0,
    }
    with pytest.raises(ValueError, match=complaint):
        DelayPlan(**{**fields, **settings})
