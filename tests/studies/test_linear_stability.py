"""How small numbers are written, and limits of stability by other means."""

from __future__ import annotations

import pytest

from analysis.loops.contact_mode import largest_contact_stiffness
from analysis.stability.sampling_parts import contact_growth
from diagrams.scenario.scenario import Scenario
from studies.linear_stability import apart, limit_rows


def test_what_rounding_leaves_is_zero_and_no_number():
    """A sum of some thousand products of doubles is off by 1e-13 or so of its size."""
    assert [apart(x) for x in (9e-13, 4e-15, 0.0)] == ["0", "0", "0"]
    assert apart(9e-9) == "9e-09"


def test_limits_agree_with_the_contact_mode():
    """By bisection for K_r; a law that is unstable in contact has no limit."""
    rows = {(law, field): limit for law, field, _, _, limit in limit_rows()}
    stiffest = float(rows["none", "`attraction.stiffness_n_m`"])
    # The values of a root locus are 5 % apart.
    assert stiffest == pytest.approx(largest_contact_stiffness(Scenario()), rel=0.06)
    for law in ("conventional", "active", "active2017"):
        growth = contact_growth(Scenario(law=law), 0)
        assert growth is not None
        limits = [limit for (name, _), limit in rows.items() if name == law]
        assert [limit == "unstable now" for limit in limits] == [growth >= 0.0] * 2
