"""Ideal hearing stands in for full audio: the committed comparison."""

from __future__ import annotations

import copy

from studies.hearing_equivalence import equivalent
from tests.results import comparison

HEARING = comparison("hearing")


def test_they_are_equivalent_over_at_least_400_pairs():
    pair = next(p for p in HEARING["pooled"] if p["field"] == "hearing")
    assert pair["success"]["difference"]["n"] >= 400
    assert equivalent(HEARING)


def test_they_would_not_be_with_a_wider_interval():
    changed = copy.deepcopy(HEARING)
    pair = next(p for p in changed["pooled"] if p["field"] == "hearing")
    pair["collision"]["difference"]["high"] = 0.06
    assert not equivalent(changed)
