"""``phonotaxis export``: exports a finished run for other programs."""

from __future__ import annotations

import os
from argparse import ArgumentParser, Namespace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    require_exports,
    take_exports,
    take_json,
    take_out,
)
from phonotaxis.commands.command import Command, Printed, Take
from phonotaxis.result import Prepared
from phonotaxis.run_files import CSV_FILE, MCAP_FILE

if TYPE_CHECKING:
    from analysis.runs.recorded_run import RecordedRun


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "result", metavar="DIR", help="result directory of phonotaxis simulate"
    )
    take_exports(parser)
    take_out(parser, "new directory for the files (default: the directory of the run)")
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[Printed]:
    from analysis.runs.recorded_run import RecordedRun
    from systems.framework.input_error import InputError

    require_exports(options)
    result = Path(options.result)
    chosen = {MCAP_FILE: options.mcap, CSV_FILE: options.csv}
    names = [name for name, wanted in chosen.items() if wanted]
    if not names:
        raise InputError("export", "no format is given; give --mcap, --csv or both")
    run = RecordedRun.load(result)
    if options.out is None:
        for name in names:
            if (result / name).exists():
                raise InputError(
                    "out",
                    f"{result / name} already exists; remove it, or give --out DIR",
                )
        if not os.access(result, os.W_OK | os.X_OK):
            raise InputError("out", f"{result} cannot be written; give --out DIR")
    place = take(options.out) if options.out is not None else None

    def export(_: object) -> Printed:
        from analysis.report.provenance import SCHEMA_VERSION

        if place:
            _write(run, names, place.directory)
        else:
            with TemporaryDirectory(prefix=".export.", dir=result) as hidden:
                _write(run, names, Path(hidden))
                for name in names:  # whole, or not at all
                    (Path(hidden) / name).rename(result / name)
        shown = place.out if place else result
        files = [str(shown / name) for name in names]
        document = {
            "schema_version": SCHEMA_VERSION,
            "scenario": run.scenario.name,
            "rows": len(run.table),
            "files": files,
        }
        return Printed(document, "\n".join(files))

    return Prepared(run=export)


def _write(run: RecordedRun, names: list[str], directory: Path) -> None:
    from analysis.views.mcap_file import write_mcap

    if MCAP_FILE in names:
        write_mcap(run, directory / MCAP_FILE)
    if CSV_FILE in names:
        run.table.to_csv(directory / CSV_FILE, index=False)


COMMAND = Command(
    "export",
    "write MCAP and CSV files of a finished run",
    _add_arguments,
    _prepare,
    examples=("export results/0001 --mcap", "export results/0001 --csv --out tables"),
)
