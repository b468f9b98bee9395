"""The band that a sound occupies: known bands, and what has none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.random import Generator, Philox

from systems.delays.occupied_band import occupied_band

FS, N = 100_000.0, 2500
BIN_HZ = FS / N


def spectra(rows):
    return np.fft.rfft(rows).astype(np.complex64)


def noise(count=3, seed=0):
    return Generator(Philox(key=seed)).standard_normal((count, N))


def band_noise(low_hz, high_hz, seed):
    """Noise of a band, 30 dB over white noise within it."""
    sound = noise(1, seed)[0]
    spectrum = np.fft.rfft(sound)
    f = np.fft.rfftfreq(N, 1 / FS)
    spectrum[(f < low_hz) | (f > high_hz)] = 0.0
    inside = np.fft.irfft(spectrum, N)
    return inside + 10 ** (-30 / 20) * noise(3, seed + 1)


@given(
    st.floats(600.0, 15_000.0),
    st.floats(2_000.0, 15_000.0),
    st.integers(0, 1000),
)
def test_known_bands(low_hz, width_hz, seed):
    """Smoothing over 400 Hz widens the band by up to 200 Hz on either side."""
    high_hz = low_hz + width_hz
    first, last = occupied_band(spectra(band_noise(low_hz, high_hz, seed)), BIN_HZ)
    assert low_hz - 200.0 - 2 * BIN_HZ <= first * BIN_HZ <= low_hz + 200.0
    assert high_hz - 200.0 <= (last - 1) * BIN_HZ <= high_hz + 200.0 + 2 * BIN_HZ


@pytest.mark.parametrize(
    "rows",
    [
        noise(),
        np.zeros((3, N)),
        np.sin(2 * np.pi * 3_000 * np.arange(N) / FS) + 1e-3 * noise(),
    ],
    ids=["white noise", "silence", "a tone"],
)
def test_whole_band_where_no_band_stands_out(rows):
    assert occupied_band(spectra(rows), BIN_HZ) == (0, N // 2 + 1)


@given(st.floats(1e-6, 1e6))
def test_level_does_not_matter(level):
    rows = band_noise(1_000.0, 6_000.0, 3)
    assert occupied_band(spectra(level * rows), BIN_HZ) == occupied_band(
        spectra(rows), BIN_HZ
    )


@pytest.mark.parametrize(("bin_hz", "beside"), [(80.0, 2), (72.86, 2), (400.0, 0)])
def test_band_ends_half_the_smoothing_beside_the_sound(bin_hz, beside):
    """400 Hz are 5 bins, 5.49 or one: two on either side, or none."""
    rows = np.full((2, 600), 1e-3, dtype=np.complex64)
    rows[:, 100:201] = 1j
    assert occupied_band(rows, bin_hz) == (100 - beside, 201 + beside)
