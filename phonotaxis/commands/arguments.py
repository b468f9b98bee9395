"""Arguments that several subcommands take."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from phonotaxis.run_files import CSV_FILE, MCAP_FILE

#: Help text of law arguments. The text does not list the laws, because loading their
#: names takes seconds.
LAW_HELP = "a name (phonotaxis laws lists them), or package.module:Name"

#: Names of the shell functions that complete scenarios and laws, by shell.
#: ``phonotaxis completion`` writes these functions.
SCENARIO_WORDS, LAW_WORDS = (
    {"bash": name, "zsh": name, "fish": f"({name})"}
    for name in ("_phonotaxis_scenario_or_file", "_phonotaxis_law_or_file")
)


def completed_by(argument: Any, words: dict[str, str] | str) -> None:
    """Sets how a shell completes an argument when the user presses the tab key.

    Args:
        argument: Argument of a parser, as returned by ``add_argument``.
        words: ``file``, ``directory``, or a mapping in the format of the package shtab.
            The mapping contains, for each shell, the name of a shell function that
            prints the possible words.
    """
    argument.complete = words


def take_laws(parser: ArgumentParser, about: str) -> None:
    """Adds the option ``--law``, with one or several laws, to ``options.law``.

    Args:
        parser: Parser of a command.
        about: Meaning of ``all`` and of a missing option.
    """
    law = parser.add_argument(
        "--law",
        "--laws",
        metavar="LAW,...",
        action="append",
        default=[],
        help=f"laws, with commas or as several options: {LAW_HELP}; {about}",
    )
    completed_by(law, LAW_WORDS)


def take_json(parser: ArgumentParser) -> None:
    """Adds the option ``--json``."""
    parser.add_argument("--json", action="store_true", help="print one JSON document")


def take_output(parser: ArgumentParser) -> None:
    """Adds the options ``--out`` and ``--json``."""
    out = parser.add_argument(
        "--out", metavar="DIR", help="result directory (default: results/NUMBER)"
    )
    completed_by(out, "directory")
    take_json(parser)


def take_figures(parser: ArgumentParser) -> None:
    """Adds the option ``--figures``."""
    parser.add_argument(
        "--figures",
        action="store_true",
        help="write figures of rates and metrics as PDF, SVG and PNG files, for papers",
    )


def write_batch_files(
    options: Namespace, result: Any, document: dict[str, Any], directory: Path
) -> None:
    """Writes the files of a batch of runs; with ``--figures``, its figures, too."""
    result.write(document, directory)
    if options.figures:
        result.save_figures(directory / "figures")


def take_exports(parser: ArgumentParser) -> None:
    """Adds the options ``--mcap`` and ``--csv``."""
    parser.add_argument(
        "--mcap",
        action="store_true",
        help=f"write {MCAP_FILE}, for Foxglove, PlotJuggler and ROS 2",
    )
    parser.add_argument(
        "--csv", action="store_true", help=f"write {CSV_FILE}, the table as text"
    )


def require_exports(options: Namespace) -> None:
    """Raises InputError if a package for the requested files is not installed."""
    if options.mcap:
        from analysis.views.mcap_file import require_mcap

        require_mcap()


def take_scenario(parser: ArgumentParser) -> None:
    """Adds the scenario argument and the options that change fields of the scenario."""
    scenario = parser.add_argument(
        "scenario", nargs="?", default="default", help="library name or YAML file"
    )
    completed_by(scenario, SCENARIO_WORDS)
    parser.add_argument("--seed", metavar="N", help="seed of all random numbers")
    parser.add_argument(
        "--velocity-term",
        metavar="TERM",
        help="printed (|dC/dt|) or closing (the speed of approach only)",
    )
    parser.add_argument(
        "--guard",
        choices=("on", "off"),
        help="keep the robot in space that its sensors have seen as free",
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="set any field (phonotaxis fields lists them), for example "
        "source.speed_m_s=0.2; may be repeated",
    )


def overrides(options: Namespace) -> list[str]:
    """Lists the settings that the options make, as texts ``key=value``.

    Options for a single field, for example ``--seed``, come last and override
    ``--set``.
    """
    found = list(options.set)
    for option, field in (
        ("seed", "seed"),
        ("velocity_term", "collision_vector.velocity_term"),
    ):
        value = getattr(options, option)
        if value is not None:
            found.append(f"{field}={value}")
    if options.guard is not None:
        found.append("guard={}" if options.guard == "on" else "guard=null")
    return found


def say(text: str) -> None:
    """Prints which work begins, if standard error is a terminal.

    Commands call this function before imports that take seconds.

    Args:
        text: Name of the work, for example 'simulating default'.
    """
    if sys.stderr.isatty():
        print(f"phonotaxis: {text} ...", file=sys.stderr, flush=True)
