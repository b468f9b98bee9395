"""Closed form of the mean concentration of a source in a steady wind."""

from __future__ import annotations

import math
from typing import Any

from systems.framework.compiling import njit

#: From this x on, the series of ``scaled_erfc`` is accurate to double precision.
_ASYMPTOTIC = 12.0


@njit(cache=True)
def scaled_erfc(x: float) -> float:  # pragma: no cover  (compiled)
    """Computes exp(x^2) erfc(x) without overflow.

    Args:
        x: Argument, at least 0.

    Returns:
        Value above 0 and up to 1, with a relative error of at most 1e-12.
    """
    if x < 5.0:
        return math.exp(x * x) * math.erfc(x)
    if x < _ASYMPTOTIC:
        # Continued fraction of Laplace, from its end. For x >= 5, 60 terms are enough.
        tail = x
        for k in range(60, 0, -1):
            tail = x + 0.5 * k / tail
        return 1.0 / (math.sqrt(math.pi) * tail)
    y, term, total = 0.5 / (x * x), 1.0, 1.0
    for k in range(1, 9):
        term *= -(2 * k - 1) * y
        total += term
    return total / (x * math.sqrt(math.pi))


@njit(cache=True)
def _kernel(s: float, cut: float) -> float:  # pragma: no cover  (compiled)
    """Computes exp(-cut) (1 + sqrt(2 pi) s exp(s^2/2) Phi(s)), for s^2/2 <= cut."""
    if s < 0.0:
        # Phi(s) exp(s^2/2) is half of scaled_erfc(-s / sqrt(2)).
        tail = 0.5 * scaled_erfc(-s / math.sqrt(2.0))
        return math.exp(-cut) * (1.0 + math.sqrt(2.0 * math.pi) * s * tail)
    phi = 0.5 * math.erfc(-s / math.sqrt(2.0))
    big = math.exp(0.5 * s * s - cut)
    return math.exp(-cut) + math.sqrt(2.0 * math.pi) * s * big * phi


@njit(cache=True)
def steady_concentration(
    x: float,
    y: float,
    z: float,
    height: float,
    rate: float,
    speed: float,
    spreads: Any,
) -> float:  # pragma: no cover  (compiled)
    """Computes the mean concentration of growing puffs (Song 2011, eq. 1 to 6).

    The result is the integral of eq. 1 over the time t since the release of a puff. The
    spreads are sigma_x = a t, sigma_y = b t and sigma_z = c t. Only these spreads lead
    to eq. 6, where a = b = gamma_1, c = gamma_2 and z = H = 0. The floor reflects the
    odor: a mirror image of the source below the floor adds the second term.

    Args:
        x: Distance downwind of the source, m. Negative: upwind.
        y: Distance across the wind, m.
        z: Height above the floor, m.
        height: H, height of the source, m.
        rate: Q, amount per second.
        speed: u, speed of the wind, above 0, m/s.
        spreads: (a, b, c), growth of the spreads, m/s.

    Returns:
        Concentration, amount per cubic meter.
    """
    a, b, c = spreads
    factor = rate / ((2.0 * math.pi) ** 1.5 * a * b * c)
    along, cut = x / (a * a), 0.5 * (speed / a) ** 2
    total = 0.0
    for lift in (z - height, z + height):
        far = (x / a) ** 2 + (y / b) ** 2 + (lift / c) ** 2
        far = max(far, 1e-30)
        s = speed * along / math.sqrt(far)
        total += factor / far * _kernel(s, cut)
    return total


@njit(cache=True)
def sharan_concentration(
    x: float,
    y: float,
    z: float,
    rate: float,
    speed: float,
    intensities: Any,
) -> float:  # pragma: no cover  (compiled)
    """Computes the concentration with diffusivities that grow downwind (Sharan 1996).

    The source is on the floor. The flux through each plane across the wind is exactly
    Q. The concentration upwind of the source is 0.

    Args:
        x: Distance downwind of the source, m.
        y: Distance across the wind, m.
        z: Height above the floor, m.
        rate: Q, amount per second.
        speed: u, speed of the wind, m/s.
        intensities: (alpha, beta, gamma), the values of sigma^2 / x^2 along the wind,
            across the wind, and in the vertical direction.

    Returns:
        Concentration, amount per cubic meter.
    """
    if x <= 0.0:
        return 0.0
    alpha, beta, gamma = intensities
    off = (y * y / beta + z * z / gamma) / (x * x)
    factor = rate / (math.pi * speed * math.sqrt(beta * gamma) * x * x)
    return factor * (1.0 + alpha * off) ** (-1.0 - 0.5 / alpha)
