"""Delays of nearly aligned channels, and what is said of their errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.arrays.aligned_delays import fit_aligned_delays

BINS = 400
W = 2 * math.pi * np.linspace(300.0, 7_000.0, BINS)
TAU = np.array([2e-5, -1.5e-5, 0.7e-5])


def fitted(spectra, weights=None, w=W, **options):
    """The delays of spectra that have some."""
    if weights is None:
        weights = np.ones(spectra.shape[1:], np.float32)
    fit = fit_aligned_delays(spectra, weights, w, **options)
    assert fit is not None
    return fit


def snapshots(rng, tau=TAU, *, count=8, noise=0.0):
    """(n, k, f) of one white source, and white noise in each channel."""
    shape = (count, BINS)
    normal = rng.standard_normal
    source = normal(shape) + 1j * normal(shape)
    later = np.concatenate(([0.0], tau))
    heard = source * np.exp(-1j * later[:, None, None] * W)
    disturbance = normal(heard.shape) + 1j * normal(heard.shape)
    return (heard + noise * disturbance).astype(np.complex64)


def test_delays_without_noise_are_exact():
    spectra = snapshots(np.random.default_rng(1))
    fit = fitted(spectra)
    np.testing.assert_allclose(fit.tau, TAU, atol=1e-10)
    assert fit.coherence == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("noise", [0.03, 0.3])
def test_errors_are_those_of_many_trials_and_near_the_bound(noise):
    """Knapp and Carter's bound (1976), as for a pair, from k times f values."""
    rng = np.random.default_rng(2)
    fits = [fitted(snapshots(rng, noise=noise)) for _ in range(300)]
    errors = np.array([f.tau - TAU for f in fits])
    actual = np.sqrt(np.mean(errors**2))
    stated = np.sqrt(np.mean([np.diag(f.covariance) for f in fits]))
    # What is not coherent is taken for echo, which states up to 1 / 3 more.
    echo = 2.0 - np.mean([f.coherence for f in fits])
    assert stated / echo == pytest.approx(actual, rel=0.12)
    coherence = 1.0 / (1.0 + noise**2)
    phase = (1.0 - coherence**2) / (2.0 * coherence**2)
    pair = math.sqrt(phase / (8 * np.sum(W**2)))
    assert actual < 1.2 * pair
    assert abs(np.mean(errors)) < 0.2 * actual


def test_bands_of_noise_do_not_count():
    """White noise in half of the bins costs no more than leaving them out."""
    rng = np.random.default_rng(3)
    errors: dict[str, list[np.ndarray]] = {"with": [], "without": []}
    for _ in range(100):
        spectra = snapshots(rng, noise=0.1)
        noisy = spectra.copy()
        noisy[:, :, BINS // 2 :] = rng.standard_normal((4, 8, BINS // 2))
        errors["with"].append(fitted(noisy).tau - TAU)
        fit = fitted(spectra[:, :, : BINS // 2], w=W[: BINS // 2])
        errors["without"].append(fit.tau - TAU)
    rms = {name: np.sqrt(np.mean(np.square(e))) for name, e in errors.items()}
    assert rms["with"] < 1.1 * rms["without"]


def test_coarse_alignment_begins_at_low_frequencies():
    """0.2 ms is more than a period of the highest frequency."""
    tau = np.array([2e-4, 0.0, -1e-4])
    spectra = snapshots(np.random.default_rng(4), tau, noise=0.1)
    fit = fitted(spectra, coarseness=14.0)
    np.testing.assert_allclose(fit.tau, tau, atol=1e-6)


def test_nothing_to_fit():
    rng = np.random.default_rng(5)
    weights = np.ones((8, BINS), np.float32)
    noise = snapshots(rng, noise=1.0) - snapshots(rng, noise=0.0)
    independent = rng.standard_normal((4, 8, BINS)) + 0j
    assert noise.shape == independent.shape
    assert fit_aligned_delays(independent.astype(np.complex64), weights, W) is None
    silent = np.zeros((4, 8, BINS), np.complex64)
    assert fit_aligned_delays(silent, weights, W) is None
    spectra = snapshots(rng)
    assert fit_aligned_delays(spectra, np.zeros_like(weights), W) is None
