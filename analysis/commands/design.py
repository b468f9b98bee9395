"""``phonotaxis design``: gains of the laws from stated requirements."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from analysis.commands.arguments import overrides, take_output, take_scenario
from analysis.commands.command import Command, Job, Take
from analysis.commands.first_words import say

if TYPE_CHECKING:
    from analysis.design.design_study import DesignStudy


def _add_arguments(parser: ArgumentParser) -> None:
    take_scenario(parser)
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Job[DesignStudy]:
    from diagrams.scenario.loading import load_scenario
    from diagrams.scenario.scenario_files import check_files

    place = take(options.out)
    scenario = load_scenario(options.scenario, overrides(options))
    check_files(scenario)
    say(f"designing gains for {scenario.name}")

    from analysis.design.design_study import STUDY_RUNS, study_design
    from analysis.design.design_text import design_summary, design_text, write_design

    return Job(
        run=lambda progress: study_design(scenario, progress=progress),
        summary=lambda study: design_summary(study, place.out),
        text=lambda study, _: design_text(study),
        out=place.out,
        write=lambda study, summary: write_design(study, summary, place.directory),
        total=STUDY_RUNS,
        unit="runs",
    )


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
