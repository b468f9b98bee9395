"""``phonotaxis locate``: bearing and range of the source in a recording, over time."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.commands.arguments import take_json
from analysis.commands.command import Command, Job, Take
from analysis.commands.first_words import say

if TYPE_CHECKING:
    from analysis.recordings.locate_result import LocateResult


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("recording", metavar="FILE", help="multi-channel WAV or FLAC")
    parser.add_argument(
        "--geometry", metavar="FILE.yaml", help="positions of the microphones"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="directory for locate.json and locate.png"
    )
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Job[LocateResult]:
    from analysis.recordings.array_geometry import ROBOT_ARRAY, load_geometry
    from analysis.recordings.prepared_recording import recorded_samples

    given = options.geometry
    geometry = load_geometry(Path(given)) if given else ROBOT_ARRAY
    recorded = recorded_samples(options.recording, geometry)
    place = take(options.out) if options.out is not None else None
    say(f"locating sources in {options.recording}")

    from analysis.recordings.locate import located
    from analysis.recordings.locate_text import locate_text

    def summary(result: LocateResult) -> dict[str, Any]:
        where = {"out": str(place.out)} if place is not None else {}
        return {**result.to_dict(), **where}

    def write(result: LocateResult, document: dict[str, Any]) -> None:
        if place is not None:
            from analysis.recordings.locate_plots import write_locate

            write_locate(result, document, place.directory)

    return Job(
        run=lambda _: located(recorded, geometry),
        summary=summary,
        text=lambda result, _: locate_text(result),
        out=place.out if place is not None else None,
        write=write,
        where="results in {out}",
        remarks=lambda result: [fault.message for fault in result.faults],
    )


COMMAND = Command(
    "locate",
    "compute bearing and range over time from a recording",
    _add_arguments,
    _prepare,
    examples=(
        "locate recording.wav --geometry array.yaml",
        "locate recording.wav --out results/located --json",
    ),
)
