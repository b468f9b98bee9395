"""``--mcap`` and ``--csv``: a run's files for other programs."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from analysis.exports.recorded_run import RecordedRun

MCAP_FILE, CSV_FILE = "run.mcap", "trajectory.csv"


def take_exports(parser: ArgumentParser) -> None:
    """``--mcap`` and ``--csv``."""
    parser.add_argument(
        "--mcap",
        action="store_true",
        help=f"write {MCAP_FILE}, for Foxglove, PlotJuggler and ROS 2",
    )
    parser.add_argument(
        "--csv", action="store_true", help=f"write {CSV_FILE}, the table as text"
    )


class Exports(NamedTuple):
    """Which files are asked for."""

    mcap: bool
    csv: bool

    @classmethod
    def chosen(cls, options: Namespace) -> Exports:
        """Those of the options.

        Raises:
            InputError: A package for them is not installed.
        """
        if options.mcap:
            from analysis.exports.mcap_file import require_mcap

            require_mcap()
        return cls(options.mcap, options.csv)

    @property
    def names(self) -> list[str]:
        """Of the files."""
        every = zip((MCAP_FILE, CSV_FILE), self, strict=True)
        return [name for name, chosen in every if chosen]

    def write(self, run: RecordedRun, directory: Path) -> None:
        """Writes them.

        Args:
            run: What happened.
            directory: Exists.
        """
        if self.mcap:
            from analysis.exports.mcap_file import write_mcap

            write_mcap(run, directory / MCAP_FILE)
        if self.csv:
            run.table.to_csv(directory / CSV_FILE, index=False)
