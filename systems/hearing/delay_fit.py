"""Fits a position to the delays at a microphone array of any shape (compiled kernels).

Let p_m be the position of microphone m relative to the centroid of the microphones. Let
u be the direction of the source from the centroid, and w the inverse range. The
distance from the source to microphone m exceeds the distance to the centroid by

    g_m = (w |p_m|^2 - 2 p_m . u) / (sqrt(1 - 2 w p_m . u + w^2 |p_m|^2) + 1).

This function is smooth even at infinite range (w = 0) and for w below 0. The delays
tau_m relative to microphone 0 satisfy c tau_m = g_m - g_0, where c is the speed of
sound. The fit has two stages:

1. Linear equations give start positions. Let the equations of the squared ranges be
   divided by the range from microphone 0. They are then linear in the direction and the
   inverse range from microphone 0 (Smith and Abel, 1987).
2. Gauss-Newton steps in (u, w) on the whitened delays give the result. The coordinates
   of u depend on the array. For a row, and for a plane array in space, they are the
   components of u within the span of the array. For other arrays, they are rotations of
   u perpendicular to itself.

All kernels are written as loops. For arrays of this size, loops are faster than array
expressions, and numba compiles them ten times as fast.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.hearing.source_fix import RANGED, range_status

# Largest number of Gauss-Newton steps.
_STEPS = 30
# Largest change of a coordinate in the last step.
_SETTLED = 1e-9

# Limit of the difference between two chi-squares. If the chi-squares of two positions
# differ by less, both positions explain the delays equally well.
_SAME_CHI_SQUARE = 9.0

# Least cosine that keeps the slopes finite for directions along a row or in the plane
# of a plane array.
_LEAST_COSINE = 0.05


class DelayProblem(NamedTuple):
    """Delays and the array that measured them."""

    d: NDArray[np.float64]
    """(n - 1,) range differences, m. The range difference of a microphone is its range
    minus the range of microphone 0."""
    root: NDArray[np.float64]
    """(n - 1, n - 1) lower triangular matrix that whitens d: the errors of root d are
    independent and have the variance 1."""
    p: NDArray[np.float64]
    """(n, d) positions of the microphones relative to their centroid, m."""
    span: NDArray[np.float64]
    """(r, d) orthonormal basis of the span of the microphones."""
    side: NDArray[np.float64]
    """(d,) unit vector perpendicular to the span, toward the side on which sources are
    reported. Zeros if the span is the whole space."""


@njit(cache=True)
def _whitened(
    problem: DelayProblem,
    basis: NDArray[np.float64],
    k: int,
    u: NDArray[np.float64],
    w: float,
    r: NDArray[np.float64],
    J: NDArray[np.float64],
) -> float:  # pragma: no cover  (compiled)
    """Computes the whitened residuals r of the delays, and the slopes J of the model.

    Args:
        problem: Delays and array.
        basis: (d, k) derivatives of the direction u with respect to its coordinates.
        k: Number of coordinates of the direction.
        u: (d,) direction of the source.
        w: Inverse range of the source, 1/m.
        r: (n - 1,) output: residuals.
        J: (n - 1, k + 1) output: derivatives of the model with respect to the
            coordinates of u and to w.

    Returns:
        The sum of r^2.
    """
    p, root = problem.p, problem.root
    n, dim = p.shape
    # g of the module's docstring and its slopes G, one row per microphone.
    g = np.empty(n)
    G = np.empty((n, k + 1))
    for m in range(n):
        along, square = 0.0, 0.0
        for i in range(dim):
            along += p[m, i] * u[i]
            square += p[m, i] * p[m, i]
        ratio = math.sqrt(max(1.0 - 2.0 * w * along + w * w * square, 1e-24))
        top = w * square - 2.0 * along
        g[m] = top / (ratio + 1.0)
        slope = (w * square - along) / ratio
        G[m, k] = (square - top * slope / (ratio + 1.0)) / (ratio + 1.0)
        for j in range(k):
            turned = 0.0
            for i in range(dim):
                turned += p[m, i] * basis[i, j]
            G[m, j] = -turned / ratio
    # Differences to microphone 0, multiplied by the whitening matrix.
    cost = 0.0
    for a in range(n - 1):
        r[a] = 0.0
        for j in range(k + 1):
            J[a, j] = 0.0
        for b in range(a + 1):  # root is lower triangular
            r[a] += root[a, b] * (problem.d[b] - g[b + 1] + g[0])
            for j in range(k + 1):
                J[a, j] += root[a, b] * (G[b + 1, j] - G[0, j])
        cost += r[a] * r[a]
    return cost


@njit(cache=True)
def _factor(
    J: NDArray[np.float64], size: int, damping: float, prior: float
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the Cholesky factor of J^T J, with Marquardt damping of the diagonal.

    The number ``prior`` is added to the last diagonal element.
    """
    N = np.zeros((size, size))
    trace = 0.0
    for i in range(size):
        for j in range(i + 1):
            for a in range(J.shape[0]):
                N[i, j] += J[a, i] * J[a, j]
        trace += N[i, i]
    N[size - 1, size - 1] += prior
    for i in range(size):
        N[i, i] += damping * N[i, i] + 1e-14 * trace + 1e-300
        for j in range(i + 1):
            for b in range(j):
                N[i, j] -= N[i, b] * N[j, b]
            if i > j:
                N[i, j] /= N[j, j]
            else:
                N[i, i] = math.sqrt(max(N[i, i], 1e-14 * trace + 1e-300))
    return N


