"""Sum-of-squares programs that find and prove a region of attraction.

``studies.proofs.sos_region`` uses the programs. The candidate Lyapunov function
is V = y' P y, with the scaled state y. The stiffness h of the model has a bounded
error. For both signs of the error, the programs require a multiplier sigma such that

    -V' - sigma (1 - V) is a sum of squares, and sigma is a sum of squares.
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

from studies.proofs.exact_polynomials import (
    Exponents,
    Polynomial,
    gram_polynomial,
    is_positive_definite,
    match_gram,
)
from studies.proofs.lag_model import LagModel
from systems.framework.input_error import InputError

# Factors that shrink the largest region of the linear model. The first region uses the
# least factor for which multipliers exist.
_SHRINKINGS = (4.0, 16.0, 64.0, 256.0, 1024.0)
# Least rate of decrease of V, as a multiple of |y|^2, 1/s.
_DECAY = 1e-4
# Monomials of the multipliers, of degrees 1 and 2.
_MULTIPLIER_BASIS = [m for m in product(range(3), repeat=3) if 1 <= sum(m) <= 2]
# Monomials of V, of degree 1.
_UNIT: list[Exponents] = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
# Monomials of the sum of squares, of degrees 1 to 3.
_SUM_BASIS = [m for m in product(range(4), repeat=3) if 1 <= sum(m) <= 3]


def box(model: LagModel) -> list[tuple[float, float]]:
    """Bounds of the scaled state y: domain of x, clamp of v, and top speed for w."""
    a = model.scales[0]
    return [(model.domain_m[0] / a, model.domain_m[1] / a), (-1.0, 1.0), (-1.0, 1.0)]


def faces(model: LagModel) -> list[NDArray[np.float64]]:
    """Vectors n such that the polynomial model holds for n . y <= 1.

    The scaled state y contains the distance error x, the velocity v of the virtual
    mass, and the velocity w of the control point. The vectors bound x to the domain of
    the model, and v to the top speed. w follows v and needs no bound.
    """
    (low, high), *_ = box(model)
    eye = np.eye(3)
    return [eye[0] / high, eye[0] / low, eye[1], -eye[1]]


def first_region(
    model: LagModel,
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Finds a first region of attraction, and the multipliers that prove it.

    The matrix P of the region is a Lyapunov matrix of the linear model. P is scaled
    until multipliers exist.
    """
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
    """A program that searches multipliers for a fixed P, with its Gram matrices."""

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
    """Builds the polynomial z' G z of y, for monomials z and a matrix G.

    G may contain decision variables.
    """
    z = [monomial.ToExpression() for monomial in basis]
    size = range(len(z))
    total = sum(matrix[i, j] * z[i] * z[j] for i in size for j in size)
    return SymbolicPolynomial(total, y)


def _gap(
    model: LagModel, P: NDArray[Any], sigma: Any, y: NDArray[Any], sign: float
) -> SymbolicPolynomial:
    """-V' - decay |y|^2 - sigma (1 - V), which must be a sum of squares."""
    V = _form(P, _basis(_UNIT, y), y)
    gap = SymbolicPolynomial(-_DECAY * sum(v * v for v in y), y)
    for variable, rate in zip(y, model.rates(sign), strict=True):
        gap -= V.Differentiate(variable) * _symbolic(rate, y)
    return gap - sigma * (1.0 - V)


def feasibility(model: LagModel, P: NDArray[np.float64]) -> Feasibility:
    """Builds the program that finds multipliers for a given region.

    Args:
        model: Model with the polynomial rates of the state.
        P: (3, 3) symmetric. The region is y' P y <= 1, with the scaled state y.

    Returns:
        The program, with its Gram matrices for both signs of the stiffness error.
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
    """Solves a semidefinite program.

    Args:
        solver: Solver for semidefinite programs.
        program: The program.

    Returns:
        The solution. None if the solver finds no solution.
    """
    result = solver.Solve(program)
    return result if result.is_success() else None


def find_multipliers(
    model: LagModel, P: NDArray[np.float64]
) -> list[NDArray[np.float64]] | None:
    """Finds multipliers that prove that V = y' P y decreases on a region.

    Args:
        model: Model with the polynomial rates of the state.
        P: (3, 3) symmetric. The region is V <= 1, with the scaled state y.

    Returns:
        Gram matrices of the multipliers, one for each sign of the stiffness error. None
        if no multipliers are found.
    """
    problem = feasibility(model, P)
    result = solve(ClarabelSolver(), problem.program)
    if result is None:
        return None
    return [result.GetSolution(S) for S in problem.multipliers]


def larger_region(
    model: LagModel, P: NDArray[np.float64], multipliers: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Finds a larger region of attraction, with fixed multipliers.

    Args:
        model: Model with the polynomial rates. The region stays in the model's domain.
        P: (3, 3) matrix of the present region y' P y <= 1.
        multipliers: Gram matrices from ``find_multipliers``.

    Returns:
        (3, 3) symmetric matrix of the larger region. If the solver finds none, P
        itself.
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
    # The volume decreases with log det P. The cost is log det P, linearized about P.
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
    """Symmetric part of a matrix, as exact rational numbers."""
    return [[Fraction(float(v)) for v in row] for row in 0.5 * (matrix + matrix.T)]


def is_proved(
    model: LagModel,
    P: NDArray[np.float64],
    problem: Feasibility,
    result: MathematicalProgramResult | None,
) -> bool:
    """Proves a region of attraction in rational arithmetic, from the solver's result.

    The proof checks that these matrices are positive definite:

    - the Gram matrices of the multipliers sigma;
    - the Gram matrix of -V' - sigma (1 - V), corrected so that it is exact;
    - P bordered by each face of the model's domain.

    Args:
        model: Model with the polynomial rates, and its domain.
        P: (3, 3) matrix of the region y' P y <= 1.
        problem: The program that was solved for P.
        result: The solution. None: the solver found no solution.

    Returns:
        True only if every step holds exactly.
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
