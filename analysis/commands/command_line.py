"""The parser, and what becomes of an error."""

from __future__ import annotations

import argparse
import json
import logging
import os
import re
import sys
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NoReturn

from analysis.commands import (
    accuracy,
    calibrate,
    compare,
    design,
    listen,
    locate,
    simulate,
    stability,
    sweep,
)
from analysis.commands.carry_out import carry_out
from analysis.commands.command import Command
from analysis.commands.discovery import completion, doctor, fields, laws, scenarios
from analysis.commands.exporting import columns, export
from analysis.commands.interrupts import Interrupts

__all__ = ["BAD_INPUT", "COMMANDS", "MOST_FAULTS", "make_parser", "run_words"]

DONE, FAILED, BAD_INPUT = 0, 1, 2
#: So many faults of one input are told.
MOST_FAULTS = 20
#: By name, in the order of the help.
COMMANDS: dict[str, Command] = {
    module.COMMAND.name: module.COMMAND
    for module in (
        simulate,
        scenarios,
        fields,
        laws,
        locate,
        listen,
        calibrate,
        accuracy,
        compare,
        stability,
        sweep,
        design,
        export,
        columns,
        doctor,
        completion,
    )
}


class _UsageError(Exception):
    """Words of the command line that make no command."""


class _Parser(argparse.ArgumentParser):
    """One that raises what is wrong, and names what may have been meant."""

    def error(self, message: str) -> NoReturn:
        raise _UsageError(f"{message}{self._hint(message)}; see {self.prog} --help")

    def _hint(self, message: str) -> str:
        command = re.match(r"argument COMMAND: invalid choice: '(.*?)'", message)
        option = re.search(r"unrecognized arguments:.*?(--[\w-]+)", message)
        if not command and not option:
            return ""
        from diagrams.fields import did_you_mean

        if command:
            return did_you_mean(command[1], COMMANDS)
        assert option is not None
        helps = [self.format_help(), *(p.format_help() for p in self.below.values())]
        return did_you_mean(option[1], re.findall(r"--[\w-]+", " ".join(helps)))

    #: Parsers of the subcommands, by name.
    below: Mapping[str, argparse.ArgumentParser] = MappingProxyType({})


class _Version(argparse.Action):
    """Prints the version, which is looked up only then."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(parser.prog, version("phonotaxis"))
        parser.exit()


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
        options = make_parser().parse_args(_by_new_names(words))
        carry_out(COMMANDS[options.command], options, interrupts)
    except BrokenPipeError:
        # The reader of our output has left; Python must not complain at exit.
        sys.stdout = None
        return FAILED
    except Exception as error:  # noqa: BLE001  # bad input, a failed run, or a bug
        return _report(error, words)
    return DONE


def _by_new_names(words: Sequence[str]) -> Sequence[str]:
    """The same words, but for a command that is called by a name that it had."""
    for command in COMMANDS.values():
        if words and command.was and words[0] == command.was:
            print(
                f"phonotaxis: the command {command.was} is called {command.name} now",
                file=sys.stderr,
            )
            return [command.name, *words[1:]]
    return words


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


def make_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = _Parser(
        prog="phonotaxis",
        description="A robot that follows a sound.",
        epilog="examples:\n  phonotaxis simulate\n  phonotaxis fields room\n"
        "  phonotaxis COMMAND --help",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--version", nargs=0, action=_Version, help="print the version and exit"
    )
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in COMMANDS.values():
        lines = [f"  phonotaxis {words}" for words in command.examples]
        subparser = subparsers.add_parser(
            command.name,
            help=command.help,
            epilog="\n".join(["examples:", *lines]),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.add_arguments(subparser)
        subparser.add_argument(
            "--debug", action="store_true", help="print the traceback of an error"
        )
    parser.below = subparsers.choices
    parser.set_defaults(parser=parser)
    return parser


def _report(error: Exception, words: Sequence[str]) -> int:
    """Says in a line each what an exception means; returns the exit status."""
    if "--debug" in words:
        traceback.print_exception(error)
    faults: list[tuple[str, str]]
    if isinstance(error, _UsageError):
        faults, status = [("command line", str(error))], BAD_INPUT
    elif isinstance(error, ImportError):
        text = f"{error}; the installation is not whole, install it again"
        faults, status = [("", text)], FAILED
    else:
        from analysis.run_error import failure_text
        from systems.framework.input_error import InputError

        if isinstance(error, InputError):
            faults = [(each.field, each.message) for each in error.all]
            status = BAD_INPUT
        else:
            faults, status = [("", failure_text(error))], FAILED
    _complain(faults, as_json="--json" in words)
    return status


def _complain(faults: Sequence[tuple[str, str]], *, as_json: bool) -> None:
    told = [(field, _short(field, message)) for field, message in faults[:MOST_FAULTS]]
    if as_json:
        errors = [{"field": field, "message": text} for field, text in told]
        print(json.dumps({"error": errors[0], "errors": errors}))
        return
    for field, message in told:
        text = f"{field}: {message}" if field else message
        print(f"phonotaxis: {text}", file=sys.stderr)
    if more := len(faults) - len(told):
        print(f"phonotaxis: and {more} more of the kind", file=sys.stderr)


def _short(field: str, message: str) -> str:
    if len(message) <= 250 and message.isprintable():
        return message
    from systems.framework.input_error import LONGEST_MESSAGE, shortened

    return shortened(message, LONGEST_MESSAGE - len(field) - 2)
