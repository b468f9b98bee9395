"""The page of linear stability quotes what its command prints."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.tables import linear_stability as tables

PAGE = Path(__file__).resolve().parents[3] / "docs" / "linear_stability.md"


@pytest.mark.parametrize(
    "rows",
    [
        tables.mode_rows,
        tables.margin_rows,
        tables.contact_rows,
        tables.equilibrium_rows,
    ],
)
def test_rows_of_the_page_are_those_of_the_command(rows):
    page = PAGE.read_text("utf-8")
    printed = ["| " + " | ".join(row) + " |" for row in rows()]
    assert printed
    assert [row for row in printed if row not in page] == []
