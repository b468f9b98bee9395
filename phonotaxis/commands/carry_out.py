"""The steps of every subcommand: prepare, run, write the files, print."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from contextlib import ExitStack, nullcontext, redirect_stdout, suppress
from pathlib import Path
from typing import Any

from phonotaxis.commands.command import Command, Place
from phonotaxis.commands.interrupts import Interrupts
from phonotaxis.commands.progress import Progress
from phonotaxis.result import Output, Prepared, Result


def carry_out(command: Command, options: Namespace, interrupts: Interrupts) -> None:
    """Runs a subcommand: does its work, writes its files, and prints its result.

    Args:
        command: The subcommand.
        options: Parsed options of the command line.
        interrupts: Handler of Ctrl-C and SIGTERM in this process.

    Raises:
        InputError: The input is not valid.
        RunError: The work failed. Or an interrupt stopped the work, and some results
            remain on the disk.
        KeyboardInterrupt: An interrupt stopped the work, and no results remain.
    """
    from analysis.report.result_directory import whole_directory
    from analysis.run_error import RunError, no_exit

    place: Place | None = None
    prepared: Prepared[Output] | None = None
    # Output of a user's code goes to standard error, so that standard output contains
    # the result only.
    redirected = nullcontext() if command.live else redirect_stdout(sys.stderr)
    try:
        with ExitStack() as stack:

            def take(out: str | None) -> Place:
                nonlocal place
                place = Place(*stack.enter_context(whole_directory(out)))
                return place

            with no_exit(), redirected:
                prepared = command.prepare(options, take)
                interrupts.check()
                result = _run(command, prepared, interrupts)
                with interrupts.at_once():
                    document, out = _written(command, options, result, place)
            interrupts.check()  # from here on, the files stay
    except BaseException:
        # A library may have turned the interrupt into another exception.
        if not interrupts.struck:
            raise
        left = prepared.left() if prepared is not None else ""
        if left:
            raise RunError(f"interrupted; {left}") from None
        raise KeyboardInterrupt from None
    where = f"; the results are in {out}" if out is not None else ""
    try:
        with interrupts.at_once():
            _print(command, result, document, out, as_json=options.json)
    except KeyboardInterrupt:
        if out is None:
            raise
        raise RunError(f"interrupted{where}") from None
    except BrokenPipeError:
        raise
    except OSError as error:
        text = f"standard output cannot be written ({error.strerror}){where}"
        raise RunError(text) from error
    if prepared.stay is not None:
        with suppress(KeyboardInterrupt), interrupts.at_once():
            prepared.stay()
    if (failure := result.failure(out)) is not None:
        raise failure


def _run(command: Command, prepared: Prepared[Any], interrupts: Interrupts) -> Any:
    with Progress(interrupts, prepared.total, prepared.unit, prepared.done) as progress:
        # An interrupt inside a compiled callback would become a SystemError.
        with nullcontext() if prepared.total else interrupts.at_once():
            result = prepared.run(progress)
        if command.live:
            interrupts.forget()
        interrupts.check()
    return result


def _written(
    command: Command, options: Namespace, result: Output, place: Place | None
) -> tuple[dict[str, Any], Path | None]:
    """Writes the files of a result; returns its document and its directory."""
    document = result.document()
    if not isinstance(result, Result):
        return document, None
    if place is None:
        if result.out is not None:
            command.write(options, result, document, result.out)
            _write_figures(options, result, result.out)
        return document, result.out
    document = {**document, "out": str(place.out)}
    command.write(options, result, document, place.directory)
    _write_figures(options, result, place.directory)
    return document, place.out


def _write_figures(options: Namespace, result: Result, directory: Path) -> None:
    if getattr(options, "figures", False):
        result.save_figures(directory / "figures")


def _print(
    command: Command,
    result: Output,
    document: dict[str, Any],
    out: Path | None,
    *,
    as_json: bool,
) -> None:
    text = json.dumps(document, allow_nan=False) if as_json else str(result)
    if out is not None and not as_json:
        where = (isinstance(result, Result) and result.where) or command.where
        text += f"\n{where.format(out=out)}"
    print(text, flush=True)
