"""``phonotaxis stability``: the stability of a scenario's control loop."""

from __future__ import annotations

import logging
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from analysis.commands.arguments import (
    LAW_HELP,
    LAW_WORDS,
    completed_by,
    overrides,
    take_output,
    take_scenario,
)
from analysis.commands.command import Command, Job, Take
from analysis.commands.first_words import say
from analysis.commands.progress import Progress

if TYPE_CHECKING:
    from analysis.stability.law_analysis import LawAnalysis


def _add_arguments(parser: ArgumentParser) -> None:
    law = parser.add_argument(
        "--law",
        metavar="LAW",
        action="append",
        help=f"{LAW_HELP}; may be repeated to compare laws; all: the laws that avoid "
        "obstacles, or that drive on a route (default: the scenario's law)",
    )
    completed_by(law, LAW_WORDS)
    parser.add_argument(
        "--robot",
        metavar="NAME",
        help="robot to analyze, without the other robots (default: the first)",
    )
    take_scenario(parser)
    parser.add_argument(
        "--full",
        action="store_true",
        help="check by longer simulations, and by more of them",
    )
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Job[list[LawAnalysis]]:
    from analysis.run_error import RunError
    from analysis.stability.choice import chosen_laws, chosen_robot
    from diagrams.scenario.loading import load_scenario
    from diagrams.scenario.scenario_files import check_files

    place = take(options.out)
    whole = load_scenario(options.scenario, overrides(options))
    scenario, note = chosen_robot(whole, options.robot)
    scenarios = chosen_laws(scenario, options.law or [])
    for each in scenarios:
        check_files(each)
    say(f"analysing {whole.name}")

    from analysis.stability.law_analysis import analyse_law
    from analysis.stability.report_files import (
        stability_document,
        stability_text,
        write_stability,
    )
    from analysis.stability.report_parts import parts_for
    from diagrams.building.laws import make_controller

    if note:
        logging.getLogger("phonotaxis").warning("%s", note)
    for each in scenarios:
        make_controller(each)
    work = parts_for(scenarios)

    def run(progress: Progress) -> list[LawAnalysis]:
        analyses = [
            analyse_law(each, work, full=options.full, step=progress.step)
            for each in scenarios
        ]
        progress.step("writing the report")
        return analyses

    def demand(analyses: list[LawAnalysis]) -> None:
        failures = [each for one in analyses for each in one.failures.items()]
        if failures:
            names = ", ".join(key for key, _ in failures)
            raise RunError(
                f"parts of the report failed: {names}; {place.out / 'report.html'} "
                "states the errors (--debug prints the traceback)"
            ) from failures[0][1]

    return Job(
        run=run,
        summary=lambda analyses: stability_document(analyses, place.out),
        text=lambda analyses, _: stability_text(analyses),
        out=place.out,
        write=lambda analyses, document: write_stability(
            analyses, document, place.directory
        ),
        where="\nreport in {out}/report.html",
        total=len(work) * len(scenarios) + 1,
        unit="parts",
        demand=demand,
    )


COMMAND = Command(
    "stability",
    "analyze the stability of a scenario's loop: report, models, numbers",
    _add_arguments,
    _prepare,
    examples=(
        "stability --law all",
        "stability two_static_obstacles --law active --full",
        "stability --set attraction.damping_n_s_m=3",
    ),
)
