"""The sum-of-squares programs of ``analysis.certificates.sos_region``, and their proof.

For both signs of the error of h, with y the scaled state and V = y' P y,

    -V' - sigma (1 - V) is a sum of squares, sigma a sum of squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import (
    ClarabelSolver,
    MathematicalProgram,
    MathematicalProgramResult,
    SolverInterface,
)
from pydrake.symbolic import Expression, Monomial, Polynomial as SymbolicPolynomial
from scipy.linalg import solve_continuous_lyapunov

from analysis.certificates.exact_polynomials import (
    Exponents,
    Polynomial,
    gram_polynomial,
    is_positive_definite,
    match_gram,
)
from analysis.certificates.lag_model import LagModel
from systems.framework.input_error import InputError

#: The first region is the largest of the linear model's, shrunk by the least of
#: these that has multipliers.
_SHRINKINGS = (4.0, 16.0, 64.0, 256.0, 1024.0)
#: V' is to fall at least by this share of |y|^2, 1/s.
_DECAY = 1e-4
#: The multipliers' monomials, degrees 1 and 2; those of V; those of the sum, 1 to 3.
_MULTIPLIER_BASIS = [m for m in product(range(3), repeat=3) if 1 <= sum(m) <= 2]
_UNIT: list[Exponents] = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
_SUM_BASIS = [m for m in product(range(4), repeat=3) if 1 <= sum(m) <= 3]


def box(model: LagModel) -> list[tuple[float, float]]:
    """Bounds of y: the domain, the clamp of v, and the top speed of w."""
    a = model.scales[0]
    return [(model.domain_m[0] / a, model.domain_m[1] / a), (-1.0, 1.0), (-1.0, 1.0)]


def faces(model: LagModel) -> list[NDArray[np.float64]]:
    """n with n . y <= 1 where the model holds: on the domain, below the clamp.

    w follows v, and needs no bound.
    """
    (low, high), *_ = box(model)
    eye = np.eye(3)
    return [eye[0] / high, eye[0] / low, eye[1], -eye[1]]


def first_region(
    model: LagModel,
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """P of the linear model, scaled until a region is found, and its multipliers."""
    A = np.zeros((3, 3))
    for i, rate in enumerate(model.rates(0.0)):
        for monomial, value in rate.terms.items():
            if sum(monomial) == 1:
                A[i, monomial.index(1)] = float(value)
    if np.linalg.eigvals(A).real.max() < 0.0:
        P = solve_continuous_lyapunov(A.T, -np.eye(3))
        P = 0.5 * (P + P.T)
        reach = max(float(n @ np.linalg.solve(P, n)) for n in faces(model))
        for shrink in _SHRINKINGS:
            multipliers = find_multipliers(model, shrink * reach * P)
            if multipliers is not None:
                return shrink * reach * P, multipliers
    raise InputError(
        "law",
        f"{model.contact.law.name!r} has no region of attraction of this form "
        f"with {model.lag_s} s of motor lag; lower its stiffness or "
        "plant.motor_lag_s, or raise attraction.damping_n_s_m",
    )


@dataclass(frozen=True, eq=False)
class Feasibility:
    """A program in the multipliers for a fixed P, and its Gram matrices."""

    program: MathematicalProgram
    multipliers: list[Any]
    sums: list[Any]


def _symbolic(polynomial: Polynomial, y: NDArray[Any]) -> SymbolicPolynomial:
    powers = _basis(list(polynomial.terms), y)
    values = [Expression(float(value)) for value in polynomial.terms.values()]
    return SymbolicPolynomial(dict(zip(powers, values, strict=True)))


def _basis(exponents: list[Exponents], y: NDArray[Any]) -> NDArray[Any]:
    return np.array([Monomial(dict(zip(y, m, strict=True))) for m in exponents])


def _form(matrix: Any, basis: NDArray[Any], y: NDArray[Any]) -> SymbolicPolynomial:
    """z' G z of monomials z, of y alone where G has decision variables."""
    z = [monomial.ToExpression() for monomial in basis]
    size = range(len(z))
    total = sum(matrix[i, j] * z[i] * z[j] for i in size for j in size)
    return SymbolicPolynomial(total, y)


def _gap(
    model: LagModel, P: NDArray[Any], sigma: Any, y: NDArray[Any], sign: float
) -> SymbolicPolynomial:
    """-V' - decay |y|^2 - sigma (1 - V), which is to be a sum of squares."""
    V = _form(P, _basis(_UNIT, y), y)
    gap = SymbolicPolynomial(-_DECAY * sum(v * v for v in y), y)
    for variable, rate in zip(y, model.rates(sign), strict=True):
        gap -= V.Differentiate(variable) * _symbolic(rate, y)
    return gap - sigma * (1.0 - V)


