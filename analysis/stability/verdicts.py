"""Numbers against thresholds: pass, fail, or not applicable, in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

#: Unit of what is true or not: 1 or 0.
YES_OR_NO = "yes or no"

Judgement = Literal["pass", "fail", "not applicable"]


@dataclass(frozen=True)
class Criterion:
    """What is asked of a number."""

    name: str
    unit: str
    sense: Literal["at least", "above", "at most", "below"]
    limit: float
    good: str
    """What it means that the number meets the limit; a clause."""
    bad: str
    """What it means that it does not; a clause."""
    source: str
    """Where the limit comes from."""

    @property
    def threshold(self) -> str:
        """In signs, with the unit."""
        if self.unit == YES_OR_NO:
            return "yes"
        sign = {"at least": "\u2265", "above": ">", "at most": "\u2264", "below": "<"}
        return f"{sign[self.sense]} {self.limit:.4g} {self.unit}".rstrip()

    def met_by(self, value: float) -> bool:
        """Whether a number meets the limit; an infinite one may."""
        return {
            "at least": value >= self.limit,
            "above": value > self.limit,
            "at most": value <= self.limit,
            "below": value < self.limit,
        }[self.sense]


@dataclass(frozen=True)
class Verdict:
    """A number, its threshold, and what follows."""

    name: str
    value: float | None
    """None where there is no such number."""
    unit: str
    threshold: str
    verdict: Judgement
    text: str
    """In plain words."""
    source: str
    """Of the threshold."""


@dataclass(frozen=True)
class VerdictRow:
    """One criterion, law by law."""

    name: str
    unit: str
    threshold: str
    values: dict[str, float | None]
    verdicts: dict[str, Judgement]
    text: str
    """In plain words, laws of the same verdict together."""


def shown_value(value: float | None, unit: str) -> float | str | None:
    """What a table shows of a number: yes or no, where it stands for that.

    Args:
        value: Of a verdict.
        unit: Its unit.

    Returns:
        The number, a word, or None where there is none.
    """
    if value is None or unit != YES_OR_NO:
        return value
    return "yes" if value else "no"


def judge(criterion: Criterion, value: float | None, reason: str = "") -> Verdict:
    """Holds a number against a criterion.

    Args:
        criterion: What is asked.
        value: The number; none where there is none.
        reason: Why there is none; a clause.

    Returns:
        Pass, fail or not applicable, with a text.
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
    """The same criteria side by side, in the order of the first law's."""
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
    """Laws with one text before it, group by group."""
    groups: dict[str, list[str]] = {}
    for law, verdict in found.items():
        groups.setdefault(verdict.text, []).append(law)
    if len(found) == 1:
        return f"{next(iter(groups))}."
    if len(groups) == 1:
        subject = "All" if len(found) > 2 else " and ".join(found)
        return f"{subject}: {next(iter(groups))}."
    return " ".join(f"{' and '.join(laws)}: {text}." for text, laws in groups.items())
