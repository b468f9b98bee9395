"""The parts of a stability report, in order."""

from __future__ import annotations

from analysis.stability import Part

__all__ = ["parts"]


def parts(*, full: bool) -> tuple[Part, ...]:
    """The parts of a report.

    Args:
        full: Also those that take minutes.
    """
    return ()