def feasibility(model: LagModel, P: NDArray[np.float64]) -> Feasibility:
    """The program that looks for multipliers of the region of P.

    Args:
        model: Polynomial rates of the state.
        P: (3, 3) symmetric; the region is y' P y <= 1, y the scaled state.

    Returns:
        The program, and its Gram matrices, one for either sign of the error of h.
    """
    program = MathematicalProgram()
    y: Any = program.NewIndeterminates(3, "y")
    multipliers, sums = [], []
    for sign in (-1.0, 1.0):
        sigma, S = program.NewSosPolynomial(_basis(_MULTIPLIER_BASIS, y))
        gap = _gap(model, P, sigma, y, sign)
        multipliers.append(S)
        sums.append(program.AddSosConstraint(gap, _basis(_SUM_BASIS, y)))
    return Feasibility(program, multipliers, sums)


def solve(
    solver: SolverInterface, program: MathematicalProgram
) -> MathematicalProgramResult | None:
    """What the solver finds; none: it says that there is no solution.

    Args:
        solver: What solves semidefinite programs.
        program: What is to be solved.

    Returns:
        The solution, or None.
    """
    result = solver.Solve(program)
    return result if result.is_success() else None


def find_multipliers(
    model: LagModel, P: NDArray[np.float64]
) -> list[NDArray[np.float64]] | None:
    """Multipliers for the region as it is; none: V does not fall all over it.

    Args:
        model: Polynomial rates of the state.
        P: (3, 3) symmetric; the region is y' P y <= 1, y the scaled state.

    Returns:
        Their Gram matrices, one for either sign of the error of h, or None.
    """
    problem = feasibility(model, P)
    result = solve(ClarabelSolver(), problem.program)
    if result is None:
        return None
    return [result.GetSolution(S) for S in problem.multipliers]


def larger_region(
    model: LagModel, P: NDArray[np.float64], multipliers: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """P of a larger region inside the box, the multipliers held.

    Args:
        model: Polynomial rates, and the box of the domain.
        P: (3, 3) of the region that is to grow.
        multipliers: Gram matrices, from ``find_multipliers``.

    Returns:
        (3, 3) symmetric; P itself where the solver finds none.
    """
    program = MathematicalProgram()
    y: Any = program.NewIndeterminates(3, "y")
    new: Any = program.NewSymmetricContinuousVariables(3, "P")
    for sign, S in zip((-1.0, 1.0), multipliers, strict=True):
        sigma = _form(S, _basis(_MULTIPLIER_BASIS, y), y)
        gap = _gap(model, new, sigma, y, sign)
        program.AddSosConstraint(gap, _basis(_SUM_BASIS, y))
    for n in faces(model):
        block = np.empty((4, 4), dtype=object)
        block[:3, :3], block[:3, 3], block[3, :3], block[3, 3] = new, n, n, 1.0
        program.AddPositiveSemidefiniteConstraint(
            np.array([[Expression(v) for v in row] for row in block])
        )
    # The volume falls with log det P, here linearised about the last P.
    slope = np.linalg.inv(P)
    program.AddLinearCost(
        sum(slope[i, j] * new[i, j] for i in range(3) for j in range(3))
    )
    result = solve(ClarabelSolver(), program)
    if result is None:
        return P
    found: Any = result.GetSolution(new)
    return np.asarray(0.5 * (found + found.T))


def _rational(matrix: Any) -> list[list[Fraction]]:
    """The symmetric part, as the rational numbers that its floats are."""
    return [[Fraction(float(v)) for v in row] for row in 0.5 * (matrix + matrix.T)]


def is_proved(
    model: LagModel,
    P: NDArray[np.float64],
    problem: Feasibility,
    result: MathematicalProgramResult | None,
) -> bool:
    """Proves the region in rational arithmetic, from the solver's numbers.

    The multipliers are what the solver found, as rationals; the sum's Gram
    matrix is moved until it makes -V' - sigma (1 - V) exactly, and then must be
    positive definite. So must P and its blocks with the faces of the box.

    Args:
        model: Polynomial rates, and the box of the domain.
        P: (3, 3) of the region.
        problem: What was solved for P.
        result: What the solver found; None: nothing.

    Returns:
        True only where every step holds exactly.
    """
    if result is None:
        return False
    rows = _rational(P)
    V = gram_polynomial(_UNIT, rows)
    one = Polynomial({(0, 0, 0): 1})
    for sign, S, G in zip((-1.0, 1.0), problem.multipliers, problem.sums, strict=True):
        multiplier = _rational(result.GetSolution(S))
        dot = Polynomial({})
        for k, rate in enumerate(model.rates(sign)):
            dot = dot + V.derivative(k) * rate
        if not is_positive_definite(multiplier):
            return False
        sigma = gram_polynomial(_MULTIPLIER_BASIS, multiplier)
        gap = -dot - sigma * (one - V)
        gram = match_gram(gap, _SUM_BASIS, result.GetSolution(G))
        if gram is None or not is_positive_definite(gram):
            return False
    for n in faces(model):
        face = [Fraction(float(v)) for v in n]
        block = [[*row, value] for row, value in zip(rows, face, strict=True)]
        if not is_positive_definite([*block, [*face, Fraction(1)]]):
            return False
    return True
