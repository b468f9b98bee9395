"""Mean concentration of a source in a steady wind, in closed form."""

from __future__ import annotations

import math
from typing import Any

from systems.framework.compiling import njit

#: From here on the series of ``scaled_erfc`` is right to double precision.
_ASYMPTOTIC = 12.0


@njit(cache=True)
def scaled_erfc(x: float) -> float:  # pragma: no cover  (compiled)
    """exp(x^2) erfc(x) without overflow, for x >= 0.

    Args:
        x: At least 0.

    Returns:
        From 1 downwards, right to 1e-12 of itself.
    """
    if x < 5.0:
        return math.exp(x * x) * math.erfc(x)
    if x < _ASYMPTOTIC:
        # Continued fraction of Laplace, from its end; 60 terms are enough from 5 on.
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
    """exp(-cut) (1 + sqrt(2 pi) s exp(s^2/2) Phi(s)), for s^2/2 <= cut."""
    if s < 0.0:
        # Phi(s) exp(s^2/2) is half the scaled erfc of -s/sqrt(2).
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
    """Concentration of puffs that grow as they go (Song 2011, eq. 1 to 6).

    The integral of eq. 1 with sigma_x = a t, sigma_y = b t, sigma_z = c t, which alone
    leads to eq. 6: there a = b = gamma_1, c = gamma_2, z = H = 0.

    Args:
        x: Downwind of the source, m; may be upwind.
        y: Across, m.
        z: Above the floor, m.
        height: H of the source, m.
        rate: Q, amount a second.
        speed: u of the wind, m/s, above 0.
        spreads: (a, b, c), m/s.

    Returns:
        Amount a cubic metre; reflected by the floor.
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
    """Concentration with eddy diffusivities that grow downwind (Sharan 1996).

    For a source on the floor; the flux through each x is exactly Q.

    Args:
        x: Downwind, m; 0 upwind.
        y: Across, m.
        z: Above the floor, m.
        rate: Q, amount a second.
        speed: u of the wind, m/s.
        intensities: (alpha, beta, gamma), each sigma^2 / x^2 of its direction.

    Returns:
        Amount a cubic metre.
    """
    if x <= 0.0:
        return 0.0
    alpha, beta, gamma = intensities
    off = (y * y / beta + z * z / gamma) / (x * x)
    factor = rate / (math.pi * speed * math.sqrt(beta * gamma) * x * x)
    return factor * (1.0 + alpha * off) ** (-1.0 - 0.5 / alpha)
