"""What a subcommand says of itself; ``carry_out`` does with it what all need."""

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
    """A result directory that appears whole, or not at all."""

    out: Path
    """Where it will be, as the user is told."""
    directory: Path
    """Where its files are written meanwhile."""


#: Takes the directory that ``--out`` names, or the next number under results/.
Take = Callable[[str | None], Place]


@dataclass(frozen=True, kw_only=True)
class Job(Generic[Found]):
    """What a command has to do, its input accepted."""

    run: Callable[[Progress], Found]
    """Finds out what the command is asked for."""
    summary: Callable[[Found], dict[str, Any]]
    """The JSON document."""
    text: Callable[[Found, dict[str, Any]], str]
    """The same for a terminal."""
    out: Path | None = None
    """The result directory, where there is one."""
    write: Callable[[Found, dict[str, Any]], None] = lambda found, summary: None
    """Writes its files."""
    where: str = "\nresults in {out}"
    """Ends the text."""
    total: float = 0.0
    """What ``run`` counts on the progress bar; nothing: it has none, and an
    interrupt strikes at once."""
    unit: str = ""
    """Of what it counts."""
    kept: Callable[[], int] | None = None
    """Number of runs in ``out``, which an interrupt leaves there for ``--resume``."""
    left: Callable[[], str] = lambda: ""
    """Says what an interrupt of it leaves behind, if it leaves anything."""
    remarks: Callable[[Found], Sequence[str]] = lambda found: ()
    """Lines for standard error."""
    demand: Callable[[Found], None] = lambda found: None
    """Raises RunError, after all has been printed, if this is no success."""


@dataclass(frozen=True)
class Command:
    """A subcommand."""

    name: str
    help: str
    """One line."""
    add_arguments: Callable[[ArgumentParser], None]
    prepare: Callable[[Namespace, Take], Job[Any]]
    """Loads and checks the input."""
    examples: tuple[str, ...] = ()
    """Words after the program's name, for the help."""
    prints: bool = False
    """Whether its run prints on standard output; it runs no code of a user's then."""
    was: str = ""
    """A name that it had, by which it still can be called."""
