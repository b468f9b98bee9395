"""The cubic polynomial between two instants with known values and slopes."""

from __future__ import annotations

from typing import Any

from systems.framework.signals import TICK_S


def value_weights(s: Any) -> tuple[Any, Any, Any]:
    """Computes the weights of the cubic Hermite polynomial over a tick.

    Args:
        s: Elapsed share of the tick, from 0 to 1.

    Returns:
        Weight of the difference of both values, 1; weights of the slopes at the start
        and at the end, s.
    """
    rest = TICK_S * s * (1.0 - s)
    return s * s * (3.0 - 2.0 * s), rest * (1.0 - s), -rest * s
