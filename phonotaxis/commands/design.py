"""``phonotaxis design``: derives gains of the laws from stated requirements."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    law_of,
    overrides,
    say,
    take_laws,
    take_output,
    take_scenario,
)
from phonotaxis.commands.command import Command, Take

if TYPE_CHECKING:
    from phonotaxis.loops import DesignResult
    from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    take_laws(parser, "one law (default: the scenario's law)")
    take_scenario(parser)
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[DesignResult]:
    from diagrams.scenario.loading import load_scenario
    from diagrams.scenario.scenario_files import check_files

    take(options.out)
    scenario = load_scenario(options.scenario, overrides(options) + law_of(options))
    check_files(scenario)
    say(f"designing gains for {scenario.name}")

    from phonotaxis.loops import prepare_design

    return prepare_design(scenario)


COMMAND = Command(
    "design",
    "derive the laws' gains from stated requirements",
    _add_arguments,
    _prepare,
    examples=(
        "design",
        "design --set robot.mass_kg=8 --json",
    ),
)
