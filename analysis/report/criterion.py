"""Criteria for numbers, and the verdicts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar, cast

#: Unit of a number that is 1 for true and 0 for false.
YES_OR_NO = "yes or no"

Judgment = Literal["pass", "fail", "undecided", "not applicable"]


@dataclass(frozen=True)
class Bounds:
    """A worst case that is known from two sides."""

    found: float
    """Value of the worst case that was found."""
    proven: float
    """Value that no case passes."""


#: A number, a number from two sides, or a clause that states why there is no number.
Reading = float | Bounds | str

Data = TypeVar("Data")

#: Text of the verdict ``undecided``.
_UNDECIDED = (
    "no case was found that does not meet the threshold, but it is not proven that "
    "there is none"
)


@dataclass(frozen=True)
class Criterion(Generic[Data]):
    """A comparison of a number with a threshold.

    The number comes from ``Data``, the data of a section of a report.
    """

    name: str
    unit: str
    sense: Literal["at least", "above", "at most", "below"]
    limit: float
    good: str
    """Clause that states what follows if the number meets the threshold."""
    bad: str
    """Clause that states what follows if the number does not meet the threshold."""
    source: str
    """Where the threshold comes from."""
    read: Callable[[Data], Reading]
    """Takes the number from the data of the section. If there is no such number, the
    result is NaN, or a clause with the reason."""
    where: Callable[[Data], str] = lambda data: ""
    """States which of several parts of the system has the number, for example which
    cut loop has the least margin. Empty if there is only one part."""

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

    def judge(self, data: Data) -> Verdict:
        """Compares the number in the data of a section with the threshold."""
        value = self.read(data)
        if isinstance(value, str):
            return self.without_number(value)
        proven = None
        if isinstance(value, Bounds):
            proven, value = value.proven, value.found
        if math.isnan(value):
            return self.without_number("there is no such number")
        met = self.met_by(value)
        where = self.where(data)
        if met and proven is not None and not self.met_by(proven):
            return self._verdict(value, "undecided", _UNDECIDED, where, proven)
        word, text = ("pass", self.good) if met else ("fail", self.bad)
        return self._verdict(float(value), cast("Judgment", word), text, where, proven)

    def without_number(self, reason: str) -> Verdict:
        """Returns the verdict ``not applicable``; ``reason`` is its text, a clause."""
        return self._verdict(None, "not applicable", reason)

    def _verdict(
        self,
        value: float | None,
        verdict: Judgment,
        text: str,
        where: str = "",
        proven: float | None = None,
    ) -> Verdict:
        return Verdict(
            name=self.name,
            value=value,
            where=where,
            unit=self.unit,
            threshold=self.threshold,
            verdict=verdict,
            text=text,
            source=self.source,
            proven=proven,
        )


@dataclass(frozen=True)
class Verdict:
    """The verdict on one number."""

    name: str
    value: float | None
    """The number, or None if it does not exist."""
    where: str
    """Part of the system that has the number; empty if there is only one part."""
    unit: str
    threshold: str
    verdict: Judgment
    text: str
    """Clause that states what follows, or why there is no number."""
    source: str
    """Where the threshold comes from."""
    proven: float | None = None
    """Value that no case passes, if ``value`` is the worst case found and a bound is
    known."""


@dataclass(frozen=True)
class VerdictRow:
    """The verdicts on several laws by one criterion."""

    name: str
    unit: str
    threshold: str
    values: dict[str, float | None]
    proven: dict[str, float | None]
    """Values that no case passes, see ``Verdict``."""
    verdicts: dict[str, Judgment]
    text: str
    """Texts of the verdicts. Laws with the same text share one sentence. With a single
    law, the text also states where the number is from."""


def compare_verdicts(by_law: Mapping[str, Sequence[Verdict]]) -> tuple[VerdictRow, ...]:
    """Makes one row per criterion, with the verdicts on several laws side by side.

    The rows have the order of the verdicts on the first law. The verdicts on all laws
    must be by the same criteria.
    """
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
                {law: verdict.proven for law, verdict in found.items()},
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
        only = next(iter(found.values()))
        return f"{only.text} ({only.where})." if only.where else f"{only.text}."
    if len(groups) == 1:
        subject = "All" if len(found) > 2 else " and ".join(found)
        return f"{subject}: {next(iter(groups))}."
    return " ".join(f"{' and '.join(laws)}: {text}." for text, laws in groups.items())
