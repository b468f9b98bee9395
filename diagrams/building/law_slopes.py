"""Derivatives of a user's own force law, if Drake cannot differentiate its function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd

from systems.framework.differences import STEP


def force_with_slopes(
    law: Callable[[Any, Any], Any], c: Any, s: Any
) -> tuple[Any, str]:
    """Returns the force of a law, with derivatives even if Drake cannot compute them.

    Distances and speeds are never negative. Near 0, the differences are one-sided.

    Args:
        law: Function ``law(c, s)`` that returns the force, N.
        c: Distance, m, float or AutoDiffXd.
        s: Speed, m/s, float or AutoDiffXd.

    Returns:
        The force, N, and why its derivatives are differences. The reason is empty if
        Drake differentiates the law, or if ``c`` and ``s`` are floats.
    """
    if not isinstance(c, AutoDiffXd) and not isinstance(s, AutoDiffXd):
        return law(c, s), ""
    why = ""
    try:
        force = law(c, s)
    except Exception as error:  # noqa: BLE001  # whatever a user's function raises
        why = f"{type(error).__name__}: {error}"
    else:
        if isinstance(force, np.ndarray) and force.shape == ():
            force = force.item()
        if isinstance(force, AutoDiffXd):
            return force, ""
    (at, by), (speed, by_speed) = _parts(c), _parts(s)
    force = float(law(at, speed))
    slope = _slope(lambda x: law(x, speed), at) if np.any(by) else 0.0
    speed_slope = _slope(lambda x: law(at, x), speed) if np.any(by_speed) else 0.0
    if slope == 0.0 == speed_slope:
        return force, why
    gradient: Any = np.atleast_1d(slope * by + speed_slope * by_speed)
    return AutoDiffXd(force, gradient), why or "it returns a force without derivatives"


def _parts(value: Any) -> tuple[float, Any]:
    """Splits a number into its value and its derivatives."""
    if isinstance(value, AutoDiffXd):
        found = np.asarray(value.derivatives(), dtype=float)
        return float(value.value()), found if found.size else 0.0
    return float(value), 0.0


def _slope(function: Callable[[float], Any], x: float) -> float:
    h = STEP * max(1.0, x)
    if x > h:
        return (float(function(x + h)) - float(function(x - h))) / (2.0 * h)
    here, near, far = (float(function(x + k * h)) for k in range(3))
    return (4.0 * near - 3.0 * here - far) / (2.0 * h)
