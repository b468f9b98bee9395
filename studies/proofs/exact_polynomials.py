"""Polynomials and quadratic forms in rational arithmetic.

The module checks sums of squares without trusting a solver or rounded arithmetic. A
float is a rational number, and sums and products of rational numbers are exact.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

#: Exponents of the variables in a monomial.
Exponents = tuple[int, ...]


class Polynomial:
    """A polynomial with rational coefficients.

    Args:
        terms: Coefficients by exponents of the variables. Floats keep their exact
            value.
    """

    def __init__(self, terms: dict[Exponents, Fraction | float | int]) -> None:
        fractions = {m: Fraction(c) for m, c in terms.items()}
        self.terms = {m: c for m, c in fractions.items() if c != 0}

    def __add__(self, other: Polynomial) -> Polynomial:
        keys = self.terms.keys() | other.terms.keys()
        zero = Fraction(0)
        return Polynomial(
            {m: self.terms.get(m, zero) + other.terms.get(m, zero) for m in keys}
        )

    def __neg__(self) -> Polynomial:
        return Polynomial({m: -c for m, c in self.terms.items()})

    def __sub__(self, other: Polynomial) -> Polynomial:
        return self + (-other)

    def __mul__(self, other: Polynomial) -> Polynomial:
        out: dict[Exponents, Fraction | float | int] = {}
        for m, c in self.terms.items():
            for n, d in other.terms.items():
                key = tuple(a + b for a, b in zip(m, n, strict=True))
                out[key] = out.get(key, Fraction(0)) + c * d
        return Polynomial(out)

    def derivative(self, variable: int) -> Polynomial:
        """Derivative with respect to a variable, counted from 0."""
        out: dict[Exponents, Fraction | float | int] = {}
        for m, c in self.terms.items():
            if m[variable]:
                lowered = (*m[:variable], m[variable] - 1, *m[variable + 1 :])
                out[lowered] = c * m[variable]
        return Polynomial(out)

    def __call__(self, point: Sequence[float]) -> float:
        """Value at a point, in floating point."""
        total = 0.0
        for m, c in self.terms.items():
            product = float(c)
            for x, k in zip(point, m, strict=True):
                product *= x**k
            total += product
        return total


def gram_polynomial(
    basis: Sequence[Exponents], gram: Sequence[Sequence[Fraction]]
) -> Polynomial:
    """Computes the polynomial z' G z for monomials z and a matrix G.

    Args:
        basis: The k monomials z, as exponents of the variables.
        gram: The matrix G, as k rows of k rational numbers.

    Returns:
        The polynomial, with rational coefficients.
    """
    out: dict[Exponents, Fraction | float | int] = {}
    for i, m in enumerate(basis):
        for j, n in enumerate(basis):
            key = tuple(a + b for a, b in zip(m, n, strict=True))
            out[key] = out.get(key, Fraction(0)) + gram[i][j]
    return Polynomial(out)


def match_gram(
    target: Polynomial, basis: Sequence[Exponents], gram: Iterable[Iterable[float]]
) -> list[list[Fraction]] | None:
    """Corrects a Gram matrix G so that z' G z equals a target exactly.

    The error of each coefficient is spread evenly over the entries of G that contribute
    to the coefficient.

    Args:
        target: The polynomial to represent.
        basis: The k monomials z, as exponents of the variables.
        gram: Approximate G, as k rows of k floats. Only the symmetric part counts.

    Returns:
        Rows of the corrected symmetric matrix. None if the basis cannot represent the
        target.
    """
    rows = [[Fraction(value) for value in row] for row in gram]
    size = len(basis)
    rows = [[(rows[i][j] + rows[j][i]) / 2 for j in range(size)] for i in range(size)]
    places: dict[Exponents, list[tuple[int, int]]] = {}
    for i in range(size):
        for j in range(size):
            key = tuple(a + b for a, b in zip(basis[i], basis[j], strict=True))
            places.setdefault(key, []).append((i, j))
    missing = target - gram_polynomial(basis, rows)
    for monomial, value in missing.terms.items():
        if monomial not in places:
            return None
        share = value / len(places[monomial])
        for i, j in places[monomial]:
            rows[i][j] += share
    return rows


def is_positive_definite(rows: Sequence[Sequence[Fraction]]) -> bool:
    """Whether a symmetric rational matrix is positive definite, by elimination."""
    work = [list(row) for row in rows]
    size = len(work)
    for k in range(size):
        pivot = work[k][k]
        if pivot <= 0:
            return False
        for i in range(k + 1, size):
            factor = work[i][k] / pivot
            for j in range(k + 1, size):
                work[i][j] -= factor * work[k][j]
    return True
