"""Errors of an array: within their bounds, uniform, and none without tolerances."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from analysis.arrays.array_tolerances import ArrayTolerances, draw_errors


def test_perfect_array_has_no_errors():
    drawn, speed = draw_errors(ArrayTolerances(), 4, np.random.default_rng(0))
    assert speed == 1.0
    np.testing.assert_array_equal(drawn.position_errors, np.zeros((4, 2)))
    np.testing.assert_array_equal(drawn.channel_delays, np.zeros(4))
    np.testing.assert_array_equal(drawn.gains, np.ones(4))


@given(
    st.floats(0.0, 0.1), st.floats(0.0, 1e-4), st.floats(0.0, 40.0), st.integers(0, 99)
)
def test_errors_stay_within_their_tolerances(position, delay, gain_db, seed):
    wanted = ArrayTolerances(position, delay, gain_db, 0.01)
    drawn, speed = draw_errors(wanted, 3, np.random.default_rng(seed))
    assert 0.99 <= speed <= 1.01
    assert np.abs(drawn.position_errors).max() <= position
    assert np.abs(drawn.channel_delays).max() <= delay
    assert np.abs(20.0 * np.log10(drawn.gains)).max() <= gain_db + 1e-12


def test_errors_are_uniform():
    """Standard deviation a / sqrt(3), kurtosis 9 / 5."""
    wanted = ArrayTolerances(2e-4, 2e-7, 1.0)
    drawn, _ = draw_errors(wanted, 20_000, np.random.default_rng(1))
    gains_db = 20.0 * np.log10(drawn.gains)
    for errors, bound in (
        (drawn.position_errors[:, 0], 2e-4),
        (drawn.position_errors[:, 1], 2e-4),
        (drawn.channel_delays, 2e-7),
        (gains_db, 1.0),
    ):
        unit = errors / bound
        assert abs(unit.mean()) < 0.02
        assert unit.std() == pytest.approx(1 / math.sqrt(3), rel=0.02)
        assert np.mean(unit**4) / np.mean(unit**2) ** 2 == pytest.approx(1.8, rel=0.02)
