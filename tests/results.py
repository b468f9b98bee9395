"""The committed results, and whether others are the same."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pytest

RESULTS = Path(__file__).resolve().parents[1] / "docs" / "results"
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def comparison(name: str) -> dict[str, Any]:
    """Summary of a comparison."""
    path = RESULTS / "comparisons" / f"{name}.json"
    found: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return found


def documented(name: str, table: str) -> list[list[str]]:
    """Rows of a table of a study."""
    document = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))
    return [[str(cell) for cell in row] for row in document["tables"][table]["rows"]]


def headings(name: str, table: str) -> list[str]:
    """Headings of that table."""
    document = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))
    found: list[str] = document["tables"][table]["columns"]
    return found


def numbers(cell: str) -> list[float]:
    """All numbers of a cell."""
    return [float(word) for word in _NUMBER.findall(cell)]


def assert_same_rows(found: Iterable[Sequence[object]], rows: list[list[str]]) -> None:
    """Words alike; numbers within one unit of their last place."""
    cells = [[str(cell) for cell in row] for row in found]
    assert len(cells) > 0
    assert [[_NUMBER.sub("#", cell) for cell in row] for row in cells] == [
        [_NUMBER.sub("#", cell) for cell in row] for row in rows
    ]
    for row, old in zip(cells, rows, strict=True):
        for cell, quoted in zip(row, old, strict=True):
            for word, number in zip(
                _NUMBER.findall(quoted), numbers(cell), strict=True
            ):
                assert number == pytest.approx(float(word), abs=_unit(word)), row


def _unit(word: str) -> float:
    """One unit of the last place of a written number, and a little."""
    mantissa, _, power = word.partition("e")
    places = len(mantissa.partition(".")[2])
    return 1.01 * 10.0 ** (int(power or 0) - places)
