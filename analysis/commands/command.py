"""Descriptions of a subcommand and of its job, for ``carry_out``."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from analysis.commands.progress import Progress

Found = TypeVar("Found")


@dataclass(frozen=True)
class Place:
    """A result directory that appears complete at the end, or not at all."""

    out: Path
    """Final path of the directory, as messages to the user show it."""
    directory: Path
    """Hidden directory that holds the files until the command ends."""


#: Reserves the result directory: the one of ``--out``, or else the next number under
#: results/.
Take = Callable[[str | None], Place]


@dataclass(frozen=True, kw_only=True)
class Job(Generic[Found]):
    """The work of a command after the command has accepted the input."""

    run: Callable[[Progress], Found]
    """Does the work of the command and returns the result."""
    summary: Callable[[Found], dict[str, Any]]
    """Makes the JSON document from the result."""
    text: Callable[[Found, dict[str, Any]], str]
    """Makes the text for a terminal from the result and the JSON document."""
    out: Path | None = None
    """Result directory; None if the command writes no files."""
    write: Callable[[Found, dict[str, Any]], None] = lambda found, summary: None
    """Writes the files of the result directory."""
    where: str = "\nresults in {out}"
    """Last line of the text, if there is a result directory."""
    total: float = 0.0
    """Total of the progress bar, in ``unit``. If 0, there is no bar, and an interrupt
    stops ``run`` at any point."""
    unit: str = ""
    """Unit of the progress bar, for example runs."""
    kept: Callable[[], int] | None = None
    """Returns the number of runs in ``out``. After an interrupt, these runs remain for
    ``--resume``."""
    left: Callable[[], str] = lambda: ""
    """Describes the files that remain after an interrupt; empty if there are none."""
    remarks: Callable[[Found], Sequence[str]] = lambda found: ()
    """Returns remarks about the result, one line each, for standard error."""
    demand: Callable[[Found], None] = lambda found: None
    """Raises RunError if the result is no success; called after all output."""


@dataclass(frozen=True)
class Command:
    """A subcommand of ``phonotaxis``."""

    name: str
    help: str
    """One line about the command, for the help."""
    add_arguments: Callable[[ArgumentParser], None]
    prepare: Callable[[Namespace, Take], Job[Any]]
    """Loads and checks the input, and returns the job."""
    examples: tuple[str, ...] = ()
    """Example command lines for the help, without the name of the program."""
    prints: bool = False
    """Whether the job prints on standard output while it runs. Such a command must
    not run a user's code."""
    was: str = ""
    """Former name of the command, which still works."""
