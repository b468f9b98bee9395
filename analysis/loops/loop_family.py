"""Loop transfer functions L = n/a whose coefficients depend on parameters in a box."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import loop_margins
from analysis.loops.parameter_polynomial import (
    ParameterPolynomial,
    fit_polynomial,
    homogeneous,
)
from analysis.loops.zero_exclusion import Exclusion, exclude_zeros

#: Number of frequencies of the grid, and its ends as shares of the first crossover.
_POINTS, _LOWEST, _HIGHEST = 400, 1e-3, 1e3
#: Number of steps by which a gain crossover, or the frequency of a disk margin, is
#: refined, and number of frequencies in such a step.
_STEPS, _FINER = 4, 9
#: Rates below this share of the largest one count as integrators.
_INTEGRATOR = 1e-6
#: Longest arc of the circle of phases that is one axis of a proof, rad.
_ARC = math.tau / 3.0
#: Largest angle of a pole at which the boundary has its finest steps, rad.
_WIDEST_ANGLE = 3.0

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Sum(NamedTuple):
    """Polynomials U and V of the sum U + exp(j phase) V, as numbers or over a box."""

    U: Vector
    """(..., n + 1) coefficients, highest power first."""
    V: Vector
    """(..., n + 1) coefficients."""
    error: Vector
    """(n + 1,) bound of the sum of the errors of both."""


class LoopFamily:
    """Loops with one input and one output, with matrices that depend on parameters."""

    def __init__(
        self, model_of: Callable[[Vector], LinearModel], low: Vector, high: Vector
    ) -> None:
        """Fits the coefficients of L.

        Args:
            model_of: Function from (p,) parameters to the loop transfer function L.
            low: (p,) lower ends of the intervals of the parameters.
            high: (p,) upper ends.

        Raises:
            InputError: L is not a smooth function of the parameters.
        """
        self.model_of, self.low, self.high = model_of, low, high
        middle = model_of(0.5 * (low + high))
        self.period_s = middle.period_s
        sizes = np.abs(np.concatenate([self._rates(each) for each in _both(middle)]))
        sizes = sizes[sizes > _INTEGRATOR * sizes.max()]
        self._scale = float(np.exp(np.log(sizes).mean()))
        #: Frequency at which the boundary has its finest steps, rad/s.
        self.near = loop_margins(middle).crossover_rad_s
        if not self.near > 0.0:
            self.near = float(sizes.max())

    def _rates(self, A: NDArray[np.float64]) -> Complex:
        """(n,) values of (z - 1)/T for sampled poles z, or poles s, 1/s."""
        poles = np.linalg.eigvals(A).astype(np.complex128)
        return np.asarray((poles - 1.0) / self.period_s) if self.period_s else poles

    @cached_property
    def polynomial(self) -> ParameterPolynomial:
        """Coefficients of a and of n, of scaled rates."""

        def coefficients(values: Vector) -> Vector:
            model = self.model_of(values)
            a, closed = (
                np.real(np.poly(self._rates(each) / self._scale))
                for each in _both(model)
            )
            # a + n is the characteristic polynomial of the closed loop.
            return np.concatenate([a, (1.0 + model.D[0, 0]) * closed - a])

        return fit_polynomial(coefficients, self.low, self.high)

    @property
    def fit_error(self) -> float:
        """Bound of the error of the polynomials, as a share of the largest value."""
        sizes = np.abs(self.polynomial.control).max()
        return float(self.polynomial.error.max() / sizes)

    def delayed(self, values: Vector | None = None) -> Sum:
        """Sum that is zero if L exp(j phase) = -1; over the box, or with values."""
        a, n = self._split(self.polynomial.control if values is None else values)
        errors = self._split(self.polynomial.error)
        return Sum(a, n, errors[0] + errors[1])

    def disturbed(
        self, skew: float, size: float = 1.0, values: Vector | None = None
    ) -> Sum:
        """Sum that is zero if the factor of a disk of this size gives L f = -1.

        The factor f is that of ``DiskMargin`` with d = size exp(j phase).
        """
        a, n = self._split(self.polynomial.control if values is None else values)
        errors = self._split(self.polynomial.error)
        less, more = 0.5 * size * (1.0 - skew), 0.5 * size * (1.0 + skew)
        error = (1.0 + more) * errors[0] + (1.0 + less) * errors[1]
        return Sum(a + n, less * n - more * a, error)

    @staticmethod
    def _split(values: Vector) -> tuple[Vector, Vector]:
        count = values.shape[-1] // 2
        return values[..., :count], values[..., count:]

    def frequency(self, share: float) -> float:
        """Frequency at a position of the boundary from 0 to 1, rad/s."""
        if share >= 1.0:
            return math.pi / self.period_s if self.period_s else math.inf
        ratio = share / (1.0 - share)
        if not self.period_s:
            return self.near * ratio
        return 2.0 / self.period_s * math.atan(self._tangent * ratio)

    @property
    def _tangent(self) -> float:
        return math.tan(0.5 * min(self.near * (self.period_s or 0.0), _WIDEST_ANGLE))

    def _boundary(self, shares: tuple[float, float], order: int) -> Complex:
        """Matrix to Bernstein coefficients along a part of the border of stability."""
        T, scale = self.period_s, self._scale
        # The scaled rate is N/D, with N and D of degree 1 in the position.
        ends = [(0.0, 1j * self.near / scale), (1.0, 0.0)]
        if T:
            t = 1j * self._tangent
            ends = [(0.0, 2.0 * t / T / scale), (1.0, -t)]
        (n0, n1), (d0, d1) = ends
        N, D = (
            (a + shares[0] * (b - a), a + shares[1] * (b - a))
            for a, b in ((n0, n1), (d0, d1))
        )
        return homogeneous(N, D, order)

    def exclude(
        self,
        of: Sum,
        phases: tuple[float, float],
        violates: Callable[[Vector], bool],
        most_parts: int,
        *,
        shares: tuple[float, float] = (0.0, 1.0),
    ) -> Exclusion:
        """Tries to prove that a sum is zero nowhere in the box.

        The phase is one more parameter: exp(j phase) is a ratio of two polynomials of
        degree 1, by the tangent of half the angle.

        Args:
            of: Sum over the box.
            phases: Phases, rad, from first to last.
            violates: Whether a point of the box, as (p,) shares, is a counterexample.
            most_parts: Largest number of parts.
            shares: Part of the border of stability, from 0 to 1.

        Returns:
            The result of ``exclude_zeros``.
        """
        boundary = self._boundary(shares, of.U.shape[-1] - 1)
        count = max(1, math.ceil((phases[1] - phases[0]) / _ARC - 1e-9))
        width, parts = (phases[1] - phases[0]) / count, 0
        for k in range(count):
            turn = np.exp(1j * (phases[0] + (k + 0.5) * width))
            side = 1.0 + 1j * math.tan(0.25 * width)
            back = np.conj(side)
            both = [side * of.U + turn * back * of.V, back * of.U + turn * side * of.V]
            result = exclude_zeros(
                np.stack(both, axis=-2),
                abs(side) * of.error,
                boundary,
                lambda place: violates(place[:-1]),
                most_parts - parts,
            )
            parts += result.parts
            if result.outcome != "excluded":
                place = None if result.shares is None else result.shares[:-1]
                return Exclusion(result.outcome, parts, place)
        return Exclusion("excluded", parts)

    @cached_property
    def grid(self) -> Vector:
        """(k,) ascending frequencies, rad/s, below the Nyquist frequency."""
        top = _HIGHEST * self.near
        if self.period_s:
            top = min(top, math.pi / self.period_s)
        return np.geomspace(_LOWEST * self.near, top, _POINTS)

    def powers(self, omega: Vector, order: int) -> Complex:
        """(k, n + 1) powers of the scaled rate at frequencies, rad/s."""
        s = 1j * omega
        if self.period_s:
            s = (np.exp(s * self.period_s) - 1.0) / self.period_s
        return np.vander(np.asarray(s / self._scale, dtype=np.complex128), order + 1)

    @cached_property
    def _grid_powers(self) -> Complex:
        return self.powers(self.grid, self.polynomial.control.shape[-1] // 2 - 1)

    def disk_at(self, shares: Vector, skew: float) -> float:
        """Disk margin at a point of the box where the closed loop is stable."""
        of = self.disturbed(skew, values=self.polynomial.values(shares))
        omega, powers = self.grid, self._grid_powers
        for _ in range(_STEPS):
            size = _ratio(powers @ of.U, powers @ of.V)
            k = int(size.argmin())
            ends = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
            omega = np.geomspace(*ends, _FINER)
            powers = self.powers(omega, len(of.U) - 1)
        return float(size.min())

    def crossovers(self, shares: Vector) -> tuple[Vector, Vector]:
        """Gain crossovers at a point of the box, rad/s, and their delay margins, s."""
        of = self.delayed(self.polynomial.values(shares))
        order = len(of.U) - 1

        def excess(powers: Complex) -> Vector:
            return np.log(_ratio(powers @ of.V, powers @ of.U) + 1e-300)

        values = excess(self._grid_powers)
        steps = np.flatnonzero(values[:-1] * values[1:] < 0.0)
        low, high = np.log(self.grid[steps]), np.log(self.grid[steps + 1])
        below, above = values[steps], values[steps + 1]
        middle = low
        for _ in range(_STEPS):
            middle = low - below * (high - low) / (above - below)
            here = excess(self.powers(np.exp(middle), order))
            same = here * below > 0.0
            low, below = np.where(same, middle, low), np.where(same, here, below)
            high, above = np.where(same, high, middle), np.where(same, above, here)
        omega = np.exp(middle)
        powers = self.powers(omega, order)
        lag = np.angle(-(powers @ of.V) / (powers @ of.U)) % math.tau
        return omega, lag / omega

    def stable_at(self, shares: Vector) -> bool:
        """Whether the closed loop is stable at a point of the box."""
        a, n = self._split(self.polynomial.values(shares))
        rates = np.roots(a + n) * self._scale
        if not self.period_s:
            return bool(rates.real.max(initial=-1.0) < 0.0)
        return bool(np.abs(1.0 + rates * self.period_s).max(initial=0.0) < 1.0)


def _ratio(above: Complex, below: Complex) -> Vector:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nan_to_num(np.abs(above) / np.abs(below), nan=math.inf)


def _both(model: LinearModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A of the open and of the closed loop."""
    return model.A, model.A - model.B @ model.C / (1.0 + model.D[0, 0])
