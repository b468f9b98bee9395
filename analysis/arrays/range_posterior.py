"""Estimates the range of a source from delays with common errors, in compiled code.

If the array is not well known, the range from least squares is a poor estimate for two
reasons. Delay errors may bend the waves by chance, and then the source seems near and
the range seems certain. An array in space may also have a second solution between its
microphones.

Therefore, this module computes the likelihood of the delays at many ranges. At each
range, it uses the best direction and the effect of the array's errors on delays from
there. The range is then averaged with the likelihood as its weight. All ranges are
equally likely beforehand.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_budget import ArrayBudget
from systems.framework.compiling import njit
from systems.hearing.delay_fit import across
from systems.sound.array_shape import ArrayShape

# Largest range: _FARTHEST_M, or this number of apertures if that is longer. No array
# can measure larger ranges.
_FARTHEST_M, _FARTHEST_APERTURES = 30.0, 10.0

# _RANGES: number of ranges, at equal steps of their logarithm.
# _ABOUT: further ranges around the most likely one, in standard deviations of the
#   inverse range.
_RANGES = 48
_ABOUT = np.linspace(-5.0, 5.0, 31)

_STEPS = 4
_LEAST_OFF = 0.2


def farthest_m(aperture_m: float) -> float:
    """Returns the largest range that an array can measure, m."""
    return max(_FARTHEST_M, _FARTHEST_APERTURES * aperture_m)


class RangePosterior(NamedTuple):
    """Range of a source, and its direction at this range."""

    range: float
    """Mean range, m."""
    range_std: float
    """Standard deviation of the range, m."""
    u: NDArray[np.float64]
    """(d,) unit vector from the centroid of the microphones to the source."""
    covariance: NDArray[np.float64]
    """(d, d) covariance of the source position, which is u times the range, m^2."""


class _Kernel(NamedTuple):
    """Delays, microphones and errors of the array, as arguments of compiled code."""

    tau: NDArray[np.float64]
    own: NDArray[np.float64]
    p: NDArray[np.float64]
    frame: NDArray[np.float64]
    """(d, q) axes of the space in which directions are searched."""
    ahead: NDArray[np.float64]
    """(q,) unit vector perpendicular to a row or plane. Zeros if there is none."""
    of_places: NDArray[np.float64]
    speed_share: float
    delay_std: float
    c: float


def range_posterior(
    tau: NDArray[np.float64],
    covariance: NDArray[np.float64],
    shape: ArrayShape,
    budget: ArrayBudget,
    c: float,
    *,
    start: tuple[NDArray[np.float64], float, float],
    nearest_m: float,
) -> RangePosterior:
    """Estimates the range of a source, averaged over the unknown errors of the array.

    The (n - 1,) delays t_k - t_0 have the covariance of noise and reflections, s^2. The
    first estimate ``start`` is a (d,) direction, its inverse range, 1/m, and the
    standard deviation of the inverse range. More ranges are evaluated around this
    estimate. The ranges reach from ``nearest_m`` to ``farthest_m`` of the aperture.
    """
    u, w, w_std = start
    frame = (
        np.stack((shape.span[0], shape.ahead), axis=1)
        if shape.kind == "row" and shape.ahead is not None
        else np.eye(shape.dimension)
    )
    kernel = _Kernel(
        np.ascontiguousarray(tau),
        np.ascontiguousarray(covariance),
        shape.p_AM,
        np.ascontiguousarray(frame),
        np.zeros(frame.shape[1]) if shape.ahead is None else frame.T @ shape.ahead,
        np.ascontiguousarray(budget.of_places),
        budget.speed_std / c,
        budget.delay_std,
        c,
    )
    farthest = farthest_m(shape.aperture_m)
    ranges = np.geomspace(farthest, nearest_m, _RANGES)
    close = 1.0 / np.clip(w + w_std * _ABOUT, 1.0 / farthest, 1.0 / nearest_m)
    ranges = np.unique(np.concatenate((ranges, close)))[::-1].copy()
    likelihood = _log_likelihood(kernel, frame.T @ u, ranges)
    density, ranges = np.exp(likelihood - likelihood.max())[::-1], ranges[::-1]
    whole = np.trapezoid(density, ranges)
    mean = float(np.trapezoid(density * ranges, ranges) / whole)
    variance = np.trapezoid(density * (ranges - mean) ** 2, ranges) / whole
    std = float(np.sqrt(variance))
    a, of_p = _place(kernel, frame.T @ u, mean)
    direction = frame @ a
    along = float(direction @ of_p @ direction)
    stretch = np.eye(len(direction)) + (std / np.sqrt(along) - 1.0) * np.outer(
        direction, direction
    )
    return RangePosterior(mean, std, direction, stretch @ of_p @ stretch)


@njit(cache=True)
def _delays(
    kernel: _Kernel, u: NDArray[np.float64], r: float
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
]:  # pragma: no cover  (compiled)
    """Computes the (n - 1,) delays of a source at the distance r in the direction u, s.

    The other results are the (n - 1, d) derivatives of the delays with respect to the
    position, and the (n - 1, n - 1) covariance of all delay errors.
    """
    n, d = kernel.p.shape
    rays = np.empty((n, d))
    later = np.empty(n)
    for m in range(n):
        square = 0.0
        for i in range(d):
            rays[m, i] = u[i] * r - kernel.p[m, i]
            square += rays[m, i] ** 2
        later[m] = np.sqrt(square)
        for i in range(d):
            rays[m, i] /= max(later[m], 1e-9)
    tau = (later[1:] - later[0]) / kernel.c
    slopes = np.empty((n - 1, d))
    moved = np.zeros((n - 1, n * d))
    for k in range(n - 1):
        for i in range(d):
            slopes[k, i] = (rays[k + 1, i] - rays[0, i]) / kernel.c
            moved[k, (k + 1) * d + i] = -rays[k + 1, i] / kernel.c
            moved[k, i] = rays[0, i] / kernel.c
    whole = kernel.own + moved @ kernel.of_places @ moved.T
    for k in range(n - 1):
        for j in range(n - 1):
            whole[k, j] += kernel.speed_share**2 * tau[k] * tau[j]
            whole[k, j] += kernel.delay_std**2 * (2.0 if j == k else 1.0)
    return tau, slopes, whole


@njit(cache=True)
def _across(a: NDArray[np.float64]) -> NDArray[np.float64]:  # pragma: no cover
    """Returns (q, q - 1) orthonormal vectors perpendicular to a unit vector."""
    if a.size == 2:
        return np.array([[-a[1]], [a[0]]])
    return across(a)


@njit(cache=True)
def _turned(
    kernel: _Kernel, a: NDArray[np.float64], r: float
) -> tuple[NDArray[np.float64], float]:  # pragma: no cover  (compiled)
    """Finds the best direction at a range, and the logarithm of its likelihood.

    The likelihood is integrated over directions around the best one (Laplace).
    """
    # At a direction within the plane, the delays have no derivative out of the plane.
    off = np.sum(kernel.ahead**2) * _LEAST_OFF - np.sum(kernel.ahead * a)
    if off > 0.0:
        a = a + off * kernel.ahead
        a = a / np.sqrt(np.sum(a**2))
    value = 0.0
    for step in range(_STEPS + 1):
        tau, slopes, whole = _delays(kernel, kernel.frame @ a, r)
        root = np.linalg.inv(np.linalg.cholesky(whole))
        residual: NDArray[np.float64] = root @ (kernel.tau - tau)
        sides: NDArray[np.float64] = root @ slopes @ (kernel.frame @ _across(a)) * r
        normal = sides.T @ sides
        for i in range(len(normal)):
            normal[i, i] += 1e-12
        if step == _STEPS:
            value = -0.5 * np.sum(residual**2)
            value += np.sum(np.log(np.diag(root)))
            known = np.linalg.eigvalsh(normal)
            # Near a plane, the angle off the plane is the square root of a small
            # difference.
            least = max(1.0, 0.5 * np.sqrt(known[-1]))
            value -= 0.5 * np.sum(np.log(np.maximum(known, least)))
            break
        move = np.linalg.solve(normal, sides.T @ residual)
        length = np.sqrt(np.sum(move**2))
        if length > 0.3:
            move *= 0.3 / length
        a = a + _across(a) @ move
        a = a / np.sqrt(np.sum(a**2))
    return a, value


@njit(cache=True)
def _log_likelihood(
    kernel: _Kernel, a: NDArray[np.float64], ranges: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Returns the (k,) logarithms of the likelihood at k decreasing ranges."""
    out = np.empty(ranges.size)
    for k in range(ranges.size):
        a, out[k] = _turned(kernel, a, ranges[k])
    return out


@njit(cache=True)
def _place(
    kernel: _Kernel, a: NDArray[np.float64], r: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Returns the best direction at a range along the axes ``kernel.frame``.

    The other result is the (d, d) covariance of the source position, m^2.
    """
    a, _ = _turned(kernel, a, r)
    _, slopes, whole = _delays(kernel, kernel.frame @ a, r)
    root = np.linalg.inv(np.linalg.cholesky(whole))
    sides = root @ slopes @ kernel.frame
    of_a = np.linalg.pinv(sides.T @ sides)
    return a, kernel.frame @ of_a @ kernel.frame.T
