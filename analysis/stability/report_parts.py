"""The parts of a stability report, in the order of the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from analysis.reporting.section import Bullets
from analysis.stability.law_analysis import Part
from analysis.stability.linear_parts import LINEAR_MODELS, OPERATING_POINTS, STEP
from analysis.stability.margin_parts import HEADING_LOOP, MARGINS, RECOMMENDED_GAINS
from analysis.stability.nonlinear_parts import (
    CERTIFIED_STARTS,
    CONTACT_OSCILLATION,
    DISTURBANCE_BOUNDS,
    ENERGY_BALANCE,
    GAP_MAPS,
    OFFSET_MAPS,
    PHASE_PORTRAIT,
    RATIO_MAP,
    SOS_REGION,
    VELOCITY_TERMS,
)
from analysis.stability.robustness_parts import CONTACT_ROBUSTNESS, ROBUSTNESS
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
    ROOT_LOCI,
    SAMPLING,
)
from diagrams import Scenario

#: Parts for a robot that follows a sound. The first part is about operating points,
#: because all others depend on it.
SOUND_PARTS: tuple[Part[Any], ...] = (
    OPERATING_POINTS,
    LINEAR_MODELS,
    STEP,
    MARGINS,
    DELAY_MARGINS,
    BURST_CYCLE,
    ROOT_LOCI,
    SAMPLING,
    CONTACT_MODE,
    VELOCITY_TERMS,
    CONTACT_OSCILLATION,
    CERTIFIED_STARTS,
    ENERGY_BALANCE,
    ROBUSTNESS,
    CONTACT_ROBUSTNESS,
    GAP_MAPS,
    OFFSET_MAPS,
    RATIO_MAP,
    PHASE_PORTRAIT,
    SOS_REGION,
    DISTURBANCE_BOUNDS,
    RECOMMENDED_GAINS,
)
#: Parts for a robot on a route.
ROUTE_PARTS: tuple[Part[Any], ...] = (
    FROZEN_GAINS,
    GAIN_BOUNDS,
    ADAPTATION,
    ROBOT_CHAIN,
)
#: Parts for a robot that searches step by step.
SEARCH_PARTS: tuple[Part[Any], ...] = (HEADING_LOOP,)

_NOT_FOR_ROUTES = (
    "The following parts do not apply, because they are about a robot that follows a "
    "sound: its follow distance, its tracker, its bursts and its law's push."
)
_NOT_FOR_SEARCHES = (
    "A search has no virtual mass, no springs and no equilibrium: the following parts, "
    "which are about robots that follow a sound, do not apply."
)


def parts_for(scenarios: Sequence[Scenario], *, full: bool) -> tuple[Part[Any], ...]:
    """Returns the parts of a stability report that suit the robot of the scenarios.

    There is one scenario per law, and all have the same robot. A full report also has
    the parts that take minutes.
    """
    robot = scenarios[0].only
    sound = tuple(part for part in SOUND_PARTS if full or not part.slow)
    if robot.searches is not None:
        return (*SEARCH_PARTS, _left_out(_NOT_FOR_SEARCHES, sound))
    guarded = any(each.only.own_guard is not None for each in scenarios)
    guard = (GUARD,) if guarded else ()
    if robot.kind == "router":
        return (*ROUTE_PARTS, _left_out(_NOT_FOR_ROUTES, sound), *guard)
    return (*sound, *guard)


def _left_out(reason: str, parts: Sequence[Part[Any]]) -> Part[list[str]]:
    titles = [part.title for part in parts]
    return Part(
        "left_out",
        "Parts that do not apply",
        lambda study: titles,
        lambda data: [reason, Bullets(data)],
    )
