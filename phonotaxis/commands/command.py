"""The class that describes a subcommand, and the classes that it uses."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from phonotaxis.result import Output, Prepared


@dataclass(frozen=True)
class Place:
    """A result directory that appears complete at the end, or not at all."""

    out: Path
    """Final path of the directory, as messages to the user show it."""
    directory: Path
    """Hidden directory that holds the files until the command ends."""


#: Function that reserves the result directory. The argument is the value of ``--out``.
#: None means the next number under results/.
Take = Callable[[str | None], Place]


@dataclass(frozen=True)
class Printed(Output):
    """An output without files and pictures, which is only printed."""

    content: dict[str, Any]
    text: str
    error: Exception | None = None
    """Why the command fails although it has an output."""

    def document(self) -> dict[str, Any]:
        """Returns the JSON document."""
        return self.content

    def __str__(self) -> str:
        return self.text

    def failure(self, out: Path | None) -> Exception | None:
        """Returns why the command fails; None if it succeeds."""
        return self.error


def _write(
    options: Namespace, result: Any, document: dict[str, Any], directory: Path
) -> None:
    result.write(document, directory)


@dataclass(frozen=True)
class Command:
    """A subcommand of ``phonotaxis``."""

    name: str
    help: str
    """One line about the command, for the help."""
    add_arguments: Callable[[ArgumentParser], None]
    prepare: Callable[[Namespace, Take], Prepared[Output]]
    """Checks the input, and returns the work. To reject wrong input quickly, this
    function loads Drake only after it has accepted the input."""
    examples: tuple[str, ...] = ()
    """Example command lines for the help, without the name of the program."""
    where: str = "\nresults in {out}"
    """Last line of the printed text, if there is a result directory ``out``."""
    write: Callable[[Namespace, Any, dict[str, Any], Path], None] = _write
    """Writes the files of a result into a directory."""
    live: bool = False
    """Whether the command prints on standard output while it runs, and usually ends by
    an interrupt. Such a command must not run a user's code."""
    synonyms: tuple[str, ...] = ()
    """Other words that users type for the command, which work, too."""
