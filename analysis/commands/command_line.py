"""The parser, and what becomes of an error."""

from __future__ import annotations

import argparse
import json
import logging
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from analysis.commands import (
    calibrate,
    compare,
    design,
    laws,
    listen,
    localization,
    locate,
    scenarios,
    simulate,
    stability,
    sweep,
)
from analysis.commands.carry_out import carry_out
from analysis.commands.command import Command
from analysis.commands.exporting import columns, export
from analysis.commands.interrupts import Interrupts

__all__ = ["COMMANDS", "run_words"]

DONE, FAILED, BAD_INPUT = 0, 1, 2
#: By name, in the order of the help.
COMMANDS: dict[str, Command] = {
    module.COMMAND.name: module.COMMAND
    for module in (
        simulate,
        scenarios,
        laws,
        locate,
        listen,
        calibrate,
        localization,
        compare,
        stability,
        sweep,
        design,
        export,
        columns,
    )
}


class _UsageError(Exception):
    """Words of the command line that make no command."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise _UsageError(f"{message}; see {self.prog} --help")


def run_words(words: Sequence[str], interrupts: Interrupts) -> int:
    """Runs a command.

    Args:
        words: Those after the program's name.
        interrupts: Of the process.

    Returns:
        Exit status: 0 done, 2 bad input, 1 anything else.

    Raises:
        KeyboardInterrupt: It was interrupted, and nothing was written.
    """
    _prepare_process()
    try:
        options = _parser().parse_args(words)
        carry_out(COMMANDS[options.command], options, interrupts)
    except BrokenPipeError:
        # The reader of our output has left; Python must not complain at exit.
        sys.stdout = None
        return FAILED
    except Exception as error:  # noqa: BLE001  # bad input, a failed run, or a bug
        return _report(error, words)
    return DONE


def _prepare_process() -> None:
    """Makes a process fit for a command, however it was started.

    Standard streams that are closed lead nowhere: a result file must not get their
    numbers. Characters that a terminal cannot show are escaped. Pictures go to
    files, whatever a notebook has chosen. What takes long says so.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115
        if hasattr(getattr(sys, name), "reconfigure"):
            getattr(sys, name).reconfigure(errors="backslashreplace")
    os.environ["MPLBACKEND"] = "agg"
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("phonotaxis: %(message)s"))
    logger = logging.getLogger("phonotaxis")
    logger.handlers = [handler]
    logger.setLevel(logging.INFO)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="phonotaxis", description="A robot that follows a sound.")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in COMMANDS.values():
        subparser = subparsers.add_parser(command.name, help=command.help)
        command.add_arguments(subparser)
        subparser.add_argument(
            "--debug", action="store_true", help="print the traceback of an error"
        )
    return parser


def _report(error: Exception, words: Sequence[str]) -> int:
    """Says on one line what an exception means; returns the exit status."""
    if "--debug" in words:
        traceback.print_exception(error)
    if isinstance(error, _UsageError):
        field, message, status = "command line", str(error), BAD_INPUT
    elif isinstance(error, ImportError):
        text = f"{error}; the installation is not whole, install it again"
        field, message, status = "", text, FAILED
    else:
        from analysis.run_error import failure_text
        from systems.framework.input_error import InputError

        if isinstance(error, InputError):
            field, message, status = error.field, error.message, BAD_INPUT
        else:
            field, message, status = "", failure_text(error), FAILED
    _complain(field, message, as_json="--json" in words)
    return status


def _complain(field: str, message: str, *, as_json: bool) -> None:
    if len(message) > 250 or not message.isprintable():
        from systems.framework.input_error import LONGEST_MESSAGE, shortened

        message = shortened(message, LONGEST_MESSAGE - len(field) - 2)
    if as_json:
        print(json.dumps({"error": {"field": field, "message": message}}))
        return
    text = f"{field}: {message}" if field else message
    print(f"phonotaxis: {text}", file=sys.stderr)
