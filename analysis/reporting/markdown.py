"""Tables in Markdown, as the pages under docs/ hold them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def markdown_row(cells: Iterable[object]) -> str:
    """One line of a table."""
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def markdown_head(headings: Sequence[str]) -> str:
    """The row of headings, and the rule below it."""
    return f"{markdown_row(headings)}\n{'|---' * len(headings)}|"


def markdown_table(headings: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """A whole table.

    Args:
        headings: One for each column.
        rows: Cells from left to right; each is written as ``str`` writes it.

    Returns:
        Lines without an end of line after the last one.
    """
    return "\n".join([markdown_head(headings), *map(markdown_row, rows)])
