"""Errors that echoes leave, and how a frame is filled."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from systems.delays.echo_errors import echo_errors, energy_spread
from systems.sound.array_shape import ArrayShape

C = 340.0
ROW = ArrayShape.of([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
WIDE = 2.0 * math.pi * 6e3


def test_direction_ahead_is_known_to_two_thousandths():
    """Of a wide band that is all news: by hand, from the outer pair alone.

    Its delay has the variance of 0.8 m turned by 2e-3 rad and of two arrivals; a
    bearing ahead is delay c / 0.8 m.
    """
    tau13 = math.sqrt(echo_errors(ROW, C, 1.0, WIDE)[1, 1])
    expected = math.hypot(2e-3, math.sqrt(2.0) * 1.2e-6 * C / 0.8)
    assert tau13 * C / 0.8 == pytest.approx(expected)


@given(
    news=st.floats(1e-3, 1.0),
    hertz=st.floats(300.0, 15e3),
    less=st.floats(0.1, 1.0),
)
def test_less_news_or_a_narrower_band_never_helps(news, hertz, less):
    w = 2.0 * math.pi * hertz
    errors = echo_errors(ROW, C, news, w)
    assert np.linalg.eigvalsh(errors)[0] > 0.0
    for worse in (
        echo_errors(ROW, C, less * news, w),
        echo_errors(ROW, C, news, less * w),
    ):
        assert np.all(worse >= errors)


def test_half_the_band_has_four_times_the_error():
    narrow = echo_errors(ROW, C, 1.0, 2.0 * math.pi * 1e3)
    np.testing.assert_allclose(
        echo_errors(ROW, C, 1.0, 2.0 * math.pi * 500.0), 16.0 * narrow
    )


@given(fifths=st.integers(1, 5), level=st.floats(0.1, 100.0))
def test_a_steady_sound_fills_its_share_of_a_frame(fifths, level):
    frame = np.zeros((3, 2500), dtype=np.float32)
    frame[:, : 500 * fifths] = level
    assert energy_spread(frame) == pytest.approx(fifths / 5.0)


def test_noise_fills_a_frame():
    """Energies of 5 parts of 1500 samples scatter by the root of 2/1500."""
    noise = np.random.default_rng(1).standard_normal((3, 2500), dtype=np.float32)
    assert energy_spread(noise) == pytest.approx(1.0, abs=3.0 * 2.0 / 1500.0)
