"""Arguments that several subcommands take."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any, TypeVar

from phonotaxis.run_files import CSV_FILE, MCAP_FILE

if TYPE_CHECKING:
    from phonotaxis.commands.command import Take

Default = TypeVar("Default", int, None)

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


def law_of(options: Namespace) -> list[str]:
    """Lists the setting of the law that the user has named.

    Args:
        options: Parsed options of the command line.

    Returns:
        One text ``law=NAME``; nothing if the user has named no law.

    Raises:
        InputError: There are several laws.
    """
    from diagrams.scenario.suggestions import law_names

    names = law_names(options.law)
    if len(names) > 1 or names == ["all"]:
        from systems.framework.input_error import InputError

        text = f"is {', '.join(names)}; this command takes one law at a time"
        raise InputError("law", text)
    return [f"law={name}" for name in names]


def take_seed(
    parser: ArgumentParser, about: str = "seed of all random numbers"
) -> None:
    """Adds the option ``--seed``; ``whole_seed`` reads it."""
    parser.add_argument("--seed", metavar="N", help=about)


def whole_seed(options: Namespace, default: Default) -> int | Default:
    """Reads the seed that the user has given.

    Args:
        options: Parsed options of the command line.
        default: Result if the user has given no seed.

    Returns:
        The seed.

    Raises:
        InputError: The text is not a whole number from 0 on.
    """
    if options.seed is None:
        return default
    if not options.seed.isdecimal():
        from systems.framework.input_error import InputError

        text = f"{options.seed!r} is not a whole number; give 0 or more"
        raise InputError("seed", text)
    return int(options.seed)


def take_json(parser: ArgumentParser, about: str = "print one JSON document") -> None:
    """Adds the option ``--json``."""
    parser.add_argument("--json", action="store_true", help=about)


def take_output(
    parser: ArgumentParser, about: str = "result directory (default: results/NUMBER)"
) -> None:
    """Adds the options ``--out``, ``--figures`` and ``--json``.

    Args:
        parser: Parser of a command with a result that can be drawn.
        about: Meaning of ``--out``.
    """
    take_out(parser, about)
    parser.add_argument(
        "--figures",
        action="store_true",
        help="write the figures as PDF, SVG and PNG files, too, for papers",
    )
    take_json(parser)


def take_out(parser: ArgumentParser, about: str) -> None:
    """Adds the option ``--out``."""
    out = parser.add_argument("--out", metavar="DIR", help=about)
    completed_by(out, "directory")


def take_wanted_place(options: Namespace, take: Take) -> None:
    """Takes a result directory if the user names one; without it, nothing is written.

    Args:
        options: Parsed options of the command line.
        take: Function that reserves the directory.

    Raises:
        InputError: Figures are wanted, and there is no directory for them.
    """
    if options.out is not None:
        take(options.out)
    elif options.figures:
        from systems.framework.input_error import InputError

        raise InputError("figures", "need a directory; add --out DIR")


def take_batch(parser: ArgumentParser, runs: str) -> None:
    """Adds the options of many runs: ``--runs``, ``--workers`` and ``--resume``.

    Args:
        parser: Parser of a command.
        runs: Meaning of ``--runs``.
    """
    take_runs(parser, runs)
    take_workers(parser)
    parser.add_argument(
        "--resume",
        action="store_true",
        help="continue with the runs in --out; with more --runs, add runs",
    )


def take_runs(parser: ArgumentParser, about: str, default: int | None = None) -> None:
    """Adds the option ``--runs``."""
    parser.add_argument("--runs", metavar="N", type=int, default=default, help=about)


def take_workers(
    parser: ArgumentParser,
    about: str = "local processes (default: one per core)",
    default: int | None = None,
) -> None:
    """Adds the option ``--workers``."""
    parser.add_argument("--workers", metavar="N", type=int, default=default, help=about)


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
    take_seed(parser)
    take_settings(parser)


def take_settings(parser: ArgumentParser, velocity_terms: str = "") -> None:
    """Adds the option ``--set``, and options for fields that users set often.

    Args:
        parser: Parser of a command.
        velocity_terms: What several velocity terms mean; empty if there can be one.
    """
    parser.add_argument(
        "--velocity-term",
        metavar="TERM",
        help=f"printed (|dC/dt|) or closing (the speed of approach only)"
        f"{velocity_terms}",
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


def settings_of(options: Namespace) -> list[str]:
    """Lists the settings that the options make, as texts ``key=value``.

    Options for a single field, for example ``--guard``, come last and override
    ``--set``.
    """
    found = list(options.set)
    if options.velocity_term is not None:
        found.append(f"collision_vector.velocity_term={options.velocity_term}")
    if options.guard is not None:
        found.append("guard={}" if options.guard == "on" else "guard=null")
    return found


def overrides(options: Namespace) -> list[str]:
    """Lists the settings of one scenario: those of ``settings_of``, and the seed."""
    seed = whole_seed(options, None)
    return settings_of(options) + ([] if seed is None else [f"seed={seed}"])


def say(text: str) -> None:
    """Prints which work begins, if standard error is a terminal.

    Commands call this function before imports that take seconds.

    Args:
        text: Name of the work, for example 'simulating default'.
    """
    if sys.stderr.isatty():
        print(f"phonotaxis: {text} ...", file=sys.stderr, flush=True)
