"""The bound against closed forms, measured figures and an efficient estimator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import least_squares

from analysis.arrays.cramer_rao import (
    LocalizationBound,
    SlopeEnergy,
    arrival_information,
    position_bound,
)
from systems.sound.parameters import SoundParameters
from systems.sound.waveforms import make_waveform

RATE, C, FRAME_S = 100_000.0, 340.0, 0.025
ROW = np.array([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])


def polar(distance: float, bearing_deg: float) -> np.ndarray:
    angle = math.radians(bearing_deg)
    return distance * np.array([math.cos(angle), math.sin(angle)])


def flat_band(low_hz: float, high_hz: float, count: int) -> np.ndarray:
    """Periodic noise whose every bin in the band has the same power; RMS 1."""
    bins = np.fft.rfftfreq(count, 1.0 / RATE)
    inside = (bins >= low_hz) & (bins <= high_hz)
    phases = np.random.default_rng(5).uniform(0.0, 2.0 * np.pi, len(bins))
    x = np.fft.irfft(inside * np.exp(1j * phases), count)
    return x / x.std()


def test_two_microphones_have_the_bound_of_knapp_and_carter():
    """var(tau) = 3 / (4 pi^2 T rho (f2^3 - f1^3)) for a density ratio rho >> 1."""
    low, high, noise, distance = 500.0, 8_000.0, 1e-3, 50.0
    sound = flat_band(low, high, 10_000)
    energy = SlopeEnergy.of(sound, RATE, start_time=-distance / C)
    bound = position_bound(
        energy, 0.0, 0.1, [distance, 0.0], [[0.0, 0.01], [0.0, -0.01]], noise,
        sample_rate_hz=RATE, c=C,
    )  # fmt: skip
    rho = (1.0 / distance / noise) ** 2 * (RATE / 2.0) / (high - low)
    expected = 3.0 / (4.0 * math.pi**2 * 0.1 * rho * (high**3 - low**3))
    np.testing.assert_allclose(bound.delays, [[expected]], rtol=2e-3)
    # Two microphones in the plane cannot tell the range.
    assert bound.range_std == bound.bearing_std == math.inf


@given(delay=st.floats(-0.02, 0.02), weights=st.tuples(*[st.floats(0.1, 10.0)] * 2))
def test_only_what_both_heard_informs(delay, weights):
    """A sound of constant slope, of which two channels share T - |delay|."""
    energy = SlopeEnergy(np.linspace(0.0, 7.0, 8), -0.05, 7.0 / 0.1)
    information = arrival_information(energy, 0.0, FRAME_S, [0.0, delay], weights)
    both = weights[0] * weights[1] / sum(weights)
    expected = both * 7.0 / 0.1 * (FRAME_S - abs(delay))
    np.testing.assert_allclose(
        information, expected * np.array([[1.0, -1.0], [-1.0, 1.0]]), rtol=1e-9
    )


def test_slope_energy_of_a_tone():
    """sin(w t) over whole periods: w^2 / 2 of it a second."""
    omega = 2.0 * math.pi * 2_000.0
    sound = np.sin(omega * np.arange(5_000) / RATE)
    energy = SlopeEnergy.of(sound, RATE, start_time=1.0)
    assert energy.before(0.5) == 0.0
    assert energy.before(1.05) == pytest.approx(0.05 * omega**2 / 2.0)
    assert energy.before(2.0) == energy.before(1.05)


@pytest.mark.parametrize(
    ("distance", "bearing_deg", "range_mm"),
    [(1, 0.0061, 0.9), (2, 0.0042, 3.6), (3, 0.0037, 7.9), (4, 0.0036, 14.1)],
)
def test_figures_of_an_independent_computation(distance, bearing_deg, range_mm):
    """Rms over 0, 30 and 60 deg: a chirp of 0.5-8 kHz at 20 dB, 25 ms.

    They were computed for equal stretches of the sound in all channels, which
    is up to 4 % more information than a frame holds.
    """
    sound = make_waveform(SoundParameters(kind="chirp"))
    energy = SlopeEnergy.of(sound, RATE)
    begin = 0.2 + distance / C
    noise = 0.1 * 0.05 / distance
    bounds = [
        position_bound(
            energy, begin, begin + FRAME_S, polar(distance, bearing), ROW, noise,
            sample_rate_hz=RATE, c=C,
        )
        for bearing in (0.0, 30.0, 60.0)
    ]  # fmt: skip
    rms_bearing = math.degrees(math.sqrt(np.mean([b.bearing_std**2 for b in bounds])))
    rms_range = 1e3 * math.sqrt(np.mean([b.range_std**2 for b in bounds]))
    assert rms_bearing == pytest.approx(bearing_deg, rel=0.06)
    assert rms_range == pytest.approx(range_mm, rel=0.06)


@given(
    angle=st.floats(-math.pi, math.pi),
    noises=st.tuples(*[st.floats(1e-4, 1e-2)] * 5),
    elevation=st.floats(-1.2, 1.2),
)
def test_bound_turns_with_the_array_in_space(angle, noises, elevation):
    p_AM = np.random.default_rng(7).uniform(-0.3, 0.3, (5, 3))
    p_AS = 2.0 * np.array([math.cos(elevation), 0.0, math.sin(elevation)])
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    energy = SlopeEnergy(np.linspace(0.0, 1e6, 100), -0.05, 1e3)
    here, there = (
        position_bound(
            energy, 0.0, FRAME_S, p_AS @ R.T, p_AM @ R.T, noises,
            sample_rate_hz=RATE, c=C,
        )
        for R in (np.eye(3), turn)
    )  # fmt: skip
    np.testing.assert_allclose(
        there.covariance, turn @ here.covariance @ turn.T, rtol=1e-6, atol=1e-12
    )
    assert there.bearing_std == pytest.approx(here.bearing_std, rel=1e-6)
    assert there.elevation_std == pytest.approx(here.elevation_std, rel=1e-6)
    assert there.range_std == pytest.approx(here.range_std, rel=1e-6)


def test_covariance_in_polar_coordinates_agrees_with_differences():
    """Standard deviations by sampling the position's covariance."""
    p_AS = np.array([1.5, 0.7, 0.6])
    p_AM = np.random.default_rng(3).uniform(-0.3, 0.3, (4, 3))
    energy = SlopeEnergy(np.linspace(0.0, 1e6, 100), -0.05, 1e3)
    bound = position_bound(
        energy, 0.0, FRAME_S, p_AS, p_AM, 1e-4, sample_rate_hz=RATE, c=C
    )
    draws = np.random.default_rng(4).multivariate_normal(
        p_AS, 1e-6 * bound.covariance, 20_000
    )
    flat = np.hypot(draws[:, 0], draws[:, 1])
    sampled = 1e3 * np.std(
        [
            np.arctan2(draws[:, 1], draws[:, 0]),
            np.arctan2(draws[:, 2], flat),
            np.linalg.norm(draws, axis=1),
        ],
        axis=1,
    )
    assert bound.elevation_std is not None
    stated = [bound.bearing_std, bound.elevation_std, bound.range_std]
    np.testing.assert_allclose(stated, sampled, rtol=0.03)


