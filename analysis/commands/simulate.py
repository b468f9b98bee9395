"""``phonotaxis simulate``: runs a scenario."""

from __future__ import annotations

import json
import logging
from argparse import ArgumentParser, Namespace
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from analysis.commands.arguments import (
    LAW_HELP,
    LAW_WORDS,
    completed_by,
    overrides,
    take_output,
    take_scenario,
)
from analysis.commands.command import Command, Job, Take
from analysis.commands.exporting.files import Exports, take_exports
from analysis.commands.first_words import say
from analysis.commands.progress import Progress
from analysis.commands.saved_audio import SavedAudio
from analysis.commands.saved_movie import SavedMovie

if TYPE_CHECKING:
    from diagrams import RunResult


def _add_arguments(parser: ArgumentParser) -> None:
    sound = parser.add_argument("--sound", metavar="FILE", help="sound file to play")
    completed_by(sound, "file")
    completed_by(parser.add_argument("--law", help=LAW_HELP), LAW_WORDS)
    take_scenario(parser)
    parser.add_argument(
        "--save-audio",
        metavar="DIR",
        help="new directory for the sound that robots hear and loudspeakers play",
    )
    take_exports(parser)
    parser.add_argument(
        "--movie",
        metavar="FILE",
        help="new .gif or .mp4 of the run from above; an .mp4 has the sound at the "
        "microphones, and needs ffmpeg",
    )
    parser.add_argument(
        "--no-plots",
        action="store_true",
        help="write no pictures: only the replay and the numbers",
    )
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Job[RunResult]:
    from analysis.run_error import RunError
    from diagrams.scenario.loading import load_scenario
    from diagrams.scenario.scenario_files import check_files
    from systems.framework.input_error import InputError

    place, exports = take(options.out), Exports.chosen(options)
    scenario = load_scenario(options.scenario, _settings(options))
    check_files(scenario)
    saved: SavedAudio | None = None
    if options.save_audio is not None:
        saved = SavedAudio(options.save_audio, place.out, scenario)
    movie: SavedMovie | None = None
    if options.movie is not None:
        movie = SavedMovie(options.movie, scenario, place, saved)
    say(f"simulating {scenario.name}")

    from analysis.runs.recorded_run import RecordedRun
    from analysis.runs.run_report import run_summary, summary_text
    from analysis.views.run_directory import write_run
    from diagrams import build_sound_follower, prepared_loop, simulate
    from diagrams.scenario.warnings.warnings_of import warnings_of

    for warning in warnings_of(scenario):
        logging.getLogger("phonotaxis").warning("%s", warning)
    listening = movie or saved
    follower = None
    if scenario.engine == "compiled":
        prepared_loop(scenario)
    else:
        follower = build_sound_follower(scenario, log=True)

    def run(progress: Progress) -> RunResult:
        with listening.opened() if listening else nullcontext() as audio:
            try:
                return simulate(
                    scenario, follower=follower, progress=progress, audio=audio
                )
            except InputError as error:  # found after the input had been accepted
                raise RunError(str(error)) from error

    def summary(result: RunResult) -> dict[str, Any]:
        extra: dict[str, Any] = {"audio": saved.facts()} if saved else {}
        if movie is not None:
            extra["movie"] = options.movie
        return {**run_summary(result, place.out), **extra}

    def text(result: RunResult, document: dict[str, Any]) -> str:
        lines = [summary_text(result, document)]
        return "\n".join([*lines, *(each.text() for each in (saved, movie) if each)])

    def write(result: RunResult, document: dict[str, Any]) -> None:
        write_run(result, document, place.directory, pictures=not options.no_plots)
        exports.write(RecordedRun.of(result), place.directory)
        if movie is not None:
            movie.write(result)

    return Job(
        run=run,
        summary=summary,
        text=text,
        out=place.out,
        write=write,
        where=f"{'results':<21} {{out}}\n"
        f"{'replay':<21} {{out}}/replay.html, to be opened in a browser",
        total=scenario.duration_s,
        unit="s simulated",
        left=saved.left if saved else lambda: "",
    )


def _settings(options: Namespace) -> list[str]:
    settings = overrides(options)
    if options.sound is not None:
        settings += ["sound.kind=wav", f"sound.file={json.dumps(options.sound)}"]
    if options.law is not None:
        settings.append(f"law={options.law}")
    return settings


COMMAND = Command(
    "simulate",
    "run a scenario",
    _add_arguments,
    _prepare,
    examples=(
        "simulate",
        "simulate u_trap --law guarded",
        "simulate my_scenario.yaml --seed 7 --out results/mine",
        "simulate --set source.speed_m_s=0.2 --set hearing=ideal --json",
        "simulate --law my_laws.py:soft --no-plots",
    ),
)
