"""The parts of a stability report, in the order of the report."""

from __future__ import annotations

from collections.abc import Sequence

from analysis.stability.law_analysis import Part
from analysis.stability.linear_parts import linear_parts
from analysis.stability.margin_parts import margin_parts
from analysis.stability.nonlinear_parts import extended_parts, nonlinear_parts
from analysis.stability.robustness_parts import robustness_parts
from analysis.stability.route_parts import route_parts
from analysis.stability.route_readings import ROUTE_CRITERIA
from analysis.stability.safety_parts import safety_parts
from analysis.stability.sampling_parts import gain_parts, sampling_parts
from analysis.stability.search_parts import SEARCH_CRITERIA, search_parts
from analysis.stability.verdict_parts import verdict_parts
from diagrams import Scenario


def parts(
    *,
    full: bool,
    guarded: bool = False,
    routed: bool = False,
    searching: bool = False,
) -> tuple[Part, ...]:
    """Returns the parts of a stability report for one kind of robot.

    Args:
        full: Whether the report also has the parts that take minutes.
        guarded: Whether the robot has a guard. If so, the report has a part about the
            guard.
        routed: Whether the robot drives on a route. If so, the report has parts about
            the route, and no parts about following a sound.
        searching: Whether the robot searches step by step. If so, the report has only
            the parts about the search.

    Returns:
        The parts, in the order of the report.
    """
    guard = safety_parts() if guarded else ()
    left_out = [part.title for part in _sound_parts(full=full)]
    if searching:
        return (*search_parts(left_out), *verdict_parts(SEARCH_CRITERIA))
    if routed:
        return (*route_parts(left_out), *guard, *verdict_parts(ROUTE_CRITERIA))
    return (*_sound_parts(full=full), *guard, *verdict_parts())


def parts_for(scenarios: Sequence[Scenario], *, full: bool) -> tuple[Part, ...]:
    """Returns the parts of a stability report that suit the robot of the scenarios.

    Args:
        scenarios: One scenario per law. All scenarios have the same robot.
        full: Whether the report also has the parts that take minutes.

    Returns:
        The parts, in the order of the report.
    """
    return parts(
        full=full,
        guarded=any(each.only.own_guard is not None for each in scenarios),
        routed=scenarios[0].only.kind == "router",
        searching=scenarios[0].only.searches is not None,
    )


def _sound_parts(*, full: bool) -> tuple[Part, ...]:
    return (
        *linear_parts(full=full),
        *margin_parts(),
        *sampling_parts(full=full),
        *nonlinear_parts(full=full),
        *robustness_parts(full=full),
        *(extended_parts() if full else ()),
        *gain_parts(),
    )
