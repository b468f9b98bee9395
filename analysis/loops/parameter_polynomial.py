"""Polynomials in several parameters over a box, in Bernstein form.

The coefficients of a characteristic polynomial are smooth functions of the parameters.
This module replaces them by polynomials of the parameters or of their reciprocals, and
measures the error. In Bernstein form, the values of a polynomial over the box lie in
the convex hull of its coefficients (Garloff 1993).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, reduce

import numpy as np
from numpy.typing import NDArray

from systems.framework.input_error import InputError

#: Numbers of Chebyshev nodes on which the degree of one parameter is determined, and
#: the share of the size below which the last coefficients are rounding errors. Few
#: nodes suffice for low degrees. Many nodes permit the larger errors of stiff loops.
_SLICES = ((8, 1e-11), (26, 1e-6))
#: Largest number of coefficients of one polynomial.
_MOST_COEFFICIENTS = 20_000
#: Chebyshev coefficients below this share of the largest one are left out.
_NEGLIGIBLE = 1e-11
#: Number of the last Chebyshev coefficients, which show the size of rounding errors,
#: and the ratio below which another coefficient counts as such an error.
_TAIL, _TAIL_RATIO = 4, 10.0
#: Share of the largest size below which a size is that of rounding errors.
_SMALL = 1e-2
#: Number of random points at which the error is measured.
_CHECKS = 40
#: Assumed ratio of the largest error in the box and the largest measured error.
_SAFETY = 10.0
#: Share of the size of a coefficient that covers rounding errors.
_ROUNDING = 1e-13

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Axis:
    """One parameter of the polynomial."""

    low: float
    high: float
    reciprocal: bool
    """Whether the polynomial is one of the parameter's reciprocal."""
    degree: int

    def value(self, share: float) -> float:
        """Converts a position in the interval, 0 to 1, to a value of the parameter."""
        if not self.reciprocal:
            return self.low + share * (self.high - self.low)
        start, end = 1.0 / self.low, 1.0 / self.high
        return 1.0 / (start + share * (end - start))

    def share(self, value: float) -> float:
        """Converts a value of the parameter to its position in the interval."""
        if not self.reciprocal:
            return (value - self.low) / (self.high - self.low)
        start, end = 1.0 / self.low, 1.0 / self.high
        return (1.0 / value - start) / (end - start)


@dataclass(frozen=True)
class ParameterPolynomial:
    """Coefficients of a characteristic polynomial as polynomials of parameters."""

    axes: tuple[Axis, ...]
    control: NDArray[np.float64]
    """(d_1 + 1, ..., d_p + 1, n) Bernstein coefficients of the n values."""
    error: Vector
    """(n,) bound of the error of each value: ten times the largest error at random
    points, and rounding errors."""

    def values(self, shares: Vector) -> Vector:
        """(n,) values at a point of the box, given as (p,) shares from 0 to 1."""
        found = self.control
        for share, axis in zip(shares, self.axes, strict=True):
            found = np.tensordot(_bernstein(axis.degree, float(share)), found, (0, 0))
        return np.asarray(found)

    def point(self, shares: Vector) -> Vector:
        """(p,) values of the parameters at a point of the box."""
        pairs = zip(self.axes, shares, strict=True)
        return np.array([axis.value(float(share)) for axis, share in pairs])


def fit_polynomial(
    function: Callable[[Vector], Vector], low: Vector, high: Vector
) -> ParameterPolynomial:
    """Fits polynomials to the values of a smooth function over a box.

    Args:
        function: Function from (p,) parameters to (n,) values.
        low: (p,) lower ends of the intervals.
        high: (p,) upper ends, above ``low``.

    Returns:
        The polynomial. It is exact up to rounding errors if the values are polynomials
        of each parameter, or of its reciprocal, with degrees up to 20.

    Raises:
        InputError: A parameter needs a degree above 21, or the product of the degrees
            is too large.
    """
    rng = np.random.default_rng(0)
    inner = [low + rng.uniform(0.2, 0.8, len(low)) * (high - low) for _ in range(2)]
    axes = tuple(
        _axis(function, inner, k, float(low[k]), float(high[k]))
        for k in range(len(low))
    )
    shape = tuple(axis.degree + 1 for axis in axes)
    if math.prod(shape) > _MOST_COEFFICIENTS:
        raise InputError(
            "box",
            f"the matrix depends on the parameters with degrees "
            f"{[axis.degree for axis in axes]}, which are too many; vary fewer "
            "parameters, or narrower intervals",
        )
    nodes = [[axis.value(share) for share in _nodes(axis.degree)] for axis in axes]
    grid = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1)
    values = np.array([function(row) for row in grid.reshape(-1, len(axes))])
    control = values.reshape(*shape, -1)
    for k, axis in enumerate(axes):
        control = _along(control, k, _from_nodes(axis.degree))
    fitted = ParameterPolynomial(axes, control, np.zeros(control.shape[-1]))
    shares = rng.uniform(size=(_CHECKS, len(axes)))
    missed = [np.abs(fitted.values(u) - function(fitted.point(u))) for u in shares]
    sizes = np.abs(control).reshape(-1, control.shape[-1]).max(axis=0)
    error = _SAFETY * np.max(missed, axis=0) + _ROUNDING * sizes
    return ParameterPolynomial(axes, control, error)


