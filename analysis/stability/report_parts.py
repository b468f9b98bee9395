"""The parts of a stability report, in the order of the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from analysis.report.section import Bullets
from analysis.stability.certificate_parts import CERTIFIED_STARTS, ENERGY_BALANCE
from analysis.stability.law_analysis import Part
from analysis.stability.linear_parts import LINEAR_MODELS, OPERATING_POINTS, STEP
from analysis.stability.margin_parts import HEADING_LOOP, MARGINS, RECOMMENDED_GAINS
from analysis.stability.robustness_parts import (
    CONTACT_ROBUSTNESS,
    HEADING_ROBUSTNESS,
    ROBUSTNESS,
    ROUTE_ROBUSTNESS,
)
from analysis.stability.route_parts import (
    ADAPTATION,
    FROZEN_GAINS,
    GAIN_BOUNDS,
    ROBOT_CHAIN,
)
from analysis.stability.safety_parts import GUARD
from analysis.stability.sampling_parts import (
    BURST_CYCLE,
    CONTACT_MODE,
    DELAY_MARGINS,
)
from diagrams import Scenario

#: Parts for a robot that follows a sound. ``analyze_law`` treats the first part in a
#: special way: it finds the operating point, on which the others depend.
SOUND_PARTS: tuple[Part[Any], ...] = (
    OPERATING_POINTS,
    LINEAR_MODELS,
    STEP,
    MARGINS,
    DELAY_MARGINS,
    BURST_CYCLE,
    CONTACT_MODE,
    CERTIFIED_STARTS,
    ENERGY_BALANCE,
    ROBUSTNESS,
    CONTACT_ROBUSTNESS,
    RECOMMENDED_GAINS,
)
#: Parts for a robot on a route.
ROUTE_PARTS: tuple[Part[Any], ...] = (
    FROZEN_GAINS,
    ROUTE_ROBUSTNESS,
    GAIN_BOUNDS,
    ADAPTATION,
    ROBOT_CHAIN,
)
#: Parts for a robot that searches step by step.
SEARCH_PARTS: tuple[Part[Any], ...] = (HEADING_LOOP, HEADING_ROBUSTNESS)

_NOT_FOR_ROUTES = (
    "The following parts do not apply, because they are about a robot that follows a "
    "sound: its follow distance, its tracker, its bursts and its law's push."
)
_NOT_FOR_SEARCHES = (
    "A search has no virtual mass, no springs and no equilibrium: the following parts, "
    "which are about robots that follow a sound, do not apply."
)


def parts_for(scenarios: Sequence[Scenario]) -> tuple[Part[Any], ...]:
    """Returns the parts of a stability report that suit the robot of the scenarios.

    There is one scenario per law, and all have the same robot.
    """
    robot = scenarios[0].only
    if robot.searches is not None:
        return (*SEARCH_PARTS, _left_out(_NOT_FOR_SEARCHES, SOUND_PARTS))
    guarded = any(each.only.own_guard is not None for each in scenarios)
    guard = (GUARD,) if guarded else ()
    if robot.kind == "router":
        return (*ROUTE_PARTS, _left_out(_NOT_FOR_ROUTES, SOUND_PARTS), *guard)
    return (*SOUND_PARTS, *guard)


def _left_out(reason: str, parts: Sequence[Part[Any]]) -> Part[list[str]]:
    titles = [part.title for part in parts]
    return Part(
        "left_out",
        "Parts that do not apply",
        lambda study: titles,
        lambda data: [reason, Bullets(data)],
    )
