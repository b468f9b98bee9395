"""The cubic polynomial between two instants of which values and slopes are known."""

from __future__ import annotations

from typing import Any

from systems.framework.signals import TICK_S


def value_weights(s: Any) -> tuple[Any, Any, Any]:
    """Weights of the cubic Hermite polynomial over a tick.

    Args:
        s: Share of the tick that has passed, from 0 to 1.

    Returns:
        Of the difference of both values, and of the slopes at begin and end, s.
    """
    rest = TICK_S * s * (1.0 - s)
    return s * s * (3.0 - 2.0 * s), rest * (1.0 - s), -rest * s
