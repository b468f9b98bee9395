"""How small numbers are written."""

from __future__ import annotations

from studies.linear_stability import apart


def test_what_rounding_leaves_is_zero_and_no_number():
    """A sum of some thousand products of doubles is off by 1e-13 or so of its size."""
    assert [apart(x) for x in (9e-13, 4e-15, 0.0)] == ["0", "0", "0"]
    assert apart(9e-9) == "9e-09"
