"""The page of linear stability quotes what its command prints."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.tables import linear_stability as tables

PAGE = Path(__file__).resolve().parents[3] / "docs" / "linear_stability.md"


@pytest.mark.parametrize(
    "rows",
    [
        tables.route_rows,
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


def test_what_rounding_leaves_is_zero_and_no_number():
    """A sum of some thousand products of doubles is off by 1e-13 or so of its size."""
    assert [tables.apart(x) for x in (9e-13, 4e-15, 0.0)] == ["0", "0", "0"]
    assert tables.apart(9e-9) == "9e-09"
    page = PAGE.read_text("utf-8")
    assert "0 is less than 1e-11" in page
    cells = re.findall(r"\b\d(?:\.\d+)?e-\d+\b", page)
    assert cells
    assert min(float(cell) for cell in cells if cell != "1e-11") > 1e-11
