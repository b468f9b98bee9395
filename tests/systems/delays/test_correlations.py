"""Correlations from cross-spectra, and vertices of parabolas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from systems.delays.correlations import correlations_at_lags, parabola_vertex


def test_the_lag_of_a_shifted_signal_is_the_place_of_the_peak():
    x = np.random.default_rng(1).standard_normal(256)
    spectra = np.fft.rfft([x, np.roll(x, 7), np.roll(x, -3)])
    cross = spectra[0].conj() * spectra[1:]
    values = correlations_at_lags(cross, slice(len(spectra[0])), 256, 10)
    assert values.shape == (2, 21)
    assert (values.argmax(axis=1) - 10).tolist() == [7, -3]
    np.testing.assert_allclose(values[0, 10], x @ np.roll(x, 7))


def test_bins_beyond_the_band_are_zero_and_the_precision_is_kept():
    cross = np.ones((1, 3), dtype=np.complex64)
    values = correlations_at_lags(cross, slice(2, 5), 64, 31)
    assert values.dtype == np.float32
    lags = np.arange(-31, 32)
    bins = 2.0 * np.cos(2.0 * np.pi * np.outer([2, 3, 4], lags) / 64) / 64
    np.testing.assert_allclose(values[0], bins.sum(axis=0), atol=1e-7)


@given(st.floats(-0.5, 0.5), st.floats(0.01, 10.0), st.floats(-5.0, 5.0))
def test_the_vertex_of_a_parabola_is_exact(at, bend, height):
    left, top, right = (height - bend * (k - at) ** 2 for k in (-1, 0, 1))
    assert parabola_vertex(left, top, right) == pytest.approx(at, abs=1e-9)


def test_without_a_maximum_the_vertex_stays_in_the_middle():
    shifts = parabola_vertex(np.array([1.0, 0.0, 9.0]), np.zeros(3), np.zeros(3))
    np.testing.assert_array_equal(shifts, 0.0)


def test_the_vertex_is_at_most_one_step_away():
    assert parabola_vertex(9.0, 4.0, -2.0) == -1.0
