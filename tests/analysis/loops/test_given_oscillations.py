"""Predicted limit cycles against closed forms and an exact condition for relays."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import phonotaxis
from systems.framework.input_error import InputError


def relay(x):
    return 1.0 if x > 0.0 else -1.0


class Relay(control.DescribingFunctionNonlinearity):
    def __call__(self, x):
        return relay(x)

    def describing_function(self, A):
        return 4.0 / (math.pi * A)

    def _isstatic(self):
        return True


def test_a_relay_has_the_amplitude_of_the_textbook():
    # 1/(s (s+1)^2): phase -180 deg at 1 rad/s, |L| = 1/2; N = 4/(pi A): A = 2/pi.
    loop = control.tf([1.0], [1.0, 2.0, 1.0, 0.0])
    (cycle,) = phonotaxis.describing_function(loop, Relay()).cycles
    assert cycle.amplitude == pytest.approx(2.0 / math.pi, rel=1e-6)
    assert cycle.frequency_rad_s == pytest.approx(1.0, rel=1e-6)
    assert cycle.stable
    # Exact condition (Astrom 1995): C (I + e^{Ah})^-1 int e^{As} ds B = 0 for the half
    # period h. The integrator is replaced by a slow lag, so that the inverse exists.
    system = control.ss(control.tf([1.0], np.polymul([1.0, 2.0, 1.0], [1.0, 1e-6])))
    A, B, C = system.A, system.B, system.C

    def condition(h):
        integral = np.linalg.solve(A, expm(A * h) - np.eye(3)) @ B
        return float((C @ np.linalg.solve(np.eye(3) + expm(A * h), integral))[0, 0])

    half = brentq(condition, 2.0, 5.0)
    assert cycle.frequency_rad_s == pytest.approx(math.pi / half, rel=0.05)


def test_a_delay_moves_the_cycle():
    # K e^{-s}/s with a relay: w = pi/2, A = 4 K / (pi w).
    loop = control.tf([0.3], [1.0, 0.0])
    cycles = phonotaxis.describing_function(loop, Relay(), delay_s=1.0).cycles
    # At 5/2 pi, 9/2 pi ... further cycles solve the equation; none of them is stable.
    assert [each.stable for each in cycles[:-1]] == [False] * (len(cycles) - 1)
    cycle = cycles[-1]
    assert cycle.stable
    assert cycle.frequency_rad_s == pytest.approx(math.pi / 2.0, rel=1e-6)
    assert cycle.amplitude == pytest.approx(2.4 / math.pi**2, rel=1e-6)


def test_a_saturated_conditionally_stable_loop_has_an_unstable_cycle():
    # 3 (s+1)^2/s^3 is stable for gains above 1/6: with a
    # saturation of slope 1, N falls with the amplitude to 1/6.
    loop = control.tf([3.0, 6.0, 3.0], [1.0, 0.0, 0.0, 0.0])
    saturation = control.saturation_nonlinearity(1.0)
    (cycle,) = phonotaxis.describing_function(loop, saturation).cycles
    assert not cycle.stable
    # N(A) = 2/pi (asin(1/A) + sqrt(1 - 1/A^2)/A) = 1/6, at w = 1 rad/s.
    expected = brentq(
        lambda A: 2 / math.pi * (math.asin(1 / A) + math.sqrt(1 - A**-2) / A) - 1 / 6,
        1.1,
        50.0,
    )
    assert cycle.amplitude == pytest.approx(expected, rel=1e-5)
    assert cycle.frequency_rad_s == pytest.approx(1.0, rel=1e-5)


def test_a_function_without_a_closed_form_and_a_sampled_loop():
    # A cubic a^3 has N = 3/4 A^2. 0.5/(z - 1) reaches -1 at a gain of 4.
    loop = control.tf([0.5], [1.0, -1.0], 0.1)
    found = phonotaxis.describing_function(loop * control.tf([1.0], [1.0, 0.0], 0.1),
                                           lambda x: x**3)  # fmt: skip
    # 0.5 k z^-1/(z-1): |z| = 1 at cos(w T) = 1/2: gain 1/0.5.
    (cycle,) = found.cycles
    assert cycle.frequency_rad_s == pytest.approx(math.pi / 3.0 / 0.1, rel=1e-6)
    assert cycle.amplitude == pytest.approx(math.sqrt(2.0 * 4.0 / 3.0), rel=1e-2)
    assert not cycle.stable
    assert "unstable limit cycle" in str(found)


def test_no_crossing_is_no_cycle():
    found = phonotaxis.describing_function(control.tf([1.0], [1.0, 1.0]), Relay())
    assert found.cycles == ()
    with pytest.raises(InputError, match="positive"):
        phonotaxis.describing_function(
            control.tf([1.0], [1.0, 1.0]), Relay(), amplitudes=[0.0, 1.0]
        )


@pytest.mark.parametrize("hold", ["zero", "last"])
def test_a_scalar_plant_that_hears_part_of_the_time(hold):
    a, k, on, off = 0.3, 2.0, 0.5, 1.5
    found = phonotaxis.burst_cycle(
        control.ss([[a]], [[k]], [[1.0]], [[0.0]]), on, off, hold=hold
    )
    during = math.exp((a - k) * on)
    grown = math.exp(a * off)
    after = grown - (k * (grown - 1.0) / a if hold == "last" else 0.0)
    assert found.multipliers == pytest.approx([during * after])
    assert found.stable == (abs(during * after) < 1.0)


def test_a_sampled_plant_that_hears_part_of_the_time():
    # x+ = x + u: two closed steps, then three with the last input, -g x[1].
    g = 0.4
    loop = control.ss([[1.0]], [[g]], [[1.0]], [[0.0]], 0.1)
    x, u = [1.0], 0.0
    for k in range(5):
        u = -g * x[k] if k < 2 else u
        x.append(x[k] + u)
    found = phonotaxis.burst_cycle(loop, 0.2, 0.3)
    assert found.largest == pytest.approx(abs(x[5]))
    with pytest.raises(InputError, match="multiple of the period"):
        phonotaxis.burst_cycle(loop, 0.25, 0.3)
