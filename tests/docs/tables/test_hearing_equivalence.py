"""Ideal hearing stands in for full audio: the committed comparison, and its page."""

from __future__ import annotations

import copy
import json
from pathlib import Path

from docs.tables.hearing_equivalence import equivalent, hearing_table

ROOT = Path(__file__).parents[3]
HEARING = json.loads((ROOT / "docs" / "results" / "hearing.json").read_text("utf-8"))


def test_page_holds_the_table_of_the_committed_result():
    page = (ROOT / "docs" / "comparison.md").read_text("utf-8")
    assert hearing_table(HEARING) in page


def test_they_are_equivalent_over_at_least_400_pairs():
    pair = next(p for p in HEARING["pooled"] if p["field"] == "hearing")
    assert pair["success"]["pairs"] >= 400
    assert equivalent(HEARING)


def test_they_would_not_be_with_a_wider_interval():
    changed = copy.deepcopy(HEARING)
    pair = next(p for p in changed["pooled"] if p["field"] == "hearing")
    pair["collision"]["high"] = 0.06
    assert not equivalent(changed)
