"""Margins of frequency responses and of loops with delays, against closed forms."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from scipy.optimize import brentq

import phonotaxis
from systems.framework.input_error import InputError

OMEGA = np.geomspace(1e-3, 1e3, 400)


@pytest.mark.parametrize(
    ("loop", "unstable_poles"),
    [
        (control.tf([25.0], [1.0, 10.0, 10.0, 10.0]), 0),
        (control.tf([2.0], [1.0, -1.0]), 1),
        (control.tf([3.0, 6.0, 3.0], [1.0, 0.0, 0.0, 0.0]), 0),
        (control.tf([1.0], [1.0, 1.0, 0.0]), 0),
        (control.tf([100.0], [1.0, 10.0, 10.0, 10.0]), 0),  # unstable
        (control.tf([0.5], [1.0, -1.0]), 1),  # unstable
    ],
)
def test_a_response_has_the_margins_of_its_model(loop, unstable_poles):
    data = control.frequency_response(loop, OMEGA)
    found = phonotaxis.margins(data, unstable_poles=unstable_poles)
    exact = phonotaxis.margins(loop)
    assert found.stable == exact.stable
    for name in (
        "gain_increase_margin", "gain_reduction_margin", "phase_lag_margin_deg",
        "delay_margin_s", "modulus_margin", "sensitivity_peak", "complementary_peak",
    ):  # fmt: skip
        assert getattr(found, name) == pytest.approx(getattr(exact, name), rel=2e-3)
    assert found.disk.alpha == pytest.approx(exact.disk.alpha, rel=2e-3)


@pytest.mark.parametrize("as_data", [False, True])
@pytest.mark.parametrize(("gain", "delay"), [(0.5, 1.0), (1.2, 1.0), (2.0, 1.0)])
def test_an_integrator_with_a_delay(gain, delay, as_data):
    # L = K e^{-s} / s: phase -180 deg at pi/2, |L| = 1 at K; unstable from K = pi/2.
    loop = control.tf([gain], [1.0, 0.0])
    given = control.frequency_response(loop, OMEGA[OMEGA < 20.0]) if as_data else loop
    if as_data:
        given = control.frd(
            given.frdata * np.exp(-1j * given.omega * 0.4), given.omega, 0
        )
    found = phonotaxis.margins(given, delay_s=0.6 if as_data else delay)
    assert found.stable == (gain < math.pi / 2.0)
    if found.stable:
        assert found.gain_increase_margin == pytest.approx(
            math.pi / (2.0 * gain), rel=1e-3
        )
        assert found.phase_lag_margin_deg == pytest.approx(
            90.0 - math.degrees(gain * delay), rel=1e-3
        )
        # Nearest approach to -1, by a direct search.
        w = np.linspace(0.01, 10.0, 200_001)
        distance = np.abs(1.0 + gain * np.exp(-1j * w * delay) / (1j * w)).min()
        assert found.modulus_margin == pytest.approx(distance, rel=1e-3)


def test_a_lag_with_a_delay_becomes_unstable_where_theory_says():
    # K e^{-Ls} / (s + 1): tan(w L) = -w and K = sqrt(1 + w^2).
    K = 3.0
    w = math.sqrt(K * K - 1.0)
    critical = (math.pi - math.atan(w)) / w
    loop = control.tf([K], [1.0, 1.0])
    assert phonotaxis.margins(loop, delay_s=0.999 * critical).stable
    assert not phonotaxis.margins(loop, delay_s=1.001 * critical).stable
    phase = brentq(lambda w: w * 0.2 + math.atan(w) - math.pi, 1.0, 15.0)
    found = phonotaxis.margins(loop, delay_s=0.2)
    assert found.gain_increase_margin == pytest.approx(math.hypot(1.0, phase) / K)


def test_stability_may_return_with_a_longer_delay():
    # A lightly damped mode whose feedback, late by half a turn, adds damping.
    loop = control.tf([0.5], [1.0, 0.1, 1.0])

    def growing(delay):
        # Poles of s^2 + 0.1 s + 1 + 0.5 e^{-s tau} by Newton from many starts.
        real, imaginary = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(0, 3, 61))
        s = (real + 1j * imaginary).ravel()
        for _ in range(60):
            late = 0.5 * np.exp(-s * delay)
            s = s - (s * s + 0.1 * s + 1 + late) / (2 * s + 0.1 - delay * late)
        rest = np.abs(s * s + 0.1 * s + 1 + 0.5 * np.exp(-s * delay))
        return bool((s[rest < 1e-9].real > 1e-9).any())

    answers = []
    for delay in np.arange(0.25, 12.0, 0.5):
        with np.errstate(all="ignore"):
            expected = not growing(delay)
        assert phonotaxis.margins(loop, delay_s=delay).stable == expected, delay
        answers.append(expected)
    assert set(answers) == {True, False}


def test_a_sampled_loop_is_delayed_by_whole_periods():
    loop = control.tf([0.3], [1.0, -1.0], 0.1)
    late = control.tf([0.3], [1.0, -1.0, 0.0, 0.0], 0.1)
    found = phonotaxis.margins(loop, delay_s=0.2)
    assert found.gain_increase_margin == pytest.approx(
        phonotaxis.margins(late).gain_increase_margin
    )
    with pytest.raises(InputError, match="multiple of the period"):
        phonotaxis.margins(loop, delay_s=0.25)


def test_data_that_decide_nothing_are_refused():
    loop = control.tf([25.0], [1.0, 10.0, 10.0, 10.0])
    early = control.frequency_response(loop, OMEGA[OMEGA < 1.0])
    with pytest.raises(InputError, match="ends too early"):
        phonotaxis.margins(early)
    late = control.frequency_response(loop, OMEGA[OMEGA > 0.7])
    with pytest.raises(InputError, match="begins too late"):
        phonotaxis.margins(late)
    thin = control.frequency_response(loop, np.geomspace(1e-2, 1e3, 6))
    with pytest.raises(InputError, match="give more points"):
        phonotaxis.margins(thin)
    with pytest.raises(InputError, match="delay_s: is -1"):
        phonotaxis.margins(loop, delay_s=-1.0)
    with pytest.raises(InputError, match="infinite frequency"):
        phonotaxis.margins(control.tf([2.0, 1.0], [1.0, 3.0]), delay_s=0.1)


TEXTBOOK = control.tf([25.0], [1.0, 10.0, 10.0, 10.0])
# A rotation couples the channels; S then has other directions at each frequency.
COUPLED = control.ss(
    np.diag([-1.0, -0.2]), [[3.0, 1.0], [-0.2, 0.5]], [[1.0, 0.3], [-1.0, 1.0]], 0.0
)


@pytest.mark.parametrize("skew", [0.0, 1.0])
@pytest.mark.parametrize(
    ("loop", "delay"),
    [
        (TEXTBOOK, 0.0),
        (TEXTBOOK, 0.1),
        (COUPLED, 0.0),
        (COUPLED.sample(0.1), 0.0),
        (COUPLED.sample(0.1), 0.2),
        (control.tf([2.0], [1.0, -1.0]), 0.1),
    ],
)
def test_the_disk_margin_of_a_response_is_that_of_its_model(loop, delay, skew):
    omega = OMEGA[math.pi / loop.dt > OMEGA] if loop.dt else OMEGA
    data = control.frequency_response(loop, omega)
    growing = int((loop.poles().real > 0.0).sum()) if not loop.dt else 0
    found = phonotaxis.disk_margin(
        data, skew=skew, delay_s=delay, unstable_poles=growing
    )
    exact = phonotaxis.disk_margin(loop, skew=skew, delay_s=delay)
    assert 0.0 < exact.alpha < math.inf
    assert found.alpha == pytest.approx(exact.alpha, rel=2e-3)
    assert found.destabilizing_alpha == pytest.approx(found.alpha, rel=1e-5)


def test_the_delay_margin_of_a_response():
    # L = 2 / (s - 1): 60 deg of lag at sqrt(3) rad/s.
    data = control.frequency_response(control.tf([2.0], [1.0, -1.0]), OMEGA)
    found = phonotaxis.delay_margin(data, unstable_poles=1)
    expected = math.radians(60.0) / math.sqrt(3.0)
    assert found.delay_s == pytest.approx(expected, rel=1e-3)
    with pytest.raises(InputError, match="unstable without a delay"):
        phonotaxis.delay_margin(data)
    # Levin and May (1976), as in test_given_delays.
    omega = np.geomspace(1e-3, math.pi / 0.1 * 0.999, 400)
    for gain in (0.05, 0.3, 0.9):
        data = control.frequency_response(control.tf([gain], [1.0, -1.0], 0.1), omega)
        limit = next(
            d for d in range(100) if gain >= 2.0 * math.cos(d * math.pi / (2 * d + 1))
        )
        found = phonotaxis.delay_margin(data)
        assert found.whole_periods
        assert found.delay_s == pytest.approx(0.1 * limit)


def test_several_loops_that_are_not_decided_are_refused():
    data = control.frequency_response(COUPLED, OMEGA)
    with pytest.raises(InputError, match="choose one of each"):
        phonotaxis.delay_margin(data)
    with pytest.raises(InputError, match="as many outputs as inputs"):
        phonotaxis.disk_margin(data[:, 0])
    with pytest.raises(InputError, match=r"give control\.frequency_response"):
        phonotaxis.disk_margin(COUPLED, delay_s=0.1)
    # Of a loop that turns too often, the closed loop is unstable.
    assert phonotaxis.disk_margin(data, unstable_poles=1).alpha == 0.0
    sampled = control.frequency_response(COUPLED.sample(0.1), OMEGA[OMEGA < 31.0])
    with pytest.raises(InputError, match="multiple of the period"):
        phonotaxis.disk_margin(sampled, delay_s=0.05)
