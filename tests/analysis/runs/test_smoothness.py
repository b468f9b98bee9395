"""Smoothness against published values, closed forms and SciPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad
from scipy.signal import savgol_filter

from analysis.runs.smoothness import (
    jerk,
    log_dimensionless_jerk,
    spectral_arc_length,
    turn_reversals,
    windows,
)

PERIOD = 0.025
TIME = np.arange(-1.0, 1.0, 0.01)
#: The example of the docstrings of github.com/siva82kb/smoothness.
BELL = np.exp(-5.0 * TIME**2)


def test_published_value_of_sparc():
    assert spectral_arc_length(BELL, 100.0) == pytest.approx(-1.41403, abs=5e-6)


def test_published_value_of_ldlj():
    assert log_dimensionless_jerk(BELL, 100.0) == pytest.approx(-5.81636, abs=5e-6)


def test_a_stack_of_movements_has_a_value_each():
    stack = np.stack([BELL, 2.0 * BELL, 3.0 * BELL])
    sparc, ldlj = (
        spectral_arc_length(stack, 100.0),
        log_dimensionless_jerk(stack, 100.0),
    )
    np.testing.assert_allclose(sparc, np.full(3, -1.41403), atol=5e-6)
    np.testing.assert_allclose(ldlj, np.full(3, -5.81636), atol=5e-6)


def test_sparc_of_two_jolts_is_the_arc_of_a_cosine_up_to_10_hz():
    """1 and 1/2, 0.1 s apart: |1 + exp(-j 2 pi x)/2| / 1.5 over x = f / 10 Hz."""
    jolts = np.zeros(256)
    jolts[0], jolts[8] = 1.0, 0.5

    def slope(x):
        size = math.sqrt(1.25 + math.cos(2.0 * math.pi * x))
        return math.pi * math.sin(2.0 * math.pi * x) / (1.5 * size)

    arc = quad(lambda x: math.hypot(1.0, slope(x)), 0.0, 1.0)[0]
    assert spectral_arc_length(jolts, 80.0) == pytest.approx(-arc, rel=2e-4)
    # Of 16 samples 10 Hz is the 32nd line of the spectrum, and counts.
    assert spectral_arc_length(jolts[:16], 80.0) == pytest.approx(-arc, rel=4e-3)


def test_sparc_is_of_the_band_from_the_first_loud_frequency_to_the_last():
    """1 and -1, 0.1 s apart: |sin(pi x)|, of 5 % or more but at the ends."""
    jolts = np.zeros(1024)
    jolts[0], jolts[8] = 1.0, -1.0
    edge = math.asin(0.05) / math.pi
    width = 1.0 - 2.0 * edge

    def slope(u):
        return width * math.pi * math.cos(math.pi * (edge + width * u))

    arc = quad(lambda u: math.hypot(1.0, slope(u)), 0.0, 1.0)[0]
    assert spectral_arc_length(jolts, 80.0) == pytest.approx(-arc, rel=2e-3)


@given(scale=st.floats(1e-3, 1e3))
def test_both_are_the_same_in_any_unit(scale):
    for measure in (spectral_arc_length, log_dimensionless_jerk):
        assert measure(scale * BELL, 100.0) == pytest.approx(measure(BELL, 100.0))


def two_movements(gap: float):
    halves = [np.exp(-40.0 * (TIME + shift) ** 2) for shift in (-gap / 2, gap / 2)]
    return halves[0] + halves[1]


def test_two_movements_are_less_smooth_than_one():
    """Balasubramanian et al. 2015; by SPARC the less the farther apart they are."""
    speeds = np.stack([two_movements(gap) for gap in (0.0, 0.5, 0.7, 0.9)])
    assert np.all(np.diff(spectral_arc_length(speeds, 100.0)) < 0.0)
    ldlj = log_dimensionless_jerk(speeds, 100.0)
    assert np.all(ldlj[1:] < ldlj[0])


@given(seed=st.integers(0, 100))
def test_jerk_is_scipys_savitzky_golay(seed):
    velocity = np.random.default_rng(seed).standard_normal((60, 2))
    scipys = savgol_filter(velocity, 11, 3, deriv=2, delta=PERIOD, axis=0)[5:-5]
    np.testing.assert_allclose(jerk(velocity, PERIOD), scipys, atol=1e-9)


def test_jerk_of_a_cubic_is_exact():
    """v = t^3 + 2 t^2: v'' = 6 t + 4."""
    time = np.arange(40) * PERIOD
    expected = 6.0 * time[5:-5] + 4.0
    np.testing.assert_allclose(jerk(time**3 + 2 * time**2, PERIOD), expected, rtol=1e-9)


@pytest.mark.parametrize(("hertz", "loss"), [(1.0, 0.05), (2.0, 0.19), (5.0, 0.79)])
def test_jerk_of_a_sine_is_low_by_what_is_stated(hertz, loss):
    omega = 2.0 * math.pi * hertz
    velocity = np.sin(omega * np.arange(0.0, 20.0, PERIOD))
    largest = np.max(np.abs(jerk(velocity, PERIOD))) / omega**2
    assert largest == pytest.approx(1.0 - loss, abs=0.006)


def test_jerk_of_too_short_a_run_is_empty():
    assert jerk(np.ones((10, 2)), PERIOD).shape == (0, 2)
    assert jerk(np.ones(11), PERIOD).shape == (1,)


def test_reversals_of_a_swinging_heading():
    """0.5 Hz over 10 s: ten half-waves; half the amplitude is no turn at all."""
    rate = np.sin(2 * math.pi * 0.5 * np.arange(0.0, 10.0, PERIOD))
    assert turn_reversals(rate, least=0.1) == 9
    assert turn_reversals(0.05 * rate, least=0.1) == 0
    assert turn_reversals(np.abs(rate), least=0.1) == 0
    assert turn_reversals([0.1, 0.0, -0.1, 0.05, 0.1], least=0.1) == 2


def test_windows_leave_the_rest_out():
    assert windows(np.arange(7.0), 3).tolist() == [[0, 1, 2], [3, 4, 5]]
    assert windows(np.arange(2.0), 3).shape == (0, 3)
