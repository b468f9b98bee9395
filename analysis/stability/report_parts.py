"""The parts of a stability report, in order."""

from __future__ import annotations

from analysis.stability.law_analysis import Part
from analysis.stability.linear_parts import linear_parts
from analysis.stability.margin_parts import margin_parts
from analysis.stability.nonlinear_parts import extended_parts, nonlinear_parts
from analysis.stability.robustness_parts import robustness_parts
from analysis.stability.sampling_parts import gain_parts, sampling_parts
from analysis.stability.verdict_parts import verdict_parts

__all__ = ["parts"]


def parts(*, full: bool) -> tuple[Part, ...]:
    """The parts of a report.

    Args:
        full: Also those that take minutes.
    """
    return (
        *linear_parts(full=full),
        *margin_parts(),
        *sampling_parts(full=full),
        *nonlinear_parts(full=full),
        *robustness_parts(full=full),
        *(extended_parts() if full else ()),
        *gain_parts(),
        *verdict_parts(),
    )
