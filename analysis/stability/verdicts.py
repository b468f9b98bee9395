"""Verdicts on numbers: pass, fail, or not applicable, with a text in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

#: Unit of a number that is 1 for true and 0 for false.
YES_OR_NO = "yes or no"

Judgement = Literal["pass", "fail", "not applicable"]


@dataclass(frozen=True)
class Criterion:
    """A criterion compares a number with a threshold."""

    name: str
    unit: str
    sense: Literal["at least", "above", "at most", "below"]
    limit: float
    good: str
    """What follows if the number meets the threshold; a clause."""
    bad: str
    """What follows if the number does not meet the threshold; a clause."""
    source: str
    """Where the threshold comes from."""

    @property
    def threshold(self) -> str:
        """The threshold as text, with its sign and unit."""
        if self.unit == YES_OR_NO:
            return "yes"
        sign = {"at least": "\u2265", "above": ">", "at most": "\u2264", "below": "<"}
        return f"{sign[self.sense]} {self.limit:.4g} {self.unit}".rstrip()

    def met_by(self, value: float) -> bool:
        """Returns whether a number meets the threshold; the number may be infinite."""
        return {
            "at least": value >= self.limit,
            "above": value > self.limit,
            "at most": value <= self.limit,
            "below": value < self.limit,
        }[self.sense]


@dataclass(frozen=True)
class Verdict:
    """The verdict on one number."""

    name: str
    value: float | None
    """The number, or None if it does not exist."""
    unit: str
    threshold: str
    verdict: Judgement
    text: str
    """The verdict in plain words."""
    source: str
    """Where the threshold comes from."""


@dataclass(frozen=True)
class VerdictRow:
    """The verdicts of all laws on one criterion."""

    name: str
    unit: str
    threshold: str
    values: dict[str, float | None]
    verdicts: dict[str, Judgement]
    text: str
    """The verdicts in plain words. Laws with the same text share one sentence."""


def shown_value(value: float | None, unit: str) -> float | str | None:
    """Returns a value in the form in which a table shows it.

    Args:
        value: Value of a verdict, or None if it does not exist.
        unit: Unit of the value.

    Returns:
        If the unit is ``YES_OR_NO``, the word "yes" or "no". Otherwise, the value. If
        the value does not exist, None.
    """
    if value is None or unit != YES_OR_NO:
        return value
    return "yes" if value else "no"


def judge(criterion: Criterion, value: float | None, reason: str = "") -> Verdict:
    """Compares a number with the threshold of a criterion.

    Args:
        criterion: The criterion with the threshold.
        value: The number, or None if it does not exist.
        reason: Why the number does not exist; a clause.

    Returns:
        A verdict (pass, fail, or not applicable) with a text.
    """
    if value is None:
        verdict: Judgement = "not applicable"
        text = reason or "this law has no such number"
    elif criterion.met_by(value):
        verdict, text = "pass", criterion.good
    else:
        verdict, text = "fail", criterion.bad
    return Verdict(
        criterion.name,
        value,
        criterion.unit,
        criterion.threshold,
        verdict,
        text,
        criterion.source,
    )


def compare_verdicts(
    by_law: dict[str, Sequence[Verdict]],
) -> tuple[VerdictRow, ...]:
    """Puts the verdicts of several laws side by side, in the order of the first law."""
    laws = list(by_law)
    rows = []
    for first in by_law[laws[0]]:
        found = {
            law: next(v for v in verdicts if v.name == first.name)
            for law, verdicts in by_law.items()
        }
        rows.append(
            VerdictRow(
                first.name,
                first.unit,
                first.threshold,
                {law: verdict.value for law, verdict in found.items()},
                {law: verdict.verdict for law, verdict in found.items()},
                _together(found),
            )
        )
    return tuple(rows)


def _together(found: dict[str, Verdict]) -> str:
    """Joins the texts of all laws. Laws with the same text share one sentence."""
    groups: dict[str, list[str]] = {}
    for law, verdict in found.items():
        groups.setdefault(verdict.text, []).append(law)
    if len(found) == 1:
        return f"{next(iter(groups))}."
    if len(groups) == 1:
        subject = "All" if len(found) > 2 else " and ".join(found)
        return f"{subject}: {next(iter(groups))}."
    return " ".join(f"{' and '.join(laws)}: {text}." for text, laws in groups.items())
