"""Locates a source from the delays at microphones in any arrangement.

For three equally spaced microphones in a level row, the module uses the closed-form
solution of ``systems.hearing.near_field``. For all other arrays, it uses the iterative
fit of ``systems.hearing.delay_fit``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.hearing import near_field
from systems.hearing.delay_fit import DelayProblem, fit_delays
from systems.hearing.source_fix import RANGED, SourceFix
from systems.sound.array_shape import ArrayShape


def locate_source(
    tau: NDArray[np.float64],
    covariance: NDArray[np.float64],
    shape: ArrayShape,
    c: float,
) -> SourceFix:
    """Computes the position or the direction from which a sound comes.

    If the range exceeds its standard deviation, the range is valid. Otherwise the
    direction is that of a source far away.

    If the iterative fit computes this direction, the error of the direction includes
    the effect of the unknown range. The fit then assumes that the inverse range has the
    standard deviation 1 / (2 a), where a is the aperture of the array.

    Args:
        tau: (n - 1,) delays t_k - t_0 of microphones 1 ... n - 1, s. t_k is the time of
            arrival at microphone k.
        covariance: (n - 1, n - 1) covariance of the delays, s^2.
        shape: The n microphones.
        c: Speed of sound, m/s.

    Returns:
        The source on the side of ``shape.ahead``.
    """
    if shape.equal_row is not None and shape.angles == ("bearing",):
        fix = near_field.locate_in_row(tau, covariance, shape.equal_row, c)
        return fix.within_error(1.0)
    u, w, variance, of_u, of_p, chi_square, twin, status = fit_delays(
        DelayProblem(
            c * np.asarray(tau, dtype=np.float64),
            whitening_matrix(covariance) / c,
            shape.p_AM,
            shape.span,
            np.zeros(shape.dimension) if shape.ahead is None else shape.ahead,
        ),
        0.5 / shape.aperture_m,
    )
    valid = status == RANGED
    bearing_std, elevation, elevation_std = angles_of(u, of_u, shape)
    return SourceFix(
        bearing=math.atan2(u[1], u[0]),
        bearing_std=bearing_std,
        elevation=elevation,
        elevation_std=elevation_std,
        range=1.0 / w if valid else 0.0,
        range_status=status,
        range_std=math.sqrt(variance) / (w * w) if valid else math.inf,
        p_AS=u / w if valid else u,
        covariance=of_p,
        chi_square=chi_square,
        twin=twin if twin.any() else None,
    )


def whitening_matrix(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns L^-1 for a covariance L L^T, even if rounding makes it singular."""
    floor = 1e-12 * np.diag(covariance) + 1e-30
    return np.linalg.inv(np.linalg.cholesky(covariance + np.diag(floor)))


def angles_of(
    u: NDArray[np.float64], of_u: NDArray[np.float64], shape: ArrayShape
) -> tuple[float, float | None, float | None]:
    """Computes the elevation of a direction, and the errors of its angles.

    Args:
        u: (d,) unit vector of the direction.
        of_u: (d, d) covariance of u.
        shape: The array, which may not measure every angle.

    Returns:
        Three values, rad: standard deviation of the azimuth, elevation, and standard
        deviation of the elevation. In the plane, or for a level row, the last two are
        None. If the array does not measure an angle, its standard deviation is
        infinite.
    """
    level = math.hypot(u[0], u[1])
    x, y = (u[0] / level, u[1] / level) if level > 0.0 else (1.0, 0.0)
    cosine = max(level, near_field.LEAST_COSINE)
    variance = y * y * of_u[0, 0] - 2.0 * x * y * of_u[0, 1] + x * x * of_u[1, 1]
    bearing_std = math.sqrt(max(variance, 0.0)) / cosine
    if shape.dimension == 2 or shape.angles == ("bearing",):
        return bearing_std, None, None
    known = "elevation" in shape.angles
    return (
        bearing_std if "bearing" in shape.angles else math.inf,
        math.atan2(u[2], math.hypot(u[0], u[1])),
        math.sqrt(of_u[2, 2]) / cosine if known else math.inf,
    )
