"""What passes the half-band filter, what does not, and where its samples stand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from systems.half_band import PASSED, halve_rate, halved_samples

N = 2500


def tone(share: float, samples) -> np.ndarray:
    """A tone of a share of the rate at numbered samples."""
    return np.sin(2.0 * np.pi * share * np.asarray(samples) + 0.4)


@given(st.floats(0.0, PASSED))
def test_the_band_stays_as_it_is(share):
    """Within 0.02 dB, at every other sample from the tenth on."""
    halved = halve_rate(tone(share, np.arange(N))[np.newaxis].astype(np.float32))
    assert halved.shape == (1, halved_samples(N))
    kept = np.arange(9, N - 9, 2)
    assert halved.shape == (1, len(kept))
    np.testing.assert_allclose(halved[0], tone(share, kept), atol=0.0023)


@given(st.floats(0.5 - PASSED, 0.5))
def test_what_would_fold_onto_the_band_is_gone(share):
    halved = halve_rate(tone(share, np.arange(N))[np.newaxis].astype(np.float32))
    assert np.abs(halved).max() < 10.0 ** (-55.0 / 20.0)


@pytest.mark.parametrize("samples", [20, 21, 100])
def test_counts_are_taken_as_they_are(samples):
    counts = np.arange(2 * samples, dtype=np.int16).reshape(2, samples) % 7
    halved = halve_rate(counts)
    np.testing.assert_array_equal(halved, halve_rate(counts.astype(np.float32)))
    assert halved.shape == (2, halved_samples(samples))
