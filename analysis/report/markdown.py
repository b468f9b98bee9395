"""Markdown tables for the pages under docs/."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def markdown_row(cells: Iterable[object]) -> str:
    """Makes one row of a table from its cells."""
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def markdown_head(headings: Sequence[str]) -> str:
    """Makes the row of headings and the line below it."""
    return f"{markdown_row(headings)}\n{'|---' * len(headings)}|"


def markdown_table(headings: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Makes a table in Markdown, without a newline after the last line."""
    return "\n".join([markdown_head(headings), *map(markdown_row, rows)])