@njit(cache=True)
def _substitute(
    L: NDArray[np.float64], x: NDArray[np.float64]
) -> None:  # pragma: no cover  (compiled)
    """Replaces x by (L L^T)^-1 x."""
    size = L.shape[0]
    for i in range(size):
        for j in range(i):
            x[i] -= L[i, j] * x[j]
        x[i] /= L[i, i]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= L[j, i] * x[j]
        x[i] /= L[i, i]


@njit(cache=True)
def _least_squares(
    J: NDArray[np.float64], r: NDArray[np.float64], size: int, damping: float
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Solves J x = r by least squares for the first ``size`` columns of J."""
    x = np.zeros(size)
    for i in range(size):
        for a in range(J.shape[0]):
            x[i] += J[a, i] * r[a]
    _substitute(_factor(J, size, damping, 0.0), x)
    return x


@njit(cache=True)
def _dot(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> float:  # pragma: no cover  (compiled)
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@njit(cache=True)
def across(u: NDArray[np.float64]) -> NDArray[np.float64]:  # pragma: no cover
    """Returns (3, 2) orthonormal vectors perpendicular to a unit vector (3,)."""
    # The first one is made from the axis that is farthest from u.
    least = 0
    for i in range(1, 3):
        if abs(u[i]) < abs(u[least]):
            least = i
    size = math.sqrt(1.0 - u[least] ** 2)
    out = np.empty((3, 2))
    for i in range(3):
        out[i, 0] = ((1.0 if i == least else 0.0) - u[least] * u[i]) / size
    for i in range(3):
        j, m = (i + 1) % 3, (i + 2) % 3
        out[i, 1] = u[j] * out[m, 0] - u[m] * out[j, 0]
    return out


@njit(cache=True)
def _coordinates(
    problem: DelayProblem, u: NDArray[np.float64], bound: Any
) -> tuple[NDArray[np.float64], int]:  # pragma: no cover  (compiled)
    """Computes the derivatives of a direction u with respect to its coordinates.

    If ``bound`` is set, u keeps unit length within the span of the array, and the
    coordinates are rotations of u perpendicular to itself. Otherwise the coordinates
    are the components of u within the span.

    Returns:
        (d, 3) derivatives, and the number k of coordinates. Only the first k columns
        are used.
    """
    span = problem.span
    rank, dim = span.shape
    basis = np.zeros((dim, 3))
    if not bound:
        # Microphones slightly off their plane also respond to the component of u
        # perpendicular to the plane.
        off = 1.0
        for j in range(rank):
            off -= _dot(span[j], u) ** 2
        off = max(math.sqrt(max(off, 0.0)), _LEAST_COSINE)
        for j in range(rank):
            v = _dot(span[j], u)
            for i in range(dim):
                basis[i, j] = span[j, i] - problem.side[i] * v / off
        return basis, rank
    if rank == 2:
        a, b = _dot(span[0], u), _dot(span[1], u)
        for i in range(dim):
            basis[i, 0] = a * span[1, i] - b * span[0, i]
    if rank == 3:
        turned = across(u)
        for i in range(3):
            basis[i, 0], basis[i, 1] = turned[i, 0], turned[i, 1]
    return basis, rank - 1


@njit(cache=True)
def _lifted(
    problem: DelayProblem, v: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Returns the direction with components v in the span, completed to unit length."""
    off = math.sqrt(max(0.0, 1.0 - _dot(v, v)))
    u = np.empty(problem.side.size)
    for i in range(u.size):
        u[i] = off * problem.side[i]
        for j in range(v.size):
            u[i] += v[j] * problem.span[j, i]
    return u


@njit(cache=True)
def _within(
    problem: DelayProblem, u: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Returns the components of a direction in the span."""
    v = np.empty(problem.span.shape[0])
    for j in range(v.size):
        v[j] = _dot(problem.span[j], u)
    return v


@njit(cache=True)
def _descend(
    problem: DelayProblem, u: NDArray[np.float64], w: float, bound: Any, far: Any
) -> tuple[NDArray[np.float64], float, float]:  # pragma: no cover  (compiled)
    """Minimizes the sum of squared residuals by damped Gauss-Newton steps (Marquardt).

    If a step does not increase the sum, the function accepts the step and decreases the
    damping. Otherwise it discards the step and increases the damping. The steps end
    when no coordinate changes by more than ``_SETTLED``.

    Args:
        problem: Delays and array.
        u: (d,) direction to start from.
        w: Inverse range to start from, 1/m.
        bound: Whether u keeps unit length within the span of the array.
        far: Whether w is held constant.

    Returns:
        Final direction u; final inverse range w, 1/m; and sum of the squared residuals
        there.
    """
    m = problem.d.size
    basis, k = _coordinates(problem, u, bound)
    size = k if far else k + 1
    r, J = np.empty(m), np.empty((m, k + 1))
    r_next, J_next = np.empty(m), np.empty((m, k + 1))
    cost = _whitened(problem, basis, k, u, w, r, J)
    damping = 0.0
    for _ in range(_STEPS):
        if size == 0:
            break
        step = _least_squares(J, r, size, damping)
        w_next = w if far else w + step[k]
        if bound:
            u_next = u.copy()
            for i in range(u.size):
                for j in range(k):
                    u_next[i] += basis[i, j] * step[j]
            u_next /= math.sqrt(_dot(u_next, u_next))
        else:
            v = _within(problem, u)
            for j in range(k):
                v[j] += step[j]
            u_next = _lifted(problem, v)
        basis_next, _ = _coordinates(problem, u_next, bound)
        cost_next = _whitened(problem, basis_next, k, u_next, w_next, r_next, J_next)
        if cost_next <= cost:
            u, w, basis, cost = u_next, w_next, basis_next, cost_next
            r, r_next = r_next, r
            J, J_next = J_next, J
            damping *= 0.1
        else:
            damping = max(10.0 * damping, 1e-3)
        largest = 0.0
        for j in range(size):
            largest = max(largest, abs(step[j]))
        if largest < _SETTLED:
            break
    return u, w, cost


@njit(cache=True)
def _descend_within(
    problem: DelayProblem, u: NDArray[np.float64], w: float, far: Any
) -> tuple[NDArray[np.float64], float, float]:  # pragma: no cover  (compiled)
    """Runs ``_descend`` with the constraints w >= 0 and |u| <= 1.

    Here w is the inverse range, and u is the direction within the span of the array. If
    a result violates a constraint, the function repeats the steps with w = 0 or |u| =
    1.
    """
    bound = _is_bound(problem)
    cost = 0.0
    for _ in range(4):
        u, w, cost = _descend(problem, u, w, bound, far)
        length = math.sqrt(_dot(u, u))
        if w < 0.0:
            w, far = 0.0, w < 0.0  # numba would compile a literal True anew
        elif length > 1.0 and not bound:
            # The delays exceed the length of the array: the source is in its line or
            # plane.
            u, bound = u / length, length > 1.0  # see above
        else:
            break
    return u, w, cost


@njit(cache=True)
def _is_bound(problem: DelayProblem) -> bool:  # pragma: no cover  (compiled)
    """Returns whether all components of a direction are in the span of the array."""
    return _dot(problem.side, problem.side) == 0.0


@njit(cache=True)
def _starts(
    problem: DelayProblem,
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], int
]:  # pragma: no cover  (compiled)
    """Computes the start positions of the fit by linear equations.

    Let v be the components of the direction from microphone 0 within the span of the
    array, and w the inverse range from there. Each other microphone b is at q = p_b -
    p_0, seen from microphone 0, and has the range difference d. It gives the equation

        q . v - w (q^2 - d^2) / 2 = -d.

    The first start position is a plane wave (w = 0). If v must have unit length, v is a
    linear function of w, and |v| = 1 gives up to two more start positions. Otherwise,
    if there are enough delays, least squares for v and w give one more.

    Returns:
        (3, r) components v, (3,) inverse ranges w, 1/m, and the number of start
        positions. Each start position has one row. Further rows have no meaning.
    """
    d, root, p, span = problem.d, problem.root, problem.p, problem.span
    m, rank = d.size, span.shape[0]
    A, far, half = np.zeros((m, rank + 1)), np.zeros(m), np.zeros(m)
    for a in range(m):
        for b in range(a + 1):
            for i in range(p.shape[1]):
                q = p[b + 1, i] - p[0, i]
                for j in range(rank):
                    A[a, j] += root[a, b] * q * span[j, i]
                half[a] += root[a, b] * 0.5 * q * q
            far[a] -= root[a, b] * d[b]
            half[a] -= root[a, b] * 0.5 * d[b] * d[b]
        A[a, rank] = -half[a]
    components, inverse = np.zeros((3, rank)), np.zeros(3)
    v_far = _least_squares(A, far, rank, 0.0)
    for j in range(rank):
        components[0, j] = v_far[j]
    count = 1
    if _is_bound(problem):
        # v = v_far + w v_w with |v| = 1: a quadratic equation in w.
        v_w = _least_squares(A, half, rank, 0.0)
        # a and b are also the indices of the loops above.
        a, b, c = _dot(v_w, v_w), _dot(v_far, v_w), _dot(v_far, v_far) - 1.0
        reach = math.sqrt(max(0.0, b * b - a * c))
        for sign in (1.0, -1.0):
            w = (-b + sign * reach) / max(a, 1e-300)
            if w > 0.0:
                for j in range(rank):
                    components[count, j] = v_far[j] + w * v_w[j]
                inverse[count] = w
                count += 1
    elif m >= rank + 1:
        solution = _least_squares(A, far, rank + 1, 0.0)
        if solution[rank] > 0.0:
            for j in range(rank):
                components[1, j] = solution[j]
            inverse[1] = solution[rank]
            count = 2
    return components, inverse, count


@njit(cache=True)
def _from_centroid(
    problem: DelayProblem, v: NDArray[np.float64], w: float
) -> tuple[NDArray[np.float64], float]:  # pragma: no cover  (compiled)
    """Converts direction and inverse range from microphone 0 to the centroid."""
    length = math.sqrt(_dot(v, v))
    if length > 1.0 or (_is_bound(problem) and length > 0.0):
        v = v / length
    if length == 0.0 and _is_bound(problem):
        v[0] = 1.0  # any direction: the source is amid the microphones
    u = _lifted(problem, v)
    if w <= 0.0:
        return u, 0.0
    for i in range(u.size):
        u[i] = problem.p[0, i] + u[i] / w
    distance = max(math.sqrt(_dot(u, u)), 1e-12)
    return u / distance, 1.0 / distance


@njit(cache=True)
def _search(
    problem: DelayProblem,
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
]:  # pragma: no cover  (compiled)
    """Finds the two positions that fit the delays best.

    The function refines the start positions by ``_descend_within``. It refines the
    plane wave last, and omits it if another position already fits. It returns (2, d)
    directions, (2,) inverse ranges, 1/m, and (2,) chi-squares. The position that fits
    best is first.
    """
    n, dim = problem.p.shape
    unknowns = problem.span.shape[0] + (0 if _is_bound(problem) else 1)
    far = n - 1 < unknowns
    components, inverse, count = _starts(problem)
    us, ws, costs = np.zeros((2, dim)), np.zeros(2), np.array([np.inf, np.inf])
    for s in range(count - 1, -1, -1):
        if s == 0 and costs[0] < n + 25.0:
            break  # the plane wave would end at the same position
        u, w = _from_centroid(problem, components[s].copy(), inverse[s])
        u, w, cost = _descend_within(problem, u, w, far)
        place = 0 if cost < costs[0] else 1
        if place == 1 and not cost < costs[1]:
            continue
        for i in range(dim):
            us[1, i] = us[0, i] if place == 0 else us[1, i]
            us[place, i] = u[i]
        if place == 0:
            ws[1], costs[1] = ws[0], costs[0]
        ws[place], costs[place] = w, cost
    return us, ws, costs


@njit(cache=True)
def _covariance(
    problem: DelayProblem, u: NDArray[np.float64], w: float, prior: float
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], int
]:  # pragma: no cover  (compiled)
    """Computes the covariance of a position.

    Args:
        problem: Delays and array.
        u: (d,) direction of the source.
        w: Inverse range of the source, 1/m.
        prior: Inverse of the variance of w that is assumed before the delays are known,
            m^2; 0 for no assumption.

    Returns:
        Three values:

        - (k + 1, k + 1) covariance of the coordinates of u and of w;
        - (d, 3) derivatives of u with respect to its coordinates;
        - number k of coordinates.
    """
    bound = _is_bound(problem)
    basis, k = _coordinates(problem, u, bound)
    r, J = np.empty(problem.d.size), np.empty((problem.d.size, k + 1))
    _whitened(problem, basis, k, u, w, r, J)
    L = _factor(J, k + 1, 0.0, prior)
    C = np.zeros((k + 1, k + 1))
    for i in range(k + 1):
        C[i, i] = 1.0
        _substitute(L, C[i])
    if not bound:
        v = _within(problem, u)
        # Near the line or plane, the perpendicular component is the root of a small
        # difference. The error of this difference bounds it from below.
        size = 0.0
        for i in range(k):
            for j in range(k):
                size += v[i] * C[i, j] * v[j]
        off = max(1.0 - _dot(v, v), math.sqrt(max(size, 0.0)), 1e-12)
        for i in range(u.size):
            for j in range(k):
                basis[i, j] = problem.span[j, i] - (
                    problem.side[i] * v[j] / math.sqrt(off)
                )
    return C, basis, k


@njit(cache=True)
def carried(
    T: NDArray[np.float64], C: NDArray[np.float64], size: int
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes T C T^T with the first ``size`` columns of T."""
    dim = T.shape[0]
    out = np.zeros((dim, dim))
    for i in range(dim):
        for j in range(dim):
            for a in range(size):
                for b in range(size):
                    out[i, j] += T[i, a] * C[a, b] * T[j, b]
    return out


@njit(cache=True)
def fit_delays(
    problem: DelayProblem, prior_w: float
) -> tuple[
    NDArray[np.float64],
    float,
    float,
    NDArray[np.float64],
    NDArray[np.float64],
    float,
    NDArray[np.float64],
    int,
]:  # pragma: no cover  (compiled)
    """Computes the position that fits the delays, its errors, and its twin.

    The search gives up to two positions. If both fit about equally well, the farther
    position is the result, and the nearer position is its twin. If the inverse range
    exceeds its standard deviation, the range is valid. Otherwise the function fits the
    direction again for a plane wave. The covariance of this direction includes the
    effect of the unknown range.

    Args:
        problem: Delays, and the array that measured them.
        prior_w: Assumed standard deviation of the inverse range if the delays give no
            range, 1/m.

    Returns:
        Eight values, in this order:

        - (d,) direction u;
        - inverse range w, 1/m, or 0 without a range;
        - variance of w, or infinity without a range;
        - (d, d) covariance of u;
        - (d, d) covariance of the position, or covariance of u without a range;
        - chi-square of the fit;
        - (d,) position of the twin, or zeros without a twin;
        - status of the range (``range_status``).
    """
    us, ws, costs = _search(problem)
    n, dim = problem.p.shape
    # The farther position of two that fit equally well; the other one is the twin.
    main, twin = 0, np.zeros(dim)
    if costs[1] < costs[0] + _SAME_CHI_SQUARE and min(ws[0], ws[1]) > 0.0:
        apart = abs(ws[0] - ws[1]) / ws[0]
        for i in range(dim):
            apart = max(apart, abs(us[0, i] - us[1, i]))
        if apart > 1e-6:
            main = 0 if ws[0] < ws[1] else 1
            for i in range(dim):
                twin[i] = us[1 - main, i] / ws[1 - main]
    # A position, if its range is valid.
    u, w, cost = us[main].copy(), ws[main], costs[main]
    unknowns = problem.span.shape[0] + (0 if _is_bound(problem) else 1)
    status = range_status(w, 0.0, 1.0, n - 1 >= unknowns)
    if status == RANGED:
        C, by, k = _covariance(problem, u, w, 0.0)
        status = range_status(w, C[k, k], w * w)
        if status == RANGED:
            of_u = carried(by, C, k)
            to_p = np.empty((dim, 4))
            for i in range(dim):
                for j in range(k):
                    to_p[i, j] = by[i, j] / w
                to_p[i, k] = -u[i] / (w * w)
            of_p = carried(to_p, C, k + 1)
            return u, w, C[k, k], of_u, of_p, cost, twin, status
    # Otherwise a direction alone.
    far = n > 0  # numba would compile a literal True anew
    u, _, cost_far = _descend_within(problem, u, 0.0, far)
    C, by, k = _covariance(problem, u, 0.0, 1.0 / (prior_w * prior_w))
    of_u = carried(by, C, k)
    return u, 0.0, np.inf, of_u, of_u, min(cost, cost_far), twin, status
