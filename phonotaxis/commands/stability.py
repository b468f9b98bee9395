"""``phonotaxis stability``: analyzes the stability of a scenario's control loop."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    overrides,
    say,
    take_laws,
    take_output,
    take_scenario,
)
from phonotaxis.commands.command import Command, Take

if TYPE_CHECKING:
    from phonotaxis.loops import StabilityResult
    from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    take_laws(
        parser,
        "all: the laws that avoid obstacles by a force, or that drive on a route "
        "(default: the scenario's law)",
    )
    parser.add_argument(
        "--robot",
        metavar="NAME",
        help="robot to analyze, without the other robots (default: the first)",
    )
    take_scenario(parser)
    parser.add_argument(
        "--full",
        action="store_true",
        help="all parts, including those that take minutes",
    )
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[StabilityResult]:
    from analysis.stability.choice import chosen_laws, chosen_robot
    from diagrams.scenario.loading import load_scenario
    from diagrams.scenario.scenario_files import check_files
    from diagrams.scenario.suggestions import law_names

    take(options.out)
    whole = load_scenario(options.scenario, overrides(options))
    scenario, note = chosen_robot(whole, options.robot)
    scenarios = chosen_laws(scenario, law_names(options.law))
    for each in scenarios:
        check_files(each)
    say(f"analyzing {whole.name}")

    from phonotaxis.loops import prepare_stability

    return prepare_stability(scenarios, note, full=options.full)


COMMAND = Command(
    "stability",
    "analyze the stability of a scenario's loop: report, models, numbers",
    _add_arguments,
    _prepare,
    where="\nreport in {out}/report.html",
    examples=(
        "stability --law all",
        "stability two_static_obstacles --law active --full",
        "stability --set attraction.damping_n_s_m=3",
    ),
)
