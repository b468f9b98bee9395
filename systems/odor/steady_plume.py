"""Closed form of the mean concentration of a source in a steady wind."""

from __future__ import annotations

import math
from typing import Any

from systems.framework.compiling import njit

#: From this x on, the series of ``scaled_erfc`` is accurate to double precision.
_ASYMPTOTIC = 12.0


@njit(cache=True)
def scaled_erfc(x: float) -> float:  # pragma: no cover  (compiled)
    """Computes exp(x^2) erfc(x) without overflow, for ``x`` of at least 0.

    The relative error is at most 1e-12.
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
    x: float, y: float, rate: float, speed: float, spreads: Any
) -> float:  # pragma: no cover  (compiled)
    """Computes the mean concentration of odor in a steady wind (Song 2011, eq. 6).

    The source is on the floor (H = 0). It releases puffs that grow while the wind
    carries them. The floor reflects the odor, and thereby doubles the concentration.
    The result is the integral of eq. 1 over t, the time since the release of a puff.
    The spreads (standard deviations) of a puff are sigma_x = a t, sigma_y = b t and
    sigma_z = c t. With a = b = gamma_1 and c = gamma_2, the result is eq. 6.

    Args:
        x: Distance downwind of the source, m; negative upwind.
        y: Distance from the axis of the plume, across the wind, m.
        rate: Amount of odor released per second.
        speed: Speed of the wind, above 0, m/s.
        spreads: (a, b, c), growth of the spreads, m/s.

    Returns:
        Concentration, amount per cubic meter.
    """
    a, b, c = spreads
    factor = rate / ((2.0 * math.pi) ** 1.5 * a * b * c)
    along, cut = x / (a * a), 0.5 * (speed / a) ** 2
    far = max((x / a) ** 2 + (y / b) ** 2, 1e-30)
    s = speed * along / math.sqrt(far)
    return 2.0 * (factor / far * _kernel(s, cut))
