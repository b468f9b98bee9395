"""``phonotaxis simulate``: runs a scenario."""

from __future__ import annotations

import json
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from phonotaxis.commands.arguments import (
    completed_by,
    overrides,
    require_exports,
    say,
    take_exports,
    take_laws,
    take_output,
    take_scenario,
)
from phonotaxis.commands.command import Command, Place, Take

if TYPE_CHECKING:
    from diagrams.scenario.scenario import Scenario
    from phonotaxis.law_runs import LawsResult
    from phonotaxis.result import Prepared, Result
    from phonotaxis.runs import RunResult


def _add_arguments(parser: ArgumentParser) -> None:
    sound = parser.add_argument("--sound", metavar="FILE", help="sound file to play")
    completed_by(sound, "file")
    take_laws(
        parser,
        "several laws run one after another, and one picture shows all paths; "
        "all: every law for robots of this kind (default: the scenario's law)",
    )
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
        "--live",
        action="store_true",
        help="show the run in a browser while Drake's engine computes it",
    )
    parser.add_argument(
        "--rate",
        type=float,
        metavar="RATE",
        help="speed of --live: 1 is real time (default), 0 as fast as possible",
    )
    parser.add_argument(
        "--no-plots",
        action="store_true",
        help="write no pictures: only the replay and the numbers",
    )
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[Result]:
    from diagrams.scenario.laws_of_kind import chosen_names
    from diagrams.scenario.loading import load_scenario

    place = take(options.out)
    require_exports(options)
    scenario = load_scenario(options.scenario, _settings(options))
    laws = chosen_names(options.law, scenario)
    if len(laws) > 1:
        return _prepare_laws(options, scenario, laws)
    if laws:
        scenario = scenario.with_(law=laws[0])
    return _prepare_run(options, scenario, place)


def _prepare_laws(
    options: Namespace, scenario: Scenario, laws: list[str]
) -> Prepared[LawsResult]:
    from systems.framework.input_error import InputError

    for option in ("save_audio", "movie"):
        if getattr(options, option) is not None:
            raise InputError(option, "is possible with one law only; give one --law")
    say(f"simulating {scenario.name} under {', '.join(laws)}")

    from phonotaxis.law_runs import prepare_laws, with_laws

    return prepare_laws(with_laws(scenario, laws))


def _prepare_run(
    options: Namespace, scenario: Scenario, place: Place
) -> Prepared[RunResult]:
    from analysis.run_error import RunError
    from diagrams.scenario.scenario_files import check_files
    from phonotaxis.run_files import SavedAudio, SavedMovie
    from systems.framework.input_error import InputError

    check_files(scenario)
    saved: SavedAudio | None = None
    if options.save_audio is not None:
        saved = SavedAudio(options.save_audio, scenario)
        _require_outside(place, "save_audio", options.save_audio, saved.path)
    movie: SavedMovie | None = None
    if options.movie is not None:
        movie = SavedMovie(options.movie, scenario)
        _require_outside(place, "movie", options.movie, movie.path)
    if options.rate is not None and not options.live:
        raise InputError("rate", f"{options.rate:g} needs --live; add --live")
    say(f"simulating {scenario.name}")

    from phonotaxis.runs import prepare_simulation

    if options.live:
        from analysis.views.live_view import start_meshcat

        meshcat = start_meshcat()
        prepared = prepare_simulation(
            scenario,
            engine="drake",
            saved=saved,
            movie=movie,
            meshcat=meshcat,
            rate=options.rate,
        )
        print(f"live view: {meshcat.web_url()}", file=sys.stderr, flush=True)
        if sys.stdin.isatty() and sys.stderr.isatty():
            prepared = replace(prepared, stay=_stay)
    else:
        prepared = prepare_simulation(scenario, saved=saved, movie=movie)

    def run(progress: Callable[[float], None]) -> RunResult:
        try:
            return prepared.run(progress)
        except InputError as error:  # not found when the input was checked
            raise RunError(str(error)) from error

    return replace(prepared, run=run)


def _stay() -> None:
    """Keeps the live view open until an interrupt."""
    print("the live view stays open until Ctrl-C", file=sys.stderr, flush=True)
    while True:
        time.sleep(3600.0)


def _require_outside(place: Place, option: str, given: str, path: Path) -> None:
    """Rejects a file or directory inside the result directory."""
    if path.resolve().is_relative_to(place.out.expanduser().resolve()):
        where = "is in the directory of the results"
        if option == "save_audio":
            where = "is the directory of the results or in it"
        from systems.framework.input_error import InputError

        raise InputError(
            option,
            f"{given} {where}, and that directory is created at the end; name another "
            "directory",
        )


def _write(
    options: Namespace,
    result: RunResult | LawsResult,
    document: dict[str, Any],
    directory: Path,
) -> None:
    pictures = not options.no_plots
    result.write(
        document, directory, pictures=pictures, mcap=options.mcap, csv=options.csv
    )


def _settings(options: Namespace) -> list[str]:
    settings = overrides(options)
    if options.sound is not None:
        settings += ["sound.kind=wav", f"sound.file={json.dumps(options.sound)}"]
    return settings


COMMAND = Command(
    "simulate",
    "run a scenario",
    _add_arguments,
    _prepare,
    where=f"{'results':<21} {{out}}\n"
    f"{'replay':<21} {{out}}/replay.html, to be opened in a browser",
    write=_write,
    examples=(
        "simulate",
        "simulate u_trap --law guarded",
        "simulate default --law active,guarded --figures",
        "simulate my_scenario.yaml --seed 7 --out results/mine",
        "simulate --set source.speed_m_s=0.2 --set hearing=ideal --json",
        "simulate --law my_laws.py:soft --no-plots",
        "simulate --live --rate 2",
        "simulate results/latest",
    ),
    synonyms=("run", "start"),
)
