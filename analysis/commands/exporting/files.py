"""``--mcap`` and ``--csv``: files of a run for other programs."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from analysis.runs.recorded_run import RecordedRun

MCAP_FILE, CSV_FILE = "run.mcap", "trajectory.csv"


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


class Exports(NamedTuple):
    """The files that the options request."""

    mcap: bool
    csv: bool

    @classmethod
    def chosen(cls, options: Namespace) -> Exports:
        """Reads from the options which files are requested.

        Args:
            options: Parsed options ``--mcap`` and ``--csv``.

        Returns:
            The choice of files.

        Raises:
            InputError: A package that writes MCAP files is not installed.
        """
        if options.mcap:
            from analysis.views.mcap_file import require_mcap

            require_mcap()
        return cls(options.mcap, options.csv)

    @property
    def names(self) -> list[str]:
        """Names of the requested files."""
        every = zip((MCAP_FILE, CSV_FILE), self, strict=True)
        return [name for name, chosen in every if chosen]

    def write(self, run: RecordedRun, directory: Path) -> None:
        """Writes the requested files.

        Args:
            run: Run to export.
            directory: Existing directory for the files.
        """
        if self.mcap:
            from analysis.views.mcap_file import write_mcap

            write_mcap(run, directory / MCAP_FILE)
        if self.csv:
            run.table.to_csv(directory / CSV_FILE, index=False)