def test_silence_has_no_bound():
    energy = SlopeEnergy(np.zeros(100), 0.0, RATE)
    bound = position_bound(
        energy, 0.0, FRAME_S, [2.0, 0.0], ROW, 1e-3, sample_rate_hz=RATE, c=C
    )
    assert bound.bearing_std == bound.range_std == math.inf


def test_silence_in_space_has_no_bound_on_the_elevation_either():
    energy = SlopeEnergy(np.zeros(100), 0.0, RATE)
    p_AM = np.vstack((np.zeros(3), np.eye(3)))
    bound = position_bound(
        energy, 0.0, FRAME_S, [2.0, 0.0, 1.0], p_AM, 1e-3, sample_rate_hz=RATE, c=C
    )
    assert bound.elevation_std == math.inf


@pytest.mark.parametrize(
    ("elevations", "mean"), [((2.0, 14.0), 10.0), ((None,) * 2, None)]
)
def test_mean_bound_is_that_of_the_squares(elevations, mean):
    """(1 + 7^2)/2 = 5^2, (2^2 + 14^2)/2 = 10^2, (3^2 + 21^2)/2 = 15^2."""
    bounds = [
        LocalizationBound(
            size * np.eye(2), size * np.eye(3), part, elevation, 3.0 * part
        )
        for size, part, elevation in zip(
            (1.0, 4.0), (1.0, 7.0), elevations, strict=True
        )
    ]
    found = LocalizationBound.mean(bounds)
    np.testing.assert_allclose(found.delays, 2.5 * np.eye(2))
    np.testing.assert_allclose(found.covariance, 2.5 * np.eye(3))
    assert (found.bearing_std, found.range_std) == pytest.approx((5.0, 15.0))
    assert found.elevation_std == (mean and pytest.approx(mean))


def test_maximum_likelihood_reaches_the_bound():
    """A source fitted with its waveform left free: periodic sound, so that all
    that the frame holds can be used, straight ahead, where the channels'
    stretches agree to 0.4 %.
    """
    count, distance, noise, trials = 2_500, 2.0, 0.05, 300
    sound = flat_band(500.0, 8_000.0, count)
    energy = SlopeEnergy.of(np.tile(sound, 4), RATE, start_time=-0.04)
    p_AS = polar(distance, 0.0)
    bound = position_bound(
        energy, 0.0, FRAME_S, p_AS, ROW, noise, sample_rate_hz=RATE, c=C
    )
    omega = 2.0 * math.pi * RATE * np.fft.rfftfreq(count)
    band = (omega > 2.0 * math.pi * 450.0) & (omega < 2.0 * math.pi * 8_100.0)
    omega = omega[band]
    spectrum = np.fft.rfft(sound)[band]

    def steering(p: np.ndarray) -> np.ndarray:
        ranges = np.linalg.norm(p - ROW, axis=1)[:, None]
        return np.exp(-1j * omega * ranges / C) / ranges

    def misfit(p: np.ndarray, spectra: np.ndarray) -> np.ndarray:
        """What is left when the best waveform is taken away."""
        a = steering(p)
        best = np.sum(a.conj() * spectra, axis=0) / np.sum(np.abs(a) ** 2, axis=0)
        left = spectra - a * best
        return np.concatenate((left.real.ravel(), left.imag.ravel()))

    rng = np.random.default_rng(11)
    errors = []
    for _ in range(trials):
        white = noise * rng.standard_normal((3, count))
        spectra = steering(p_AS) * spectrum + np.fft.rfft(white)[:, band]
        fit = least_squares(misfit, p_AS, args=(spectra,), x_scale=0.01)
        errors.append(fit.x - p_AS)
    normalized = np.einsum(
        "ti,ij,tj->t", errors, np.linalg.inv(bound.covariance), np.array(errors)
    )
    # Mean 2 and standard deviation 2 a trial: four standard errors.
    assert np.mean(normalized) == pytest.approx(2.0, abs=4.0 * 2.0 / trials**0.5)
