"""Errors of an array: within their bounds, uniform, and none without tolerances."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from systems.sound.array_tolerances import draw_tolerances
from systems.sound.parameters import MicArrayParameters


def parameters(position=0.0, delay=0.0, gain_db=0.0):
    return MicArrayParameters(
        position_tolerance_m=position,
        delay_tolerance_s=delay,
        gain_tolerance_db=gain_db,
    )


def test_perfect_array_has_no_errors():
    drawn = draw_tolerances(parameters(), 4, np.random.default_rng(0))
    np.testing.assert_array_equal(drawn.position_errors, np.zeros((4, 2)))
    np.testing.assert_array_equal(drawn.channel_delays, np.zeros(4))
    np.testing.assert_array_equal(drawn.gains, np.ones(4))


@given(
    st.floats(0.0, 0.1), st.floats(0.0, 1e-4), st.floats(0.0, 40.0), st.integers(0, 99)
)
def test_errors_stay_within_their_tolerances(position, delay, gain_db, seed):
    wanted = parameters(position, delay, gain_db)
    drawn = draw_tolerances(wanted, 3, np.random.default_rng(seed))
    assert np.abs(drawn.position_errors).max() <= position
    assert np.abs(drawn.channel_delays).max() <= delay
    assert np.abs(20.0 * np.log10(drawn.gains)).max() <= gain_db + 1e-12


def test_errors_are_uniform():
    """Standard deviation a / sqrt(3), kurtosis 9 / 5."""
    wanted = parameters(2e-4, 2e-7, 1.0)
    drawn = draw_tolerances(wanted, 20_000, np.random.default_rng(1))
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
