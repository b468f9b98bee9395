"""The cubic polynomial between two instants with known values and slopes."""

from __future__ import annotations

from typing import Any

from systems.framework.signals import TICK_S


def value_weights(s: Any) -> tuple[Any, Any, Any]:
    """Computes the weights p, q, and r of the cubic Hermite polynomial over a tick.

    A tick starts with the value a and the slope a', and ends with the value b and the
    slope b'. The value in between is a + p (b - a) + q a' + r b'.

    Args:
        s: Elapsed share of the tick, from 0 to 1.

    Returns:
        (p, q, r). p has no unit, q and r are in s.
    """
    rest = TICK_S * s * (1.0 - s)
    return s * s * (3.0 - 2.0 * s), rest * (1.0 - s), -rest * s
