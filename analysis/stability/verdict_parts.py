"""The last part of the stability report, which compares numbers with thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from analysis.reporting.html_page import Cell, table
from analysis.stability.law_analysis import Part, Study
from analysis.stability.verdict_readings import CRITERIA, Reading
from analysis.stability.verdicts import Criterion, Verdict, judge, shown_value


def verdict_parts(
    criteria: Mapping[Criterion, Callable[[Study], Reading]] = CRITERIA,
) -> tuple[Part, ...]:
    """Returns the part that compares the results of all earlier parts with thresholds.

    Args:
        criteria: The criteria, each with the function that reads its number.

    Returns:
        A tuple that contains this one part.
    """
    return (
        Part(
            "verdicts",
            "Verdicts",
            lambda study: _verdicts(study, criteria),
            _render,
            fresh=True,
        ),
    )


def _verdicts(
    study: Study, criteria: Mapping[Criterion, Callable[[Study], Reading]]
) -> tuple[Verdict, ...]:
    verdicts = []
    for criterion, read in criteria.items():
        value = read(study)
        if isinstance(value, str):
            verdicts.append(judge(criterion, None, value))
        elif math.isnan(value):
            verdicts.append(judge(criterion, None, "there is no such number"))
        else:
            verdicts.append(judge(criterion, value))
    return tuple(verdicts)


def _render(data: tuple[Verdict, ...], name: str) -> list[str]:
    rows: list[list[Cell]] = [
        [v.name, shown_value(v.value, v.unit), v.threshold, v.verdict, v.text, v.source]
        for v in data
    ]
    headings = [
        "criterion",
        "value",
        "threshold",
        "verdict",
        "in plain words",
        "source",
    ]
    return [table(headings, rows)]
