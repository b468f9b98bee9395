"""``phonotaxis listen``: tracks the sound sources in a live or recorded sound."""

from __future__ import annotations

import os
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypedDict

from analysis.commands.command import Command, Job, Take
from analysis.commands.progress import Progress

if TYPE_CHECKING:
    from analysis.listening.live_hearing import HeardStream
    from analysis.listening.sound_stream import SoundStream
    from analysis.listening.step_views import TextLines

# Longest time until Python switches threads, s; a tenth of Python's default.
_SWITCH_S = 5e-4


class _Stated(TypedDict):
    channels: int | None
    sample_rate_hz: int | None


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "input",
        nargs="?",
        default="-",
        metavar="FILE",
        help="WAV, FLAC or raw samples; - is standard input (default)",
    )
    parser.add_argument(
        "--geometry", metavar="FILE.yaml", help="positions of the microphones"
    )
    parser.add_argument(
        "--device", help="sound card to record from: its name or number, or default"
    )
    parser.add_argument(
        "--rate", type=int, metavar="HZ", help="sample rate of raw samples"
    )
    parser.add_argument(
        "--format",
        choices=("s16le", "s24le", "s32le", "f32le"),
        default="s16le",
        help="format of raw samples (default: s16le)",
    )
    parser.add_argument(
        "--channels",
        type=int,
        metavar="N",
        help="channels of raw samples (default: as in the array)",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print one JSON line per source and step, and one at the end",
    )


def _prepare(options: Namespace, take: Take) -> Job[HeardStream]:
    from systems.framework.input_error import InputError

    for name in ("rate", "channels"):
        if (value := getattr(options, name)) is not None and value < 1:
            raise InputError(f"--{name}", f"is {value}; give a number above 0")

    from analysis.recordings.array_geometry import ROBOT_ARRAY, load_geometry
    from analysis.run_error import RunError

    given = options.geometry
    geometry = load_geometry(Path(given)) if given else ROBOT_ARRAY
    pipe = _pipe(options) if options.device is None else None
    stream = _stream(options, pipe, max(geometry.columns) + 1)

    from analysis.listening.live_hearing import LiveHearing, listen

    teller = _teller(as_json=options.json)
    hearing = LiveHearing(stream, geometry, teller.name_fault)

    def run(progress: Progress) -> HeardStream:
        # The listening thread must not wait long for the thread that checks channels.
        sys.setswitchinterval(_SWITCH_S)
        with teller:
            try:
                listen(hearing, teller.tell)
            except KeyboardInterrupt:
                progress.take_interrupt()
                hearing.heard.status = "interrupted"
        return hearing.heard

    def text(heard: HeardStream, document: dict[str, Any]) -> str:
        return (
            f"{heard.status}; {heard.seconds:.1f} s heard, sources: "
            f"{document['sources']}"
        )

    def demand(heard: HeardStream) -> None:
        if heard.failed:
            raise RunError(heard.status)

    return Job(
        run=run, summary=lambda heard: heard.document(), text=text, demand=demand
    )


def _teller(*, as_json: bool) -> TextLines:
    from analysis.listening.step_views import JsonLines, Screen, TextLines

    if as_json:
        return JsonLines(sys.stdout, sys.stderr)
    view = Screen if sys.stdout.isatty() else TextLines
    return view(sys.stdout, sys.stderr)


def _pipe(options: Namespace) -> BinaryIO:
    from systems.framework.input_error import InputError

    if options.input == "-":
        if sys.stdin is None or sys.stdin.isatty():
            raise InputError(
                "input",
                "no sound is piped in; name a file, pipe in sound, or give --device",
            )
        return os.fdopen(os.dup(sys.stdin.fileno()), "rb")
    try:
        return Path(options.input).open("rb")  # read to its end
    except OSError as error:
        raise InputError("input", f"cannot read it ({error}); name a file") from None


def _stream(
    options: Namespace, pipe: BinaryIO | None, raw_channels: int
) -> SoundStream:
    from analysis.listening.sound_card import open_card
    from analysis.listening.sound_pipe import open_flac, open_pipe

    if pipe is None:
        name = options.device
        device = int(name) if name.isdigit() else None if name == "default" else name
        return open_card(
            device,
            channels=options.channels or raw_channels,
            sample_rate_hz=options.rate or 48_000,
        )
    stated: _Stated = {"channels": options.channels, "sample_rate_hz": options.rate}
    if _is_flac(Path(options.input)):
        pipe.close()
        return open_flac(Path(options.input), **stated)
    return open_pipe(
        pipe, raw_channels=raw_channels, sample_format=options.format, **stated
    )


def _is_flac(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(4) == b"fLaC"


COMMAND = Command(
    "listen",
    "print bearings of all sources, live from a pipe or a sound card",
    _add_arguments,
    _prepare,
    prints=True,
    examples=(
        "listen recording.wav --geometry array.yaml",
        "listen --device default --geometry array.yaml",
        "listen --channels 4 --rate 48000 --format s16le --geometry array.yaml --json",
    ),
)
