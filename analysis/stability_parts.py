"""The parts of a stability report, in order."""

from __future__ import annotations

from analysis.linear_parts import linear_parts
from analysis.robustness_parts import robustness_parts
from analysis.stability import Part

__all__ = ["parts"]


def parts(*, full: bool) -> tuple[Part, ...]:
    """The parts of a report.

    Args:
        full: Also those that take minutes.
    """
    return (*linear_parts(), *robustness_parts(full=full))
