"""What passes the half-band filter, what does not, and where its samples stand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from systems.delays.half_band import PASSED, halve_rate

N = 2500


def tone(share: float, samples) -> np.ndarray:
    """A tone of a share of the rate at numbered samples."""
    return np.sin(2.0 * np.pi * share * np.asarray(samples) + 0.4)


@given(st.floats(0.0, PASSED))
def test_the_band_stays_as_it_is(share):
    """Within 0.02 dB, at every other sample, but for the ends."""
    halved = halve_rate(tone(share, np.arange(N))[np.newaxis].astype(np.float32))
    assert halved.shape == (1, N // 2)
    expected = tone(share, np.arange(1, N, 2))
    np.testing.assert_allclose(halved[0, 4:-5], expected[4:-5], atol=0.0023)


@given(st.floats(0.5 - PASSED, 0.5))
def test_what_would_fold_onto_the_band_is_gone(share):
    halved = halve_rate(tone(share, np.arange(N))[np.newaxis].astype(np.float32))
    assert np.abs(halved[:, 4:-5]).max() < 10.0 ** (-55.0 / 20.0)


@pytest.mark.parametrize("samples", [20, 21, 100])
def test_counts_are_taken_as_they_are(samples):
    counts = np.arange(2 * samples, dtype=np.int16).reshape(2, samples) % 7
    halved = halve_rate(counts)
    np.testing.assert_array_equal(halved, halve_rate(counts.astype(np.float32)))
    assert halved.shape == (2, samples // 2)


def test_beyond_the_frame_there_is_silence():
    """As if it had been recorded with silence before and after it."""
    frame = np.random.default_rng(3).standard_normal((2, 60)).astype(np.float32)
    wider = halve_rate(np.pad(frame, ((0, 0), (20, 20))))
    np.testing.assert_allclose(halve_rate(frame), wider[:, 10:-10], atol=1e-6)
