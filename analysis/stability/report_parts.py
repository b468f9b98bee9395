"""The parts of a stability report, in order."""

from __future__ import annotations

from analysis.stability.certificate_parts import certificate_parts
from analysis.stability.chart_parts import chart_parts
from analysis.stability.extended_parts import extended_parts
from analysis.stability.gain_parts import contact_parts, gain_parts
from analysis.stability.law_analysis import Part
from analysis.stability.linear_parts import linear_parts
from analysis.stability.margin_parts import margin_parts
from analysis.stability.robustness_parts import robustness_parts
from analysis.stability.sampled_parts import sampled_parts
from analysis.stability.step_parts import step_parts
from analysis.stability.velocity_parts import velocity_parts
from analysis.stability.verdict_parts import verdict_parts

__all__ = ["parts"]


def parts(*, full: bool) -> tuple[Part, ...]:
    """The parts of a report.

    Args:
        full: Also those that take minutes.
    """
    return (
        *linear_parts(),
        *step_parts(full=full),
        *margin_parts(),
        *sampled_parts(full=full),
        *chart_parts(),
        *contact_parts(),
        *velocity_parts(),
        *certificate_parts(full=full),
        *robustness_parts(full=full),
        *(extended_parts() if full else ()),
        *gain_parts(),
        *verdict_parts(),
    )
