"""The parser of the command line, and the reports of errors."""

from __future__ import annotations

import argparse
import json
import locale
import logging
import os
import re
import sys
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn

from phonotaxis.commands import (
    accuracy,
    array,
    calibrate,
    compare,
    completion,
    design,
    export,
    falsify,
    init,
    listen,
    lists,
    locate,
    simulate,
    stability,
    sweep,
    worlds,
)
from phonotaxis.commands.carry_out import carry_out
from phonotaxis.commands.command import Command
from phonotaxis.commands.guesses import meant_words, no_command, no_option
from phonotaxis.commands.interrupts import Interrupts

DONE, FAILED, BAD_INPUT = 0, 1, 2
#: Locales with UTF-8. Most systems have at least one of them.
_UTF_8_LOCALES = ("C.UTF-8", "UTF-8", "en_US.UTF-8")
#: Largest number of faults of one input that are printed.
MOST_FAULTS = 20
#: All subcommands by name, in the order of the help.
COMMANDS: dict[str, Command] = {
    command.name: command
    for command in (
        simulate.COMMAND,
        lists.SCENARIOS,
        worlds.COMMAND,
        lists.FIELDS,
        lists.LAWS,
        lists.RESULTS,
        locate.COMMAND,
        listen.COMMAND,
        calibrate.COMMAND,
        array.COMMAND,
        accuracy.COMMAND,
        compare.COMMAND,
        stability.COMMAND,
        sweep.COMMAND,
        design.COMMAND,
        falsify.COMMAND,
        export.COMMAND,
        init.COMMAND,
        lists.COLUMNS,
        lists.DOCTOR,
        completion.COMMAND,
    )
}


class _UsageError(Exception):
    """The words of the command line do not form a valid command."""


class _Parser(argparse.ArgumentParser):
    """Parser that raises an exception for wrong words and suggests similar words."""

    def print_help(self, file: Any = None) -> None:
        # The method of argparse ignores errors when it writes to standard output.
        (file or sys.stdout).write(self.format_help())

    #: Parsers of the subcommands, by name.
    below: Mapping[str, argparse.ArgumentParser] = MappingProxyType({})

    def error(self, message: str) -> NoReturn:
        command = re.match(r"argument COMMAND: invalid choice: '(.*?)'", message)
        if command:
            raise _UsageError(no_command(command[1], COMMANDS))
        if alone := re.match(r"argument (\S+): expected one argument", message):
            message = f"{message}; write {_written(self, alone[1])}"
        elif message.startswith("the following arguments are required"):
            example = str(self.epilog).splitlines()[1].strip()
            message = f"{message}; for example {example}"
        raise _UsageError(f"{message}; see {self.prog} --help")

    def refuse(
        self, command: str, unknown: Sequence[str], words: Sequence[str]
    ) -> NoReturn:
        """Raises an error about words that a subcommand does not know.

        Args:
            command: Name of the subcommand.
            unknown: Unknown words of the command line, at least one.
            words: All words of the command line.
        """
        options = {name: _options(parser) for name, parser in self.below.items()}
        text = no_option(command, unknown, words, options)
        raise _UsageError(f"{text}; see {self.prog} {command} --help")


def _written(parser: argparse.ArgumentParser, names: str) -> str:
    """Returns an option with its value, for example ``--seed N``."""
    for action in parser._actions:
        if "/".join(action.option_strings) == names:
            choices = "|".join(map(str, action.choices or ()))
            value = choices or action.metavar or str(action.dest).upper()
            return f"{action.option_strings[0]} {value}"
    return names


def _options(parser: argparse.ArgumentParser) -> list[str]:
    """Lists the names of a parser's options, without their dashes."""
    return re.findall(r"--([\w-]+)", parser.format_usage())


class _Version(argparse.Action):
    """Prints the version; looks the version up only when the user requests it."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(parser.prog, version("phonotaxis"))
        parser.exit()


def run_words(words: Sequence[str], interrupts: Interrupts) -> int:
    """Runs the command that the words of a command line request.

    Args:
        words: Words of the command line after the name of the program.
        interrupts: Handler of Ctrl-C and SIGTERM in this process.

    Returns:
        Exit status: 0 if the command succeeded, 2 if the input is not valid, 1 after
        any other failure.

    Raises:
        KeyboardInterrupt: An interrupt stopped the command, and no results were
            written.
    """
    try:
        _prepare_process()
        _check_words(words)
        parser = make_parser()
        try:
            options, unknown = parser.parse_known_args(_known_names(words))
        except SystemExit:  # of --help and --version
            sys.stdout.flush()
            raise
        if unknown:
            parser.refuse(options.command, unknown, words)
        carry_out(COMMANDS[options.command], options, interrupts)
    except BrokenPipeError:  # the program that reads our output has ended
        return FAILED
    except Exception as error:  # noqa: BLE001  # bad input, a failed run, or a bug
        return _report(error, words)
    finally:
        _drop_unwritable()
    return DONE


def _drop_unwritable() -> None:
    """Discards output that cannot be written. Python's exit would write it again."""
    try:
        sys.stdout.flush()
    except OSError:
        sys.stdout = None


