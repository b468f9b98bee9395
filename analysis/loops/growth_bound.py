"""Largest growth rate of a family of loops: the worst case found, and a proven bound.

The bound is a proof by ``zero_exclusion``. It holds for polynomials of the parameters
that describe the loop up to a measured error; see ``parameter_polynomial``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.loops.linear_models import growth_per_s, s_plane
from analysis.loops.parameter_polynomial import (
    ParameterPolynomial,
    fit_polynomial,
    homogeneous,
)
from analysis.loops.zero_exclusion import Exclusion, exclude_zeros

#: Largest number of parts of the box and of the boundary in one proof.
MOST_PARTS = 20_000
#: Wanted difference between proven and found growth, as a share of the found growth.
_GAP = 1e-3
#: Smallest such difference, as a share of the magnitude of the critical pole.
_LEAST_GAP = 1e-6
#: Factor by which the difference grows if a proof fails, and the number of proofs.
_WIDER, _PROOFS = 4.0, 6
#: Number of times that a counterexample may raise the found growth.
_RAISES = 25
#: Largest angle of a pole at which the boundary has its finest steps, rad.
_WIDEST_ANGLE = 3.0

Vector = NDArray[np.float64]
MatrixFunction = Callable[[Vector], NDArray[np.float64]]


@dataclass(frozen=True)
class GrowthBound:
    """Growth rate of the worst loop of a family, from both sides."""

    found_per_s: float
    """Largest growth rate that was found, 1/s."""
    proven_per_s: float
    """Growth rate that no loop of the family exceeds, 1/s. Infinite if the limit of
    parts was reached for every bound that was tried."""
    worst: Vector
    """(p,) parameters of the worst loop that was found."""
    parts: int
    """Number of parts of the box and of the boundary in all proofs."""
    fit_error: float
    """Bound of the error of the polynomials in the parameters, as a share of the
    largest coefficient."""


class Family:
    """Loops whose matrix A depends on parameters in a box."""

    def __init__(
        self,
        matrix_of: MatrixFunction,
        period_s: float | None,
        low: Vector,
        high: Vector,
    ) -> None:
        """Fits the characteristic polynomial.

        Args:
            matrix_of: Function from (p,) parameters to the (n, n) matrix A.
            period_s: Sample period, s. None: continuous time.
            low: (p,) lower ends of the intervals of the parameters.
            high: (p,) upper ends.

        Raises:
            InputError: The matrix is not a smooth function of the parameters.
        """
        self.matrix_of, self.period_s = matrix_of, period_s
        self.low, self.high = low, high
        sizes = np.abs(self._rates(0.5 * (low + high)))
        self._scale = float(np.exp(np.log(np.maximum(sizes, 1e-9)).mean()))

    def _rates(self, values: Vector) -> NDArray[np.complex128]:
        """(n,) values of (z - 1)/T for sampled poles z, or poles s, 1/s."""
        poles = np.linalg.eigvals(self.matrix_of(values)).astype(np.complex128)
        return np.asarray((poles - 1.0) / self.period_s) if self.period_s else poles

    @cached_property
    def polynomial(self) -> ParameterPolynomial:
        """Characteristic polynomial of (A - I)/T or of A, with scaled roots."""

        def coefficients(values: Vector) -> Vector:
            return np.real(np.poly(self._rates(values) / self._scale))

        return fit_polynomial(coefficients, self.low, self.high)

    def growth_at(self, shares: Vector) -> tuple[float, complex]:
        """Largest growth rate at a point of the box, 1/s, and its pole in the s plane.

        The poles are those of the fitted polynomial.
        """
        roots = np.roots(self.polynomial.values(shares)).astype(np.complex128)
        return self._largest(np.asarray(roots * self._scale))

    def _largest(self, rates: NDArray[np.complex128]) -> tuple[float, complex]:
        if not self.period_s:
            pole = complex(rates[np.argmax(rates.real)])
            return pole.real, pole
        z = 1.0 + rates * self.period_s
        z = z[[np.argmax(np.abs(z))]]
        found = s_plane(z, self.period_s)
        growth = float(growth_per_s(np.abs(z[0]), self.period_s))
        return growth, complex(found[0]) if len(found) else complex(growth)

    def exact_growth(self, values: Vector) -> float:
        """Largest growth rate with given parameters, from the matrix itself, 1/s."""
        return self._largest(self._rates(values))[0]

    def exclude(self, growth: float, near: float, most_parts: int) -> Exclusion:
        """Tries to prove that no loop grows faster.

        Args:
            growth: Bound of the growth rate, 1/s. At least one loop must be below it.
            near: Frequency at which the boundary has its finest steps, rad/s.
            most_parts: Largest number of parts.

        Returns:
            The result of ``exclude_zeros``.
        """
        order = self.polynomial.control.shape[-1] - 1
        numerator, denominator = self._boundary(growth, near)
        return exclude_zeros(
            self.polynomial.control,
            self.polynomial.error,
            homogeneous(numerator, denominator, order),
            lambda shares: self.growth_at(shares)[0] > growth,
            most_parts,
        )

    def _boundary(
        self, growth: float, near: float
    ) -> tuple[tuple[complex, complex], tuple[complex, complex]]:
        """Upper half of the line Re s = growth, or of the circle |z| = exp(growth T).

        With x from 0 to 1, s = growth + 1j near x/(1 - x), and z = exp(growth T) (1 +
        1j t x/(1 - x))/(1 - 1j t x/(1 - x)), with t = tan(near T/2).
        """
        T, scale = self.period_s, self._scale
        if not T:
            return (growth / scale, 1j * near / scale), (1.0, 0.0)
        t = 1j * math.tan(0.5 * min(near * T, _WIDEST_ANGLE))
        radius, more = math.exp(growth * T), math.expm1(growth * T)
        return (more / T / scale, (radius + 1.0) * t / T / scale), (1.0, -t)

    def worst_corner(self, shares: Vector) -> tuple[float, Vector]:
        """Moves one parameter at a time to an end of its interval, as long as it helps.

        Args:
            shares: (p,) point at which the search begins.

        Returns:
            The growth rate found, 1/s, and its point.
        """
        best, place = self.growth_at(shares)[0], shares
        improved = True
        while improved:
            improved = False
            for k in range(len(shares)):
                for end in (0.0, 1.0):
                    trial = place.copy()
                    trial[k] = end
                    if (value := self.growth_at(trial)[0]) > best + 1e-12:
                        best, place, improved = value, trial, True
        return best, place

    def climb(self, shares: Vector) -> tuple[float, Vector]:
        """Searches for the largest growth rate, 1/s, from a point of the box.

        The search of ``worst_corner`` is followed by that of Nelder and Mead.
        """
        from scipy.optimize import minimize

        best, place = self.worst_corner(shares)
        found = minimize(
            lambda x: -self.growth_at(np.clip(x, 0.0, 1.0))[0],
            place,
            method="Nelder-Mead",
            options={"xatol": 1e-6, "fatol": 1e-10, "maxiter": 80 * len(shares)},
        )
        if -found.fun > best:
            return float(-found.fun), np.clip(found.x, 0.0, 1.0)
        return best, place


def bound_growth(family: Family, most_parts: int = MOST_PARTS) -> GrowthBound:
    """Bounds the largest growth rate of a family of loops from both sides.

    Args:
        family: The loops.
        most_parts: Largest number of parts in one proof.

    Returns:
        Growth rates found and proven. They differ by about 0.1 % if the first proof
        succeeds within ``most_parts``.
    """
    polynomial = family.polynomial
    found, place = family.climb(np.full(len(family.low), 0.5))
    proven, parts, gap, proofs, raises = math.inf, 0, _GAP, 0, 0
    while proofs < _PROOFS and raises < _RAISES:
        pole = family.growth_at(place)[1]
        target = found + max(gap * abs(found), _LEAST_GAP * abs(pole))
        result = family.exclude(target, abs(pole.imag) or abs(pole), most_parts)
        parts += result.parts
        if result.outcome == "excluded":
            proven = target
            break
        if result.shares is not None:
            found, place = family.climb(result.shares)
            raises += 1
        else:
            gap *= _WIDER
            proofs += 1
    worst = polynomial.point(place)
    sizes = np.abs(polynomial.control).reshape(-1, polynomial.control.shape[-1])
    return GrowthBound(
        family.exact_growth(worst),
        proven,
        worst,
        parts,
        float(polynomial.error.max() / sizes.max()),
    )
