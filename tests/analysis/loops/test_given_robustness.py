"""Proven and found worst cases, against closed forms and brute force."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest

import phonotaxis
from analysis.loops.parameter_polynomial import fit_polynomial, halves, homogeneous
from systems.framework.input_error import InputError


def oscillator(values):
    """M s^2 + D s + K."""
    M, D, K = values["M"], values["D"], values["K"]
    return np.array([[0.0, 1.0], [-K / M, -D / M]])


BOX = {"M": (2.0, 4.0), "D": (0.5, 1.5), "K": (1.0, 3.0)}


@pytest.mark.parametrize("kind", ["matrix", "state space", "sampled"])
def test_the_worst_oscillator_is_the_closed_form(kind):
    # With 4 K M > D^2, the growth rate is -D / (2 M); sampling does not change it.
    def model_of(values):
        if kind == "matrix":
            return oscillator(values)
        whole = control.ss(oscillator(values), [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
        return whole.sample(0.05) if kind == "sampled" else whole

    found = phonotaxis.robustness(model_of, BOX)
    assert found.growth_per_s == pytest.approx(-0.5 / 8.0, rel=1e-9)
    assert found.growth_per_s < found.proven_growth_per_s < 0.0
    assert found.gap < 0.002
    assert found.verdict == "stable"
    assert found.worst_values["D"] == 0.5
    assert found.worst_values["M"] == pytest.approx(4.0)
    # D reaches 0 where the box is twice as large; the search ends before, at 1.9.
    assert found.scale_proven == found.scale_largest == pytest.approx(1.9)
    assert math.isinf(found.scale_unstable)


@pytest.mark.parametrize("period", [None, 0.5])
def test_random_families_are_not_worse_than_proven(period):
    rng = np.random.default_rng(3)
    for n in (3, 7):
        A = rng.normal(size=(n, n))
        A -= np.eye(n) * (np.linalg.eigvals(A).real.max() + 0.3)
        if period:
            A = np.eye(n) + 0.05 * A
        steps = rng.normal(size=(3, n, n)) * (0.004 if period else 0.08)

        def matrix(values, A=A, steps=steps):
            # Two parameters are multiplied with each other.
            a, b, c = (values[name] for name in "abc")
            return A + a * steps[0] + b * steps[1] + c * b * steps[2]

        box = dict.fromkeys("abc", (-1.0, 1.0))
        found = phonotaxis.robustness(matrix, box, period_s=period)
        points = rng.uniform(-1.0, 1.0, (400, 3))
        poles = [
            np.linalg.eigvals(matrix(dict(zip("abc", row, strict=True))))
            for row in points
        ]
        sampled = max(
            np.log(np.abs(z).max()) / period if period else z.real.max() for z in poles
        )
        assert sampled <= found.growth_per_s + 1e-9
        assert found.growth_per_s <= found.proven_growth_per_s
        assert found.gap < 0.005


def test_a_marginal_family_is_undecided():
    # At q = 0, both poles are on the imaginary axis; everywhere else they decay.
    found = phonotaxis.robustness(
        lambda v: [[0.0, 1.0], [-1.0, -(v["q"] ** 2)]], {"q": (-1.0, 1.0)}
    )
    assert found.verdict == "undecided"
    assert found.growth_per_s <= 1e-9 < found.proven_growth_per_s < 1e-4
    assert "undecided" in str(found)


def test_too_few_parts_prove_nothing_and_say_so():
    found = phonotaxis.robustness(oscillator, BOX, most_parts=0)
    assert math.isinf(found.proven_growth_per_s)
    assert found.verdict == "undecided"


def test_an_unstable_point_inside_is_found():
    # Unstable only for |q - 0.3| < 0.01, where all corners and the middle are stable.
    def matrix(values):
        return [[(0.01**2 - (values["q"] - 0.3) ** 2)]]

    found = phonotaxis.robustness(matrix, {"q": (-1.0, 1.0)})
    assert found.verdict == "unstable"
    assert found.growth_per_s == pytest.approx(1e-4, rel=1e-6)
    assert found.worst_values["q"] == pytest.approx(0.3, abs=1e-3)
    assert found.scale_proven <= 0.29 <= found.scale_unstable


@pytest.mark.parametrize(
    ("model", "box", "message"),
    [
        (oscillator, {}, r"box: is empty; name a parameter"),
        (oscillator, BOX | {"K": (3.0, 1.0)}, r"box\['K'\]: .* in order"),
        (lambda v: [[1.0, 2.0]], {"q": (0.0, 1.0)}, r"shape \(1, 2\); return a square"),
        (lambda v: "loop", {"q": (0.0, 1.0)}, r"is a str; give a control\."),
        (lambda v: [[abs(v["q"]) - 2.0]], {"q": (-1.0, 1.0)}, r"not smooth enough"),
        (
            lambda v: -np.eye(1 + (v["q"] > 0.5)),
            {"q": (0.0, 1.0)},
            r"number of states or the period depends",
        ),
    ],
)
def test_wrong_families_are_refused(model, box, message):
    with pytest.raises(InputError, match=message):
        phonotaxis.robustness(model, box)


def test_degrees_and_reciprocals_are_found():
    def values(q):
        return np.array([1.0, q[0] * q[1] / q[2], q[1] ** 3 + 1.0 / q[2], 0.0])

    low, high = np.array([-1.0, 0.5, 0.2]), np.array([2.0, 1.5, 3.0])
    found = fit_polynomial(values, low, high)
    assert [axis.degree for axis in found.axes] == [1, 3, 1]
    assert [axis.reciprocal for axis in found.axes] == [False, False, True]
    shares = np.array([0.2, 0.7, 0.4])
    expected = values(found.point(shares))
    np.testing.assert_allclose(found.values(shares), expected, atol=1e-13)
    assert (found.error < 1e-11).all()


def test_halves_and_products_of_bernstein_polynomials():
    rng = np.random.default_rng(1)
    coefficients = rng.normal(size=5)

    def value(control_points, x):
        k = np.arange(len(control_points))
        n = len(k) - 1
        terms = [math.comb(n, int(j)) * x**j * (1 - x) ** (n - j) for j in k]
        return control_points @ np.array(terms)

    for x in (0.1, 0.6):
        left, right = (half @ coefficients for half in halves(4))
        assert value(left, x) == pytest.approx(value(coefficients, x / 2))
        assert value(right, x) == pytest.approx(value(coefficients, 0.5 + x / 2))
        # p(N/D) D^4 with N = 2 + x (1j - 3), D = 1 - x/2.
        N, D = 2.0 + x * (1j - 3.0), 1.0 - 0.5 * x
        moved = homogeneous((2.0, 1j - 1.0), (1.0, 0.5), 4) @ coefficients
        assert value(moved, x) == pytest.approx(np.polyval(coefficients, N / D) * D**4)
