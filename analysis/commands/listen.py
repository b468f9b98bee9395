"""``phonotaxis listen``: every source with an identity, while it sounds."""

from __future__ import annotations

import json
import math
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from analysis.commands.command import Command, Job, Take
from analysis.commands.progress import Progress

if TYPE_CHECKING:
    from analysis.recordings.live_hearing import HeardStream
    from analysis.recordings.sound_stream import SoundStream
    from systems.hearing.voting.source_listener import TrackedSources

__all__ = ["COMMAND"]

# Columns of the terminal's view of all bearings.
_COLUMNS = 60


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "input",
        nargs="?",
        default="-",
        metavar="FILE",
        help="WAV or raw samples; - is standard input (default)",
    )
    parser.add_argument(
        "--geometry", metavar="FILE.yaml", help="places of the microphones"
    )
    parser.add_argument(
        "--device", help="sound card to record from: its name or number, or default"
    )
    parser.add_argument("--rate", type=int, metavar="HZ", help="of raw samples")
    parser.add_argument(
        "--format",
        choices=("s16le", "s24le", "s32le", "f32le"),
        default="s16le",
        help="of raw samples (default: s16le)",
    )
    parser.add_argument(
        "--channels",
        type=int,
        metavar="N",
        help="of raw samples (default: the array's)",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print a JSON line for each source and step, and one at the end",
    )


def _prepare(options: Namespace, take: Take) -> Job[HeardStream]:
    from systems.framework.input_files import require_file

    if options.geometry:
        require_file(options.geometry, "geometry", "YAML")
    pipe = _pipe(options) if options.device is None else None

    from analysis.recordings.array_geometry import ROBOT_ARRAY, load_geometry
    from analysis.recordings.live_hearing import LiveHearing, listen, track_document

    given = options.geometry
    geometry = load_geometry(Path(given)) if given else ROBOT_ARRAY
    stream = _stream(options, pipe, max(geometry.columns) + 1)
    hearing = LiveHearing(stream, geometry)

    def tell(step: TrackedSources) -> None:
        if options.json:
            for line in track_document(step):
                print(json.dumps(line, allow_nan=False))
            sys.stdout.flush()
        elif sys.stdout.isatty():
            print(f"\r{_view(step)}\x1b[K", end="", flush=True)
        elif round(step.t_s, 6) % 1.0 == 0.0:
            print(_view(step), flush=True)

    def run(_: Progress) -> HeardStream:
        return listen(hearing, tell)

    def text(heard: HeardStream, document: dict[str, Any]) -> str:
        return (
            f"\n{heard.status} after {heard.seconds:.1f} s; sources: "
            f"{document['sources']}"
        )

    return Job(
        run=run,
        summary=lambda heard: heard.document(),
        text=text,
        remarks=lambda heard: heard.faults,
    )


def _pipe(options: Namespace) -> BinaryIO:
    from systems.framework.input_error import InputError

    if options.input == "-":
        if sys.stdin is None or sys.stdin.isatty():
            raise InputError(
                "input",
                "nothing is piped in; name a file, pipe in sound, or give --device",
            )
        return sys.stdin.buffer
    try:
        return Path(options.input).open("rb")  # read to its end
    except OSError as error:
        raise InputError("input", f"cannot read it ({error}); name a file") from None


def _stream(options: Namespace, pipe: BinaryIO | None, channels: int) -> SoundStream:
    from analysis.recordings.sound_stream import open_card, open_pipe

    channels = options.channels or channels
    if pipe is None:
        name = options.device
        device = int(name) if name.isdigit() else None if name == "default" else name
        rate = options.rate or 48_000
        return open_card(device, channels=channels, sample_rate_hz=rate)
    return open_pipe(
        pipe,
        channels=channels,
        sample_rate_hz=options.rate,
        sample_format=options.format,
    )


def _view(step: TrackedSources) -> str:
    """All bearings from right behind over the left and ahead to right behind."""
    line = ["."] * _COLUMNS
    line[_COLUMNS // 2] = "|"
    for track in step.tracks:
        turn = 0.5 - track.bearing / (2.0 * math.pi)
        line[int(turn * _COLUMNS) % _COLUMNS] = str(track.identity % 10)
    each = "  ".join(
        f"{track.identity}: {math.degrees(track.bearing):+.0f} deg"
        for track in step.tracks
    )
    return f"{step.t_s:8.1f} s  {''.join(line)}  {each}"


COMMAND = Command(
    "listen",
    "bearings of all sources, live from a pipe or a card",
    _add_arguments,
    _prepare,
    examples=(
        "listen recording.wav --geometry array.yaml",
        "listen --device default --geometry array.yaml",
        "listen --channels 4 --rate 48000 --format s16le --geometry array.yaml --json",
    ),
)
