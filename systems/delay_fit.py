"""Fits a place to the delays at microphones of any places: compiled kernels.

With u the direction of the source seen from the microphones' centroid and w
the inverse of its range, microphone m is farther from it than the centroid by

    g_m = (w |p_m|^2 - 2 p_m . u) / (sqrt(1 - 2 w p_m . u + w^2 |p_m|^2) + 1),

which is smooth where the range is infinite (w = 0), and beyond. The delays are
c tau_m = g_m - g_0. Squaring the ranges makes them linear in the direction and
the inverse range as seen from microphone 0 (Smith and Abel, 1987): the start.
Gauss-Newton steps on the whitened delays in (direction, w) follow. Along a row,
or in the plane of a plane array in space, the direction has its components
within the array as coordinates; elsewhere those across itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["DelayProblem", "fit_delays"]

_STEPS = 30
_SETTLED = 1e-9

# Two places explain the delays alike where their chi-squares differ by less.
_SAME_CHI_SQUARE = 9.0

# Keeps slopes finite along a row and in the plane of a plane array.
_LEAST_COSINE = 0.05


class DelayProblem(NamedTuple):
    """Delays and the array that measured them."""

    d: NDArray[np.float64]
    """(n - 1,) differences of range from that of microphone 0, m."""
    root: NDArray[np.float64]
    """(n - 1, n - 1) that makes their errors independent, of variance 1."""
    p: NDArray[np.float64]
    """(n, d) microphones from their centroid, m."""
    span: NDArray[np.float64]
    """(r, d) orthonormal vectors that they span."""
    side: NDArray[np.float64]
    """(d,) unit vector off the span to the side looked at; zeros: none is."""


@njit(cache=True)
def _excess(p, u, w):  # pragma: no cover  (compiled)
    """Excess ranges g, and their slopes -dg/d(p . u) and dg/dw.

    Args:
        p: (n, d) microphones.
        u: (d,) direction.
        w: Inverse range.

    Returns:
        Three arrays (n,).
    """
    along = p @ u
    square = (p * p).sum(axis=1)
    ratio = np.sqrt(np.maximum(1.0 - 2.0 * w * along + w * w * square, 1e-24))
    top = w * square - 2.0 * along
    g = top / (ratio + 1.0)
    slope = (w * square - along) / ratio
    by_w = square / (ratio + 1.0) - top * slope / (ratio + 1.0) ** 2
    return g, 1.0 / ratio, by_w


@njit(cache=True)
def _system(problem, basis, u, w):  # pragma: no cover  (compiled)
    """Whitened residuals (m,) and their slopes (m, k + 1) by direction and w."""
    p = problem.p
    g, by_u, by_w = _excess(p, u, w)
    k = basis.shape[1]
    slopes = np.empty((p.shape[0], k + 1))
    slopes[:, :k] = -(p @ basis) * by_u.reshape((-1, 1))
    slopes[:, k] = by_w
    r = problem.root @ (problem.d - (g[1:] - g[0]))
    return r, problem.root @ (slopes[1:] - slopes[0])


@njit(cache=True)
def _solve_least_squares(A, b, damping):  # pragma: no cover  (compiled)
    """x of least |A x - b|, shortened by damping (Marquardt)."""
    N = A.T @ A
    floor = 1e-14 * np.trace(N) + 1e-300
    for i in range(N.shape[0]):
        N[i, i] += damping * N[i, i] + floor
    return np.linalg.solve(N, A.T @ b)


@njit(cache=True)
def _tangent(u, span):  # pragma: no cover  (compiled)
    """(d, r - 1) orthonormal directions across u within the span."""
    d, r = u.size, span.shape[0]
    basis = np.zeros((d, r - 1))
    if r == 2:
        a, b = span[0] @ u, span[1] @ u
        basis[:, 0] = -b * span[0] + a * span[1]
    elif r == 3:
        least = np.argmin(np.abs(u))
        e = -u[least] * u
        e[least] += 1.0
        e /= np.sqrt(e @ e)
        basis[:, 0] = e
        basis[:, 1] = np.cross(u, e)
    return basis


@njit(cache=True)
def _coordinates(problem, u, bound):  # pragma: no cover  (compiled)
    """(d, k) what the coordinates of a direction do to it."""
    if bound:
        return _tangent(u, problem.span)
    # Microphones a little off their plane hear the component off it too.
    v = problem.span @ u
    off = max(math.sqrt(max(1.0 - v @ v, 0.0)), _LEAST_COSINE)
    return problem.span.T - np.outer(problem.side, v) / off


@njit(cache=True)
def _lifted(v, span, side):  # pragma: no cover  (compiled)
    """Direction with components v in the span, completed to the side."""
    u = v @ span
    return u + math.sqrt(max(0.0, 1.0 - v @ v)) * side


@njit(cache=True)
def _descend(problem, u, w, bound, far):  # pragma: no cover  (compiled)
    """Gauss-Newton steps, shortened where they lead uphill.

    Args:
        problem: Delays and array.
        u: (d,) direction to start from.
        w: Inverse range to start from.
        bound: Whether u keeps unit length within the span.
        far: Whether w stays as it is.

    Returns:
        u, w and the sum of squares there.
    """
    span = problem.span
    basis = _coordinates(problem, u, bound)
    r, J = _system(problem, basis, u, w)
    cost, damping = r @ r, 0.0
    for _ in range(_STEPS):
        k = basis.shape[1]
        size = k if far else k + 1
        if size == 0:
            break
        step = np.zeros(k + 1)
        step[:size] = _solve_least_squares(
            np.ascontiguousarray(J[:, :size]), r, damping
        )
        if bound:
            u_next = u + basis @ step[:k]
            u_next /= np.sqrt(u_next @ u_next)
        else:
            u_next = _lifted(span @ u + step[:k], span, problem.side)
        basis_next = _coordinates(problem, u_next, bound)
        r_next, J_next = _system(problem, basis_next, u_next, w + step[k])
        cost_next = r_next @ r_next
        if cost_next <= cost:
            u, w, basis, r, J = u_next, w + step[k], basis_next, r_next, J_next
            cost = cost_next
            damping *= 0.1
        else:
            damping = max(10.0 * damping, 1e-3)
        if np.abs(step).max() < _SETTLED:
            break
    return u, w, cost


@njit(cache=True)
def _starts(problem, bound):  # pragma: no cover  (compiled)
    """Directions (s, d) and inverse ranges (s,) to start from; far away first."""
    d, root, p, span = problem.d, problem.root, problem.p, problem.span
    n, dim = p.shape
    r = span.shape[0]
    q = p[1:] - p[0]
    half = 0.5 * ((q * q).sum(axis=1) - d * d)
    A = np.empty((n - 1, r + 1))
    A[:, :r] = q @ span.T
    A[:, r] = -half
    A = root @ A
    directions = np.zeros((3, dim))
    inverse = np.zeros(3)
    inner = np.ascontiguousarray(A[:, :r])
    v_far = _solve_least_squares(inner, root @ -d, 0.0)
    directions[0] = v_far @ span
    count = 1
    if bound:
        # Direction as a function of w, of length 1: a quadratic in w.
        v_w = _solve_least_squares(inner, root @ half, 0.0)
        a, b, c = v_w @ v_w, v_far @ v_w, v_far @ v_far - 1.0
        reach = math.sqrt(max(0.0, b * b - a * c))
        for sign in (1.0, -1.0):
            w = (-b + sign * reach) / max(a, 1e-300)
            if w > 0.0:
                directions[count] = (v_far + w * v_w) @ span
                inverse[count] = w
                count += 1
    elif n - 1 >= r + 1:
        solution = _solve_least_squares(A, root @ -d, 0.0)
        if solution[r] > 0.0:
            directions[1] = solution[:r] @ span
            inverse[1] = solution[r]
            count = 2
    return directions, inverse, count


@njit(cache=True)
def _from_centroid(v, w, p_0, span, side):  # pragma: no cover  (compiled)
    """Direction and inverse range, given from microphone 0, from the centroid."""
    inside = span @ v
    u = _lifted(inside, span, side)
    if w <= 0.0:
        return u, 0.0
    x = p_0 + u / w
    distance = max(np.sqrt(x @ x), 1e-12)
    return x / distance, 1.0 / distance


@njit(cache=True)
def _covariance(problem, u, w, prior):  # pragma: no cover  (compiled)
    """Errors at a place.

    Args:
        problem: Delays and array.
        u: (d,) direction.
        w: Inverse range.
        prior: What is known of w beforehand: 1 over its variance.

    Returns:
        (k + 1, k + 1) covariance of the coordinates of u and of w, and (d, k)
        slopes of u by its coordinates.
    """
    side = problem.side
    ambiguous = side.any()
    span = problem.span
    basis = _coordinates(problem, u, bound=not ambiguous)
    _, J = _system(problem, basis, u, w)
    A = J.T @ J
    k = basis.shape[1]
    A[k, k] += prior
    floor = 1e-14 * np.trace(A) + 1e-300
    for i in range(k + 1):
        A[i, i] += floor
    C = np.linalg.inv(A)
    if ambiguous:
        v = span @ u
        # Near the line or plane the component off it is the root of a small
        # difference: its error stays below the root of that difference's.
        inside = np.ascontiguousarray(C[:k, :k])
        size = math.sqrt(max(v @ (inside @ v), 0.0))
        off = max(math.sqrt(max(1.0 - v @ v, 0.0)), math.sqrt(size), 1e-6)
        basis = span.T - np.outer(side, v) / off
    return C, basis


@njit(cache=True)
def _descend_within(problem, u, w, far):  # pragma: no cover  (compiled)
    """``_descend`` to a place that exists: w >= 0 and |u| = 1."""
    bound = not problem.side.any()
    u, w, cost = _descend(problem, u, w, bound, far)
    if w < 0.0:
        u, w, cost = _descend(problem, u, 0.0, bound, far=True)
    length = np.sqrt(u @ u)
    if length > 1.0 and not bound:
        # More than the array is long: in its line or plane.
        u, w, cost = _descend(problem, u / length, w, bound=True, far=far)
        if w < 0.0:
            u, w, cost = _descend(problem, u, 0.0, bound=True, far=True)
    return u, w, cost


@njit(cache=True)
def _search(problem):  # pragma: no cover  (compiled)
    """Places that fit: u (s, d), w and chi-square (s,), the best one first."""
    p, span, side = problem.p, problem.span, problem.side
    bound = not side.any()
    far = p.shape[0] < span.shape[0] + (1 if bound else 2)
    directions, inverse, count = _starts(problem, bound)
    us, ws = np.zeros((3, p.shape[1])), np.zeros(3)
    costs = np.full(3, np.inf)
    for s in range(count - 1, -1, -1):
        if s == 0 and costs.min() < p.shape[0] + 25.0:
            break  # a start from far away would end there as well
        v = directions[s]
        length = np.sqrt(v @ v)
        if length > 1.0 or bound:
            # Nothing at all points to a source amid the microphones.
            v = v / length if length > 0.0 else span[0]
        u, w = _from_centroid(v, inverse[s], p[0], span, side)
        us[s], ws[s], costs[s] = _descend_within(problem, u, w, far)
    order = np.argsort(costs)
    return us[order], ws[order], costs[order]


@njit(cache=True)
def fit_delays(problem, prior_w):  # pragma: no cover  (compiled)
    """Place, its errors and its twin.

    Args:
        problem: ``DelayProblem``.
        prior_w: Standard deviation of the inverse range before anything is
            heard, 1/m; used where the delays tell no range.

    Returns:
        u (d,), w and its variance (infinite: no range), covariances (d, d) of
        u and of the position, chi-square, and the twin's place (0: none).
    """
    us, ws, costs = _search(problem)
    bound = not problem.side.any()
    n, dim = problem.p.shape
    k = problem.span.shape[0] - (1 if bound else 0)
    main, twin = 0, np.zeros(dim)
    if costs[1] < costs[0] + _SAME_CHI_SQUARE and min(ws[0], ws[1]) > 0.0:
        apart = np.abs(us[0] - us[1]).max()
        if apart > 1e-6 or abs(ws[0] - ws[1]) > 1e-6 * ws[0]:
            main = 0 if ws[0] < ws[1] else 1
            twin = us[1 - main] / ws[1 - main]
    u, w, cost = us[main], ws[main], costs[main]
    if w > 0.0 and n - 1 >= k + 1:
        C, by = _covariance(problem, u, w, 0.0)
        if C[k, k] < w * w:
            to_p = np.empty((dim, k + 1))
            to_p[:, :k] = by / w
            to_p[:, k] = -u / (w * w)
            inside = np.ascontiguousarray(C[:k, :k])
            return u, w, C[k, k], by @ inside @ by.T, to_p @ C @ to_p.T, cost, twin
    u, _, cost_far = _descend_within(problem, u, 0.0, far=True)
    C, by = _covariance(problem, u, 0.0, 1.0 / (prior_w * prior_w))
    of_u = by @ np.ascontiguousarray(C[:k, :k]) @ by.T
    return u, 0.0, np.inf, of_u, of_u, min(cost, cost_far), twin
