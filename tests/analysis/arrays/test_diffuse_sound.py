"""Diffuse sound beside direct sound: its share, and delays that it does not move."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.arrays.aligned_delays import fit_aligned_delays

C = 343.0
W = 2 * math.pi * np.linspace(300.0, 7_000.0, 160)
SQUARE = 0.0325 * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0.0]])
FIRST, SECOND = np.triu_indices(4, 1)
SNAPSHOTS = 12


def normal(rng):
    shape = (SNAPSHOTS, W.size)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def waves(rng, share, noise=0.0, count=60):
    """Spectra of a wave and of others from all directions, and the delays of the one.

    All are independent. The microphones are aligned to 1 / 32 ms.
    """
    azimuth, rise = rng.uniform(-math.pi, math.pi), math.radians(15.0)
    u = [
        math.cos(rise) * math.cos(azimuth),
        math.cos(rise) * math.sin(azimuth),
        math.sin(rise),
    ]
    tau = -(SQUARE @ u) / C
    tau -= tau[0]

    def wave(later, power):
        return (
            math.sqrt(power) * normal(rng) * np.exp(-1j * np.outer(later, W))[:, None]
        )

    heard = wave(tau, 1.0 - share)
    for _ in range(count):
        v = rng.standard_normal(3)
        heard = heard + wave(-(SQUARE @ v) / np.linalg.norm(v) / C, share / count)
    heard = heard + noise * np.array([normal(rng) for _ in SQUARE])
    lags = np.rint(tau * 32_000) / 32_000
    turned = heard * np.exp(1j * np.outer(lags, W))[:, None]
    apart = np.linalg.norm(SQUARE[FIRST] - SQUARE[SECOND], axis=1)
    diffuse = np.sinc(np.outer(apart, W) / (math.pi * C))
    diffuse = diffuse * np.exp(1j * np.outer(lags[SECOND] - lags[FIRST], W))
    return turned.astype(np.complex64), diffuse.astype(np.complex64), tau[1:], lags[1:]


def fits(rng, share, *, corrected=True, noise=0.0, draws=12):
    """Shares, delays as multiples of the true ones, and their deviations."""
    found = []
    for _ in range(draws):
        spectra, diffuse, tau, lags = waves(rng, share, noise)
        weights = np.ones(spectra.shape[1:], np.float32)
        fit = fit_aligned_delays(
            spectra, weights, W, diffuse=diffuse if corrected else None
        )
        assert fit is not None
        scale = (fit.tau + lags) @ tau / (tau @ tau)
        std = math.sqrt(tau @ fit.covariance @ tau) / (tau @ tau)
        found.append((fit.diffuse_share, scale, std))
    return np.array(found).T


def test_diffuse_sound_shortens_delays_unless_it_is_removed():
    """A share of a half, of which the square root is removed, as rooms need it."""
    _, scale, _ = fits(np.random.default_rng(1), 0.5, corrected=False)
    assert np.mean(scale) < 0.97
    share, scale, std = fits(np.random.default_rng(1), 0.5)
    assert np.mean(share**2) == pytest.approx(0.5, abs=0.1)
    assert np.mean(np.abs(scale - 1.0) < 2.0 * std) > 0.9
    assert abs(np.mean(scale) - 1.0) < 0.05


@pytest.mark.parametrize("noise", [0.0, 0.4])
def test_noise_of_the_channels_is_not_diffuse(noise):
    rng = np.random.default_rng(2)
    share, scale, std = fits(rng, 0.0, noise=noise)
    _, _, without = fits(np.random.default_rng(2), 0.0, noise=noise, corrected=False)
    assert np.median(share) < 0.02
    assert np.median(np.abs(scale - 1.0)) < 0.01
    # Nothing is added to the errors in the free field.
    assert np.median(std) < 1.1 * np.median(without) + 1e-6
