"""No avoidance at all: the lower anchor of every comparison."""

from __future__ import annotations

from typing import Any

from systems.laws.law import Equation, Law


def no_force(c: Any, s: Any, gains: Any) -> Any:
    """No push, N.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s.
        gains: Not used.

    Returns:
        Zero, of the type of c.
    """
    return 0.0 * c


NONE = Law(
    name="none",
    title="No avoidance",
    label="no avoidance",
    equations=(Equation("No avoidance", r"f = 0", "f = 0"),),
    force=no_force,
)