def _known_names(words: Sequence[str]) -> Sequence[str]:
    """Replaces a synonym of a command by the name of the command."""
    words = meant_words(words)
    for command in COMMANDS.values():
        if words and words[0] in command.synonyms:
            print(
                f"phonotaxis: {words[0]} means the command {command.name}",
                file=sys.stderr,
            )
            return [command.name, *words[1:]]
    return words


def _prepare_process() -> None:
    """Prepares the process for a command, regardless of how the process was started.

    The function makes these changes:

    - Closed standard streams are redirected to the null device. Otherwise, a result
      file could get the descriptor of a standard stream.
    - Characters that the terminal cannot show are escaped.
    - Matplotlib draws into files only, even if a notebook has chosen another backend.
    - Log messages of the package go to standard error.
    - Text files are read as UTF-8.

    Raises:
        InputError: The process cannot read files as UTF-8.
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
    _read_utf_8()


def _read_utf_8() -> None:
    """Makes UTF-8 the encoding in which this process opens text files.

    Some Python files of Drake are UTF-8, but Drake reads them in the encoding of the
    locale. If this encoding is ASCII, loading Drake fails.

    Raises:
        InputError: The system has no locale with UTF-8.
    """
    for name in (None, *_UTF_8_LOCALES):
        with suppress(locale.Error):
            locale.setlocale(locale.LC_CTYPE, name)
        encoding = locale.getpreferredencoding(do_setlocale=False)
        if encoding.lower() == "utf-8":
            return
    raise _bad_locale(
        f"Drake needs UTF-8, and the encoding of this locale is {encoding}"
    )


def _bad_locale(why: str) -> Exception:
    from systems.framework.input_error import InputError

    remedy = "set PYTHONUTF8=1, or a locale with UTF-8, for example LC_ALL=C.UTF-8"
    return InputError("locale", f"{why}; {remedy}")


def _check_words(words: Sequence[str]) -> None:
    """Rejects file names that this process cannot read or open.

    The check covers the words of the command line and the name of the current
    directory.

    Raises:
        InputError: A name is not valid in the encoding of the locale.
    """
    encoding = sys.getfilesystemencoding()
    if encoding == "utf-8":
        return
    for name in (*words, os.getcwd()):  # noqa: PTH109
        if any("\udc80" <= letter <= "\udcff" for letter in name):
            raise _bad_locale(f"{name} cannot be read in this locale ({encoding})")


def make_parser() -> _Parser:
    """Makes the parser of the whole command line."""
    parser = _Parser(
        prog="phonotaxis",
        allow_abbrev=False,
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
            allow_abbrev=False,
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
    """Prints one line for each fault of an exception; returns the exit status."""
    if "--debug" in words:
        traceback.print_exception(error)
    faults: list[tuple[str, str]]
    if isinstance(error, _UsageError):
        faults, status = [("command line", str(error))], BAD_INPUT
    elif isinstance(error, UnicodeEncodeError) and (
        sys.getfilesystemencoding() != "utf-8"
    ):
        # For example, a scenario contains the name of a file.
        return _report(_bad_locale(str(error)), words)
    elif isinstance(error, ImportError):
        text = f"{error}; the installation is incomplete; install phonotaxis again"
        faults, status = [("", text)], FAILED
    else:
        from analysis.run_error import failure_text
        from systems.framework.input_error import InputError

        if isinstance(error, InputError):
            faults = [(each.field, each.message) for each in error.all]
            status = BAD_INPUT
        else:
            faults, status = [("", failure_text(error))], FAILED
    with suppress(OSError):  # standard error cannot be written either
        _complain(faults, as_json="--json" in words)
    return status


def _complain(faults: Sequence[tuple[str, str]], *, as_json: bool) -> None:
    told = [(field, _short(field, message)) for field, message in faults[:MOST_FAULTS]]
    if as_json:
        errors = [{"field": field, "message": text} for field, text in told]
        with suppress(OSError):  # otherwise, standard error states the faults
            print(json.dumps({"error": errors[0], "errors": errors}), flush=True)
            return
    for field, message in told:
        text = f"{field}: {message}" if field else message
        print(f"phonotaxis: {text}", file=sys.stderr)
    if more := len(faults) - len(told):
        print(f"phonotaxis: {more} more messages of this kind", file=sys.stderr)


def _short(field: str, message: str) -> str:
    if len(message) <= 250 and message.isprintable():
        return message
    from systems.framework.input_error import LONGEST_MESSAGE, shortened

    return shortened(message, LONGEST_MESSAGE - len(field) - 2)
