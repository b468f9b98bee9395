"""``phonotaxis locate``: finds bearings and ranges of sources in a recording."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    completed_by,
    say,
    take_output,
    take_wanted_place,
)
from phonotaxis.commands.command import Command, Take

if TYPE_CHECKING:
    from phonotaxis.recordings import LocateResult
    from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    recording = parser.add_argument(
        "recording",
        nargs="+",
        metavar="FILE",
        help="multi-channel WAV or FLAC, or one file per microphone in their order",
    )
    completed_by(recording, "file")
    parser.add_argument(
        "--starts-s",
        metavar="S,S,...",
        help="time at which each of several files begins, s (default: all at once)",
    )
    parser.add_argument(
        "--geometry", metavar="FILE.yaml", help="positions of the microphones"
    )
    take_output(parser, "directory for locate.json and locate.png (default: no files)")


def _prepare(options: Namespace, take: Take) -> Prepared[LocateResult]:
    from analysis.arrays.array_geometry import make_geometry
    from analysis.arrays.recorded_samples import name_of_files, recorded_samples

    geometry = make_geometry(options.geometry)
    starts_s = None if options.starts_s is None else _times(options.starts_s)
    recorded = recorded_samples(options.recording, geometry, starts_s=starts_s)
    take_wanted_place(options, take)
    say(f"locating sources in {name_of_files(options.recording)}")

    from phonotaxis.recordings import prepare_locate

    return prepare_locate(recorded, geometry)


def _times(text: str) -> list[float]:
    """Reads numbers that are separated by commas."""
    from systems.framework.input_error import InputError

    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            "--starts-s",
            f"is {text!r}; give one number per file, for example 0,0.12,0.05",
        ) from None


COMMAND = Command(
    "locate",
    "compute bearing and range over time from a recording",
    _add_arguments,
    _prepare,
    where="results in {out}",
    examples=(
        "locate recording.wav --geometry array.yaml",
        "locate recording.wav --out results/located --json",
        "locate mic1.wav mic2.wav mic3.wav --starts-s 0,0.12,0.05",
    ),
)
