"""``phonotaxis locate``: finds bearings and ranges of sources in a recording."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import say, take_json
from phonotaxis.commands.command import Command, Take

if TYPE_CHECKING:
    from phonotaxis.recordings import LocateResult
    from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("recording", metavar="FILE", help="multi-channel WAV or FLAC")
    parser.add_argument(
        "--geometry", metavar="FILE.yaml", help="positions of the microphones"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="directory for locate.json and locate.png"
    )
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[LocateResult]:
    from analysis.arrays.array_geometry import make_geometry
    from analysis.arrays.recorded_samples import recorded_samples

    geometry = make_geometry(options.geometry)
    recorded = recorded_samples(options.recording, geometry)
    if options.out is not None:
        take(options.out)
    say(f"locating sources in {options.recording}")

    from phonotaxis.recordings import prepare_locate

    return prepare_locate(recorded, geometry)


COMMAND = Command(
    "locate",
    "compute bearing and range over time from a recording",
    _add_arguments,
    _prepare,
    where="results in {out}",
    examples=(
        "locate recording.wav --geometry array.yaml",
        "locate recording.wav --out results/located --json",
    ),
)
