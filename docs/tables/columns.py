"""Columns of a run's table; ``python -m docs.tables.columns`` prints them."""

from __future__ import annotations

import sys

from analysis.exports.columns import COLUMNS

__all__ = ["column_table"]


def column_table() -> str:
    """A row a column, as Markdown."""
    rows = [f"| `{each.name}` | {each.unit} | {each.meaning} |\n" for each in COLUMNS]
    return "".join(["| column | unit | meaning |\n", "|---|---|---|\n", *rows])


if __name__ == "__main__":
    sys.stdout.write(column_table())
