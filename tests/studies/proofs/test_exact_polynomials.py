"""Rational polynomials and forms, against numpy."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, strategies as st

from studies.proofs.exact_polynomials import (
    Polynomial,
    gram_polynomial,
    is_positive_definite,
    match_gram,
)

BASIS = [(1, 0), (0, 1), (1, 1), (2, 0)]
number = st.floats(-3.0, 3.0)
polynomials = st.dictionaries(
    st.tuples(st.integers(0, 3), st.integers(0, 3)), number, max_size=6
).map(lambda terms: Polynomial(cast(Any, terms)))
points = st.tuples(number, number)


@given(polynomials, polynomials, points)
def test_sums_and_products_of_values(p, q, point):
    assert (p + q)(point) == pytest.approx(p(point) + q(point), abs=1e-6)
    assert (p - q)(point) == pytest.approx(p(point) - q(point), abs=1e-6)
    scale = 1.0 + abs(p(point)) * abs(q(point))
    assert abs((p * q)(point) - p(point) * q(point)) < 1e-6 * scale * 1e3


@given(polynomials, polynomials)
def test_derivative_of_a_product(p, q):
    for k in (0, 1):
        left = (p * q).derivative(k)
        right = p.derivative(k) * q + p * q.derivative(k)
        assert left.terms == right.terms


def test_tenths_are_the_floats_that_they_are():
    assert Polynomial({(1,): 0.1}).terms[(1,)] == Fraction(0.1) != Fraction(1, 10)


@given(st.integers(0, 10_000))
def test_definiteness_is_that_of_the_eigenvalues(seed):
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((4, 4))
    matrix = matrix + matrix.T + rng.uniform(0.0, 6.0) * np.eye(4)
    rows = [[Fraction(float(v)) for v in row] for row in matrix]
    assert is_positive_definite(rows) == bool(np.linalg.eigvalsh(matrix).min() > 0.0)


def test_a_singular_form_is_not_definite():
    one = Fraction(1)
    assert not is_positive_definite([[one, one], [one, one]])


def test_a_gram_matrix_is_moved_onto_its_polynomial():
    rng = np.random.default_rng(4)
    gram = rng.standard_normal((4, 4))
    gram = gram @ gram.T
    target = gram_polynomial(BASIS, [[Fraction(float(v)) for v in row] for row in gram])
    rough = match_gram(target, BASIS, gram + 1e-3 * rng.standard_normal((4, 4)))
    assert rough is not None
    assert gram_polynomial(BASIS, rough).terms == target.terms
    assert np.allclose(np.array(rough, dtype=float), gram, atol=5e-3)


def test_a_polynomial_outside_of_the_basis_has_no_gram_matrix():
    assert match_gram(Polynomial({(0, 0): 1}), BASIS, np.eye(4)) is None
