"""Margins against exact root counts, closed forms and closed-loop eigenvalues.

The independent method: |N(j w)|^2 - |D(j w)|^2 is a polynomial in w^2 with rational
coefficients. Sturm's theorem counts its positive roots in exact arithmetic, however
near to one another they are.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

import control
import numpy as np
import pytest

from analysis.loops.frequency_levels import frequency_grid, peak
from analysis.loops.gang_of_four import gang_of_four
from analysis.loops.heading_loop import heading_loop, heading_loop_margins
from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import is_loop, loop_margins
from analysis.loops.margin_results import frequency_response
from analysis.stability.attraction_search import least_damping
from analysis.stability.requirements import Requirements
from diagrams.scenario.scenario import Scenario
from systems.base.robot import RobotParameters
from systems.heading.parameters import MotorDriverParameters
from tests.operating_points import follow_point

# --- exact polynomials, lowest power first ---------------------------------------


def product(*factors):
    result = [Fraction(1)]
    for factor in factors:
        found = [Fraction(0)] * (len(result) + len(factor) - 1)
        for i, a in enumerate(result):
            for j, b in enumerate(factor):
                found[i + j] += a * Fraction(b)
        result = found
    return result


def plus(a, b, sign=1):
    n = max(len(a), len(b))
    a, b = (p + [Fraction(0)] * (n - len(p)) for p in (list(a), list(b)))
    return [x + sign * y for x, y in zip(a, b, strict=True)]


def squared(p):
    """|p(j w)|^2 as a polynomial in w^2."""
    real = [
        c * (-1) ** (k // 2) if k % 2 == 0 else Fraction(0) for k, c in enumerate(p)
    ]
    imag = [
        c * (-1) ** (k // 2) if k % 2 == 1 else Fraction(0) for k, c in enumerate(p)
    ]
    return plus(product(real, real), product(imag, imag))[::2]


def value(p, x):
    result = Fraction(0)
    for c in reversed(p):
        result = result * x + c
    return result


def trimmed(p):
    p = list(p)
    while p and p[-1] == 0:
        p.pop()
    return p


def positive_roots(p):
    """All x > 0 with p(x) = 0, by Sturm's theorem and bisection."""
    p = trimmed(p)
    while p and p[0] == 0:
        p = p[1:]
    if len(p) < 2:
        return []
    chain = [p, [c * k for k, c in enumerate(p)][1:]]
    while True:
        a, b = list(chain[-2]), chain[-1]
        while len(a) >= len(b):
            share = a[-1] / b[-1]
            for k in range(len(b)):
                a[len(a) - len(b) + k] -= share * b[k]
            a.pop()
        a = trimmed(a)
        if not a:
            break
        chain.append([-c / abs(a[-1]) for c in a])

    def changes(x):
        signs = [v > 0 for v in (value(q, x) for q in chain) if v != 0]
        return sum(a != b for a, b in pairwise(signs))

    found = []

    def bisect(low, high, at_low, at_high):
        if at_low == at_high:
            return
        if at_low - at_high == 1 and high < low * (1 + Fraction(1, 2**48)):
            found.append(float(low))
            return
        ratio = (high / low).numerator.bit_length() - (
            high / low
        ).denominator.bit_length()
        middle = low * 2 ** (ratio // 2) if ratio > 4 else (low + high) / 2
        at = changes(middle)
        bisect(low, middle, at_low, at)
        bisect(middle, high, at, at_high)

    low, high = Fraction(1, 2**200), Fraction(2**200)
    bisect(low, high, changes(low), changes(high))
    return found


# --- random loops ---------------------------------------------------------------------


def series(sections, gain):
    """State space, and exact numerator and denominator, of sections in a row."""
    A, B, C = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    D = np.array([[gain]])
    numerator, denominator = [Fraction(gain)], [Fraction(1)]
    for over, under in sections:
        n = len(under) - 1
        a, top = np.array(under[n - 1 :: -1]), np.zeros(n + 1)
        top[: len(over)] = over
        own_A = np.vstack([-a[None], np.eye(n)[:-1]])
        own_C = (top[n - 1 :: -1] - a * top[n])[None] if n > 0 else top[:0][None]
        own_B, own_D = np.eye(n)[:, :1], top[n]
        A = np.block([[A, np.zeros((len(A), n))], [own_B @ C, own_A]])
        B, C = np.vstack([B, own_B @ D]), np.hstack([own_D * C, own_C])
        D = own_D * D
        numerator, denominator = product(numerator, over), product(denominator, under)
    names = tuple(f"x{k}" for k in range(len(A)))
    return LinearModel("L", A, B, C, D, names, ("u",), ("y",)), numerator, denominator


def sections_of(rng, decades):
    """One to three integrators, lags, modes and notches; damping from 1e-6 on."""
    found: list[Any] = []
    for _ in range(rng.integers(1, 4)):
        w, z = 10.0 ** rng.uniform(*decades), 10.0 ** rng.uniform(-6.0, 0.0)
        if rng.random() < 0.4:
            pole = float(rng.choice([0.0, w, -w], p=[0.4, 0.5, 0.1]))
            over = [w] if rng.random() < 0.6 else [w, float(rng.random())]
            found.append((over, [pole, 1.0]))
        else:
            at, damping = w * 10.0 ** rng.uniform(-1, 1), 10.0 ** rng.uniform(-6.0, 0.0)
            over = [[w * w], [w * w, w], [at * at, 2 * damping * at, 0.5]]
            found.append((over[rng.integers(3)], [w * w, 2 * z * w, 1.0]))
    return found


def stable_loops(seed, count, decades):
    rng = np.random.default_rng(seed)
    found: list[Any] = []
    while len(found) < count:
        loop = series(sections_of(rng, decades), float(10.0 ** rng.uniform(-4, 3)))
        margins = loop_margins(loop[0])
        if margins.stable:
            found.append((*loop, margins))
    return found


@pytest.fixture(scope="module")
def loops():
    """Stable loops with modes anywhere from 1e-4 to 1e6 rad/s."""
    return stable_loops(11, 40, (-4.0, 6.0))


def response(numerator, denominator, omega):
    over, under = (
        np.polyval([float(c) for c in reversed(p)], 1j * omega)
        for p in (numerator, denominator)
    )
    return over / under


def exact_margins(numerator, denominator):
    """Phase margin, deg, delay margin, s, and number of gain crossovers."""
    level = plus(squared(numerator), squared(denominator), -1)
    crossovers = [math.sqrt(x) for x in positive_roots(level)]
    lags = [
        float(np.angle(-response(numerator, denominator, w))) % math.tau
        for w in crossovers
    ]
    phase = min((min(lag, math.tau - lag) for lag in lags), default=math.inf)
    delays = [lag / w for lag, w in zip(lags, crossovers, strict=True)]
    return math.degrees(phase), min(delays, default=math.inf), len(crossovers)


def test_phase_and_delay_margins_are_those_of_all_crossovers(loops):
    crossed = 0
    for model, numerator, denominator, found in loops:
        phase, delay, count = exact_margins(numerator, denominator)
        assert found.phase_margin_deg == pytest.approx(phase, rel=1e-4)
        if abs(model.D[0, 0]) >= 1.0:
            delay = 0.0
        assert found.delay_margin_s == pytest.approx(delay, rel=1e-4)
        crossed += count > 1
    assert crossed == 11


def test_no_frequency_passes_the_peaks_and_one_reaches_them(loops):
    """Exactly: level^2 |D + N|^2 - |D|^2 has positive roots below M_s, none above."""
    inside = 0
    for model, numerator, denominator, found in loops:
        closed = plus(numerator, denominator)
        for over, largest in (
            (denominator, found.sensitivity_peak),
            (numerator, found.complementary_peak),
            (plus(denominator, numerator, -1), 2.0 / found.disk.alpha),
        ):

            def roots(share, over=over, largest=largest, closed=closed):
                level = Fraction(largest * share) ** 2
                scaled = [level * c for c in squared(closed)]
                return positive_roots(plus(scaled, squared(over), -1))

            assert not roots(1.0 + 1e-6)
            at_end = abs(over[-1] / closed[-1]) if len(over) == len(closed) else 0
            at_end = max(at_end, abs(over[0] / closed[0]))
            if largest > float(at_end) * (1.0 + 1e-5):
                assert roots(1.0 - 1e-5)
                inside += 1
        assert found.modulus_margin == pytest.approx(1.0 / found.sensitivity_peak)
        assert len(model.A) > 0
    assert inside == 86


def test_gain_margins_end_what_eigenvalues_call_stable(loops):
    """Poles of the closed loop with the gain times a factor."""

    def growth(model, factor):
        share = factor / (1.0 + factor * model.D[0, 0])
        poles = np.linalg.eigvals(model.A - share * model.B @ model.C)
        return float((poles.real / np.abs(poles)).max())

    ends = 0
    for model, _, _, found in loops:
        low, high = found.gain_reduction_margin, found.gain_increase_margin
        tried = np.geomspace(max(low, 1e-6), min(high, 1e6), 60)[1:-1]
        assert max(growth(model, factor) for factor in tried) < 1e-9
        for end, beyond in ((low, 1.0 - 1e-3), (high, 1.0 + 1e-3)):
            if 1e-6 < end < 1e6:
                assert growth(model, end * beyond) > 0.0
                ends += 1
    assert ends == 12


def test_sampled_margins_are_those_of_the_loop_that_the_bilinear_map_made():
    """z = (1 + s T/2)/(1 - s T/2) keeps the curve and moves its frequencies."""
    crossed, period = 0, 0.3
    for model, numerator, denominator, _ in stable_loops(12, 25, (-2.5, 2.5)):
        continuous = control.ss(model.A, model.B, model.C, model.D)
        sampled = control.c2d(continuous, period, method="tustin")
        found = loop_margins(
            replace(
                model,
                A=sampled.A,
                B=sampled.B,
                C=sampled.C,
                D=sampled.D,
                period_s=period,
            )
        )
        phase, _, count = exact_margins(numerator, denominator)
        assert found.phase_margin_deg == pytest.approx(phase, rel=1e-4)
        own = loop_margins(model)
        assert found.sensitivity_peak == pytest.approx(own.sensitivity_peak, rel=1e-4)
        assert found.complementary_peak == pytest.approx(
            own.complementary_peak, rel=1e-4
        )
        assert found.disk.alpha == pytest.approx(own.disk.alpha, rel=1e-4)
        if math.isfinite(own.crossover_rad_s):
            moved = 2.0 / period * math.atan(own.crossover_rad_s * period / 2.0)
            assert found.crossover_rad_s == pytest.approx(moved, rel=1e-6)
        crossed += count > 0
    assert crossed == 20


# --- single loops ---------------------------------------------------------------------


def light_mode(damping):
    """0.2/s + 0.002 * 100/(s^2 + 2 z 10 s + 100)."""
    under = [100.0, 20.0 * damping, 1.0]
    over = plus([Fraction(0.2) * Fraction(c) for c in under], [0, Fraction(0.2)])
    system = control.ss(
        control.tf([float(c) for c in reversed(over)], [*reversed(under), 0.0])
    )
    names = tuple(f"x{k}" for k in range(system.nstates))
    model = LinearModel(
        "L", system.A, system.B, system.C, system.D, names, ("u",), ("y",)
    )
    return model, over, product(under, [0, 1])


@pytest.mark.parametrize(
    ("damping", "phase_deg", "delay_s"), [(1e-3, 78.9, 0.138), (1e-4, 6.87, 0.0120)]
)
def test_a_light_mode_has_the_crossover_that_counts(damping, phase_deg, delay_s):
    """The integrator alone would have 90 deg and 7.9 s."""
    model, numerator, denominator = light_mode(damping)
    found = loop_margins(model)
    assert found.phase_margin_deg == pytest.approx(phase_deg, rel=2e-3)
    assert found.delay_margin_s == pytest.approx(delay_s, rel=4e-3)
    exact, delay, count = exact_margins(numerator, denominator)
    assert found.phase_margin_deg == pytest.approx(exact, rel=1e-8)
    assert found.delay_margin_s == pytest.approx(delay, rel=1e-8)
    assert count == 3
    # What a margin promises, others of the same answer must not contradict.
    chord = 2.0 * math.asin(min(1.0, found.modulus_margin / 2.0))
    assert found.phase_margin_deg >= math.degrees(chord)


@pytest.mark.parametrize(("share", "stable"), [(0.97, True), (1.2, False)])
def test_a_delay_beyond_the_margin_makes_the_closed_loop_unstable(share, stable):
    """Eigenvalues with the delay as a Pade approximation of order 8."""
    model, _, _ = light_mode(1e-3)
    loop = control.ss(model.A, model.B, model.C, model.D)
    delay = share * loop_margins(model).delay_margin_s
    late = control.ss(control.tf(*control.pade(delay, 8)))
    poles = control.feedback(loop * late, 1).poles()
    assert (poles.real.max() < 0.0) == stable


def loop_of(numerator, denominator, period=None):
    system = control.ss(control.tf(numerator, denominator))
    names = tuple(f"x{k}" for k in range(system.nstates))
    return LinearModel(
        "L", system.A, system.B, system.C, system.D, names, ("u",), ("y",), period
    )


def test_a_fast_loop_has_its_crossover():
    """1e15/(10 s^2 + 1.01e7 s + 1e11): |L| = 1 in closed form."""
    found = loop_margins(loop_of([1e15], [10.0, 1.01e7, 1e11]))
    # 100 x^2 + (1.01e7^2 - 2e12) x + 1e22 = 1e30, x = w^2
    b = 1.01e7**2 - 2.0e12
    w = math.sqrt((-b + math.sqrt(b * b - 400.0 * (1e22 - 1e30))) / 200.0)
    phase = 180.0 - math.degrees(math.atan2(1.01e7 * w, 1e11 - 10.0 * w * w))
    assert found.crossover_rad_s == pytest.approx(w, rel=1e-9)
    assert found.phase_margin_deg == pytest.approx(phase, rel=1e-7)
    assert phase == pytest.approx(5.78, abs=0.005)
    assert found.sensitivity_peak > 9.0


@pytest.mark.parametrize("corner", [1e-5, 1.0, 1e5])
def test_margins_do_not_depend_on_the_unit_of_time(corner):
    """w/(s (1 + s/w)) has 51.8 deg whatever w is."""
    found = loop_margins(loop_of([corner], [1.0 / corner, 1.0, 0.0]))
    x = math.sqrt((math.sqrt(5.0) - 1.0) / 2.0)
    assert found.phase_margin_deg == pytest.approx(90.0 - math.degrees(math.atan(x)))
    assert found.crossover_rad_s == pytest.approx(corner * x, rel=1e-9)
    assert found.complementary_peak == pytest.approx(2.0 / math.sqrt(3.0))


@pytest.mark.parametrize("states", [0, 2])
@pytest.mark.parametrize("period", [None, 0.1])
def test_a_loop_of_nothing_stands_everything(states, period):
    A, B, C = 0.5 * np.eye(states), np.ones((states, 1)), np.zeros((1, states))
    model = LinearModel(
        "L", A if period else -A, B, C, np.zeros((1, 1)), ("x",) * states, ("u",),
        ("y",), period,
    )  # fmt: skip
    found = loop_margins(model)
    assert found.stable
    assert not is_loop(model)
    assert found.gain_increase_margin == found.phase_margin_deg == math.inf
    assert found.delay_margin_s == math.inf
    assert found.gain_reduction_margin == 0.0
    assert found.sensitivity_peak == found.modulus_margin == 1.0
    assert found.complementary_peak == 0.0
    less = found.disks[0]
    assert (less.alpha, less.gain_low, less.gain_high) == (math.inf, 0.0, math.inf)
    assert less.phase_margin_deg == less.gain_margin_db == math.inf


def test_a_static_loop_has_the_margins_of_its_gain():
    one = np.ones((1, 1))
    none = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    found = loop_margins(LinearModel("L", *none, -0.5 * one, (), ("u",), ("y",)))
    assert found.gain_increase_margin == pytest.approx(2.0)
    assert found.sensitivity_peak == pytest.approx(2.0)


def test_a_loop_that_passes_all_frequencies_stands_no_delay():
    """2 + 1/(s + 1): each delay, however short, lets 2 exp(-s delay) grow."""
    found = loop_margins(loop_of([2.0, 3.0], [1.0, 1.0]))
    assert found.stable
    assert found.delay_margin_s == 0.0


def test_a_peak_at_infinity_is_found_there():
    """S of 1/(s + 1) rises to 1 without reaching it."""
    found = loop_margins(loop_of([1.0], [1.0, 1.0]))
    assert found.sensitivity_peak == pytest.approx(1.0, abs=1e-12)
    assert found.modulus_frequency_rad_s == math.inf


def test_the_norm_of_a_light_mode():
    """1/(s^2 + 2 z s + 1): 1/(2 z sqrt(1 - z^2))."""
    z = 1e-7
    found, where = peak(loop_of([1.0], [1.0, 2.0 * z, 1.0]))
    assert found == pytest.approx(1.0 / (2.0 * z), rel=1e-6)
    assert where == pytest.approx(1.0, rel=1e-9)


# --- pictures and others that look at frequencies -------------------------------------


def test_pictures_show_every_mode():
    """A grid alone does not reach the mode of 10 rad/s, nor anything beyond its end."""
    L = np.abs(frequency_response(light_mode(1e-4)[0]).L)
    assert L.max() > 9.9
    grid = frequency_grid(np.array([-1e-3 + 5e4j]), None)
    assert grid[-1] > 1e5
    assert np.abs(grid - 5e4).min() < 1e-6


def test_the_gang_of_four_has_its_peaks_in_the_picture():
    gang = gang_of_four(follow_point(Scenario(law="active")))
    L = 1.0 / gang.S - 1.0
    np.testing.assert_allclose(gang.T, L / (1.0 + L), rtol=1e-9)
    fine = np.geomspace(0.3, 3.0, 20_001)
    for size, found in gang.peaks.items():
        sampled = np.interp(fine, gang.omega, np.abs(getattr(gang, size)))
        assert found >= sampled.max()


def test_the_heading_loop_without_lag_has_its_gain_margin_at_the_last_frequency():
    """At z = -1 L is real; poles of the closed loop leave there."""
    parts = (
        MotorDriverParameters(),
        RobotParameters(preset="song2011_hearing"),
        0.0,
    )
    found = heading_loop_margins(*parts).gain_margin_db
    assert found == pytest.approx(27.916, abs=1e-3)
    model = heading_loop(*parts)
    for share, stable in ((0.999, True), (1.001, False)):
        factor = share * 10.0 ** (found / 20.0)
        poles = np.linalg.eigvals(model.A - factor * model.B @ model.C)
        assert (np.abs(poles).max() < 1.0) == stable


def test_gains_of_a_fast_loop_are_judged_by_its_own_crossover():
    """Springs that cross over above 30 rad/s, far below the ticks' frequency."""
    limits = Requirements(damping_ratio=0.02, delay_margin_s=0.0)
    fast = Scenario.model_validate(
        {
            "law": "none",
            "tick_s": 0.001,
            "microphones": {"frame_s": 0.001},
            "ultrasonic": {"period_s": 0.001},
            "integration_step_s": 0.001,
            "plant": {"motor_lag_s": 0.002},
            "attraction": {"stiffness_n_m": 8000.0, "damping_n_s_m": 300.0},
        }
    )
    choice = least_damping(fast, 8000.0, limits)
    assert choice.figures is not None
    assert choice.figures.phase_margin_deg >= limits.phase_margin_deg
    assert choice.figures.sensitivity_peak <= limits.sensitivity_peak
