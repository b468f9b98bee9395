"""The parts of a stability report, in the order of the report."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from analysis.report.section import Bullets
from analysis.stability.choice import plans
from analysis.stability.law_analysis import Part
from diagrams import Scenario


def _parts(*names: str) -> tuple[Part[Any], ...]:
    """Imports parts; a name is that of a file of this folder and that of the part."""
    found = []
    for name in names:
        file, _, part = name.partition(".")
        found.append(getattr(import_module(f"analysis.stability.{file}"), part))
    return tuple(found)


#: Parts for a robot that follows a sound. ``analyze_law`` treats the first part in a
#: special way: it finds the operating point, on which the others depend.
SOUND_PARTS = _parts(
    "linear_parts.OPERATING_POINTS",
    "linear_parts.LINEAR_MODELS",
    "linear_parts.STEP",
    "margin_parts.MARGINS",
    "sampling_parts.DELAY_MARGINS",
    "sampling_parts.BURST_CYCLE",
    "sampling_parts.CONTACT_MODE",
    "certificate_parts.CERTIFIED_STARTS",
    "certificate_parts.ENERGY_BALANCE",
    "robustness_parts.ROBUSTNESS",
    "robustness_parts.CONTACT_ROBUSTNESS",
    "margin_parts.RECOMMENDED_GAINS",
)
#: Parts for a robot on a route.
ROUTE_PARTS = _parts(
    "route_parts.FROZEN_GAINS",
    "robustness_parts.ROUTE_ROBUSTNESS",
    "route_parts.GAIN_BOUNDS",
    "adaptation_parts.ADAPTATION",
    "chain_parts.ROBOT_CHAIN",
)
#: Parts for a robot that searches step by step.
SEARCH_PARTS = _parts(
    "margin_parts.HEADING_LOOP", "robustness_parts.HEADING_ROBUSTNESS"
)
#: Parts for a robot with the guarded law.
DRIVE_PARTS = _parts("drive_parts.DRIVE", "robustness_parts.DRIVE_ROBUSTNESS")
#: Parts for a robot with a guard, in addition to the others.
GUARD_PARTS = _parts("safety_parts.GUARD")

_NOT_FOR_ROUTES = (
    "The following parts do not apply, because they are about a robot that follows a "
    "sound: its follow distance, its tracker, its bursts and its law's push."
)
_NOT_FOR_SEARCHES = (
    "A search has no virtual mass, no springs and no equilibrium: the following parts, "
    "which are about robots that follow a sound, do not apply."
)
_NOT_FOR_PLANS = (
    "The guarded law has no virtual mass, no springs and no equilibrium: the following "
    "parts, which are about laws that compute a force, do not apply."
)


def parts_for(scenarios: Sequence[Scenario]) -> tuple[Part[Any], ...]:
    """Returns the parts of a stability report that suit the robot of the scenarios.

    There is one scenario per law, and all have the same robot.
    """
    robot = scenarios[0].only
    if robot.searches is not None:
        return (*SEARCH_PARTS, _left_out(_NOT_FOR_SEARCHES, SOUND_PARTS))
    guarded = any(each.only.own_guard is not None for each in scenarios)
    guard = GUARD_PARTS if guarded else ()
    if robot.kind == "router":
        return (*ROUTE_PARTS, _left_out(_NOT_FOR_ROUTES, SOUND_PARTS), *guard)
    if plans(robot.law):
        return (*DRIVE_PARTS, _left_out(_NOT_FOR_PLANS, SOUND_PARTS), *guard)
    return (*SOUND_PARTS, *guard)


def _left_out(reason: str, parts: Sequence[Part[Any]]) -> Part[list[str]]:
    titles = [part.title for part in parts]
    return Part(
        "left_out",
        "Parts that do not apply",
        lambda study: titles,
        lambda data: [reason, Bullets(data)],
    )
