"""The law without avoidance, which serves as the lower bound in comparisons."""

from __future__ import annotations

from typing import Any

from systems.laws.law import Equation, Law


def no_force(c: Any, s: Any, gains: Any) -> Any:
    """Returns a force of zero, N, with the scalar type of the distance ``c``."""
    return 0.0 * c


NONE = Law(
    name="none",
    title="No avoidance",
    label="no avoidance",
    equations=(Equation("No avoidance", r"f = 0", "f = 0"),),
    force=no_force,
)
