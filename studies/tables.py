"""What a study yields: tables, and at its end perhaps that a bound is missed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from analysis.report.markdown import markdown_table


@dataclass(frozen=True)
class Table:
    """A table of results, which ``str`` writes in Markdown."""

    name: str
    """Unique among the tables of a study; its key in the JSON file."""
    columns: Sequence[str]
    rows: Iterable[Sequence[object]]
    """Cells from left to right. A generator shows each row as soon as it is known."""

    def __str__(self) -> str:
        return markdown_table(self.columns, self.rows)


class MissedBoundError(Exception):
    """A study's result is worse than it may be."""
