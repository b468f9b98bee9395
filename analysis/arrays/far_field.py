"""Estimates the direction of a source that is so far away that its waves are plane.

The delays are then linear in the direction u: tau_k = (p_0 - p_k) . u / c. A row of
microphones measures one component of u, and a plane of microphones measures two. The
remaining component is perpendicular to the row or plane. It follows from the condition
that u has the length 1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.hearing.multilateration import angles_of, whitening_matrix
from systems.hearing.source_fix import PLANE_WAVE, SourceFix
from systems.sound.array_shape import ArrayShape

_STEPS = 8


def locate_far_source(
    tau: NDArray[np.float64],
    covariance: NDArray[np.float64],
    shape: ArrayShape,
    c: float,
    tolerance: NDArray[np.float64] | None = None,
    *,
    inverse_range_std: float = 0.0,
) -> SourceFix:
    """Estimates the direction of a distant source from (n - 1,) delays t_k - t_0.

    The matrix ``tolerance`` is the (n - 1, n - 1) covariance of further errors, s^2.
    They affect the weights of the delays and chi-square, but not the standard
    deviations of the result. The prior ``inverse_range_std``, 1/m, states how uncertain
    it is that the waves are plane. If it is positive and the delays do not determine
    the curvature, the standard deviations of the result increase. The result has no
    range, and is on the side of ``shape.ahead``.
    """
    slopes = (shape.p_AM[0] - shape.p_AM[1:]) / c
    whole = covariance if tolerance is None else covariance + tolerance
    root = whitening_matrix(whole)
    if shape.ahead is None:
        u, basis = _on_sphere(root @ slopes, root @ tau)
    else:
        u, basis = _off_array(root @ slopes, root @ tau, shape)
    gain = np.linalg.pinv(root @ slopes @ basis) @ root
    of_u = basis @ gain @ covariance @ gain.T @ basis.T
    if inverse_range_std > 0.0:
        # Compared with a plane wave, a wave front from the distance 1/w reaches a
        # microphone at p later by w |p - (p . u) u|^2 / 2c.
        square = np.sum(shape.p_AM**2, axis=1) - (shape.p_AM @ u) ** 2
        curved = root @ (square[1:] - square[0]) / (2.0 * c)
        within = root @ (slopes @ basis)
        turned = np.linalg.pinv(within) @ curved
        seen = curved - within @ turned
        bend = turned / math.sqrt(float(seen @ seen) + inverse_range_std**-2)
        of_u += basis @ np.outer(bend, bend) @ basis.T
    residual = root @ (tau - slopes @ u)
    bearing_std, elevation, elevation_std = angles_of(u, of_u, shape)
    return SourceFix(
        bearing=math.atan2(u[1], u[0]),
        bearing_std=bearing_std,
        elevation=elevation,
        elevation_std=elevation_std,
        range=0.0,
        range_status=PLANE_WAVE,
        range_std=math.inf,
        p_AS=u,
        covariance=of_u,
        chi_square=float(residual @ residual),
    )


def _on_sphere(
    slopes: NDArray[np.float64], tau: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the unit vector that best fits whitened delays, and a basis across it."""
    u = _least_squares(slopes, tau)
    u /= max(float(np.linalg.norm(u)), 1e-12)
    for _ in range(_STEPS):
        basis = np.linalg.svd(u[np.newaxis])[2][1:].T
        step = _least_squares(slopes @ basis, tau - slopes @ u)
        u = u + basis @ step
        u /= max(float(np.linalg.norm(u)), 1e-12)
    return u, np.linalg.svd(u[np.newaxis])[2][1:].T


def _off_array(
    slopes: NDArray[np.float64], tau: NDArray[np.float64], shape: ArrayShape
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the unit vector that best fits whitened delays of a row or plane.

    The component perpendicular to the row or plane follows from the unit length. The
    other result contains the (d, r) derivatives of the vector with respect to its r
    components along the array.
    """
    assert shape.ahead is not None
    span = shape.span
    within = slopes @ span.T
    v = _least_squares(within, tau)
    length = float(np.linalg.norm(v))
    if length > 1.0:
        # The delays are longer than the array allows. The source is then in its line or
        # plane.
        v = _on_sphere(within, tau)[0] if len(v) > 1 else v / length
    off = math.sqrt(max(0.0, 1.0 - float(v @ v)))
    # The perpendicular component is the square root of a small difference. Its error is
    # at most the square root of the error of this difference.
    spread = np.linalg.pinv(within)
    floor = math.sqrt(max(float(np.linalg.norm(spread @ spread.T, 2)), 0.0))
    basis = span.T - np.outer(shape.ahead, v) / max(off, math.sqrt(floor), 1e-6)
    return v @ span + off * shape.ahead, basis


def _least_squares(
    slopes: NDArray[np.float64], tau: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.asarray(np.linalg.lstsq(slopes, tau, rcond=None)[0], dtype=np.float64)
