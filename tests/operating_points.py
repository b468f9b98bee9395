"""Equilibria that many tests begin from, found once in each process of the tests."""

from __future__ import annotations

from functools import cache

from analysis.loops.equilibria import follow_equilibrium
from analysis.loops.operating_points import OperatingPoint
from diagrams.scenario.scenario import Scenario


@cache
def _follow_point(scenario: str) -> OperatingPoint:
    return follow_equilibrium(Scenario.model_validate_json(scenario))


def follow_point(scenario: Scenario) -> OperatingPoint:
    """The result of ``follow_equilibrium``, which takes a second or two."""
    return _follow_point(scenario.model_dump_json())
