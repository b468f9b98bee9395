"""``phonotaxis simulate``: runs a scenario."""

from __future__ import annotations

import json
import logging
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from analysis.commands.arguments import LAW_HELP, overrides, take_output, take_scenario
from analysis.commands.command import Command, Job, Take
from analysis.commands.progress import Progress

if TYPE_CHECKING:
    from diagrams import RunResult

__all__ = ["COMMAND"]


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--sound", metavar="FILE", help="sound file to play")
    parser.add_argument("--law", help=LAW_HELP)
    take_scenario(parser)
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Job[RunResult]:
    from analysis.run_error import RunError
    from analysis.runs.run_report import run_summary, summary_text, write_run
    from diagrams import (
        build_sound_follower,
        load_scenario,
        prepared_loop,
        simulate,
    )
    from systems.framework.input_error import InputError

    place = take(options.out)
    scenario = load_scenario(options.scenario, _settings(options))
    for note in scenario.notes():
        logging.getLogger("phonotaxis").warning("%s", note)
    follower = None
    if scenario.engine == "compiled":
        prepared_loop(scenario)
    else:
        follower = build_sound_follower(scenario, log=True)

    def run(progress: Progress) -> RunResult:
        try:
            return simulate(scenario, follower=follower, progress=progress)
        except InputError as error:  # found after the input had been accepted
            raise RunError(str(error)) from error

    return Job(
        run=run,
        summary=lambda result: run_summary(result, place.out),
        text=summary_text,
        out=place.out,
        write=lambda result, summary: write_run(result, summary, place.directory),
        where=f"{'results':<21} {{out}}",
        total=scenario.duration_s,
        unit="s simulated",
    )


def _settings(options: Namespace) -> list[str]:
    settings = overrides(options)
    if options.sound is not None:
        settings += ["sound.kind=wav", f"sound.file={json.dumps(options.sound)}"]
    if options.law is not None:
        settings.append(f"law={options.law}")
    return settings


COMMAND = Command("simulate", "run a scenario", _add_arguments, _prepare)
