"""``phonotaxis export``: exports a finished run for other programs."""

from __future__ import annotations

import os
from argparse import ArgumentParser, Namespace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from analysis.commands.arguments import take_json
from analysis.commands.command import Command, Job, Take
from analysis.commands.exporting.files import Exports, take_exports

if TYPE_CHECKING:
    from analysis.runs.recorded_run import RecordedRun


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "result", metavar="DIR", help="result directory of phonotaxis simulate"
    )
    take_exports(parser)
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="new directory for the files (default: the directory of the run)",
    )
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Job[RecordedRun]:
    from analysis.runs.recorded_run import RecordedRun
    from systems.framework.input_error import InputError

    exports, result = Exports.chosen(options), Path(options.result)
    if not exports.names:
        raise InputError("export", "no format is given; give --mcap, --csv or both")
    run = RecordedRun.load(result)
    if options.out is None:
        for name in exports.names:
            if (result / name).exists():
                raise InputError(
                    "out",
                    f"{result / name} already exists; remove it, or give --out DIR",
                )
        if not os.access(result, os.W_OK | os.X_OK):
            raise InputError("out", f"{result} cannot be written; give --out DIR")
    place = take(options.out) if options.out is not None else None
    shown = place.out if place else result

    def write(run: RecordedRun, _: dict[str, Any]) -> None:
        if place:
            exports.write(run, place.directory)
            return
        with TemporaryDirectory(prefix=".export.", dir=result) as hidden:
            exports.write(run, Path(hidden))
            for name in exports.names:  # whole, or not at all
                (Path(hidden) / name).rename(result / name)

    def summary(run: RecordedRun) -> dict[str, Any]:
        return {
            "schema_version": 1,
            "scenario": run.scenario.name,
            "rows": len(run.table),
            "files": [str(shown / name) for name in exports.names],
        }

    return Job(
        run=lambda _: run,
        summary=summary,
        text=lambda _, document: "\n".join(document["files"]),
        write=write,
    )


COMMAND = Command(
    "export",
    "write MCAP and CSV files of a finished run",
    _add_arguments,
    _prepare,
    examples=("export results/0001 --mcap", "export results/0001 --csv --out tables"),
)