def _axis(
    function: Callable[[Vector], Vector],
    points: list[Vector],
    k: int,
    low: float,
    high: float,
) -> Axis:
    """Chooses the parameter or its reciprocal, whichever needs the lower degree."""
    kinds = (False, True) if low * high > 0.0 else (False,)
    for (count, noise), places in zip(_SLICES, (points, points[:1]), strict=True):
        best = None
        for reciprocal in kinds:
            whole = Axis(low, high, reciprocal, count - 1)
            slices = [_slice(function, place, k, whole) for place in places]
            needed = [_needed_degree(values, noise) for values in slices]
            known = [degree for degree in needed if degree is not None]
            if len(known) < len(needed):
                continue
            degree = max(known)
            if best is None or degree < best.degree:
                best = Axis(low, high, reciprocal, degree)
            if degree <= 1:
                break
        if best is not None:
            return best
    raise InputError(
        "box",
        f"the matrix is not smooth enough over [{low:g}, {high:g}]; narrow this "
        "interval, or divide it",
    )


def _slice(
    function: Callable[[Vector], Vector], point: Vector, k: int, axis: Axis
) -> NDArray[np.float64]:
    """(nodes, n) values while parameter k varies, and the others stay at a point."""
    rows = []
    for share in _nodes(axis.degree):
        moved = point.copy()
        moved[k] = axis.value(share)
        rows.append(function(moved))
    return np.array(rows)


def _needed_degree(values: NDArray[np.float64], noise: float) -> int | None:
    """Least degree of polynomials through values at Chebyshev nodes, up to rounding.

    None means that the last coefficients are above the share ``noise`` of the size, so
    that the values need a higher degree than the nodes show.
    """
    count = len(values)
    coefficients = np.abs(_to_chebyshev(count) @ values)
    sizes = coefficients.max(axis=0)
    tail = coefficients[-_TAIL:].max(axis=0)
    if (tail > noise * np.maximum(sizes, _SMALL * sizes.max())).any():
        return None
    least = np.maximum(_NEGLIGIBLE * sizes, _TAIL_RATIO * tail)
    kept = (coefficients > least).any(axis=1)
    return int(np.flatnonzero(kept).max(initial=0))


@lru_cache(maxsize=4)
def _to_chebyshev(count: int) -> NDArray[np.float64]:
    places = 2.0 * _nodes(count - 1) - 1.0
    inverse = np.linalg.inv(np.polynomial.chebyshev.chebvander(places, count - 1))
    return np.asarray(inverse, dtype=float)


@lru_cache(maxsize=64)
def _nodes(degree: int) -> Vector:
    """(degree + 1,) Chebyshev nodes in the interval from 0 to 1."""
    count = degree + 1
    return 0.5 - 0.5 * np.cos(np.pi * (np.arange(count) + 0.5) / count)


def _bernstein(degree: int, share: float) -> Vector:
    """(degree + 1,) values of the Bernstein polynomials."""
    k = np.arange(degree + 1)
    weights = np.array([math.comb(degree, int(each)) for each in k], dtype=float)
    return np.asarray(weights * share**k * (1.0 - share) ** (degree - k))


@lru_cache(maxsize=64)
def _from_nodes(degree: int) -> NDArray[np.float64]:
    rows = [_bernstein(degree, float(share)) for share in _nodes(degree)]
    return np.linalg.inv(np.array(rows))


def _along(
    tensor: NDArray[np.float64], axis: int, matrix: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.moveaxis(np.tensordot(matrix, tensor, (1, axis)), 0, axis)


@lru_cache(maxsize=64)
def halves(degree: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the matrices from Bernstein coefficients to those of the two halves.

    Both are (degree + 1, degree + 1). Their elements are not negative, and their rows
    have the sum 1 (de Casteljau).
    """
    left = np.array(
        [
            [math.comb(j, k) / 2.0**j if k <= j else 0.0 for k in range(degree + 1)]
            for j in range(degree + 1)
        ]
    )
    return left, left[::-1, ::-1].copy()


def homogeneous(
    numerator: tuple[complex, complex], denominator: tuple[complex, complex], order: int
) -> NDArray[np.complex128]:
    """Returns the matrix from the coefficients of p to Bernstein coefficients.

    Let s = N/D, with N and D polynomials of degree 1 in x. For p of degree ``order``,
    D^order p(s) is a polynomial of x.

    Args:
        numerator: N at x = 0 and at x = 1.
        denominator: D at x = 0 and at x = 1.
        order: Degree of p.

    Returns:
        (order + 1, order + 1) matrix. Its columns belong to the coefficients of p,
        highest power first.
    """
    scale = np.array([math.comb(order, k) for k in range(order + 1)], dtype=float)
    columns = []
    for power in range(order, -1, -1):
        factors = [numerator] * power + [denominator] * (order - power)
        # In the scaled Bernstein basis, a product is a convolution.
        product = reduce(np.convolve, factors, np.ones(1, dtype=complex))
        columns.append(product / scale)
    return np.array(columns).T
