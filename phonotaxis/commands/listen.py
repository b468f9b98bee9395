"""``phonotaxis listen``: tracks sound sources in live or recorded sound."""

from __future__ import annotations

import os
import sys
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, BinaryIO

from phonotaxis.commands.arguments import take_json
from phonotaxis.commands.command import Command, Take
from phonotaxis.result import Prepared

if TYPE_CHECKING:
    from analysis.arrays.step_views import TextLines
    from phonotaxis.listening import ListenResult


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
    take_json(parser, "print one JSON line per source and step, and one at the end")


def _prepare(options: Namespace, take: Take) -> Prepared[ListenResult]:
    from phonotaxis.listening import open_sound, track_sources
    from systems.framework.input_error import InputError

    for name in ("rate", "channels"):
        if (value := getattr(options, name)) is not None and value < 1:
            raise InputError(f"--{name}", f"is {value}; give a number above 0")
    given = options.device
    device = None if given == "default" else given
    if given is not None and given.isdigit():
        device = int(given)
    sound = _sound(options.input) if given is None else None

    def run(_: object) -> ListenResult:
        # A pipe without sound blocks here, and an interrupt stops it.
        stream, geometry = open_sound(
            sound,
            options.geometry,
            device=device,
            channels=options.channels,
            sample_rate_hz=options.rate,
            sample_format=options.format,
        )
        teller = _teller(as_json=options.json)
        with teller:
            return track_sources(stream, geometry, teller.tell, teller.name_fault)

    return Prepared(run=run)


def _teller(*, as_json: bool) -> TextLines:
    from analysis.arrays.step_views import JsonLines, Screen, TextLines

    if as_json:
        return JsonLines(sys.stdout, sys.stderr)
    view = Screen if sys.stdout.isatty() else TextLines
    return view(sys.stdout, sys.stderr)


def _sound(given: str) -> str | BinaryIO:
    from systems.framework.input_error import InputError

    if given != "-":
        return given
    if sys.stdin is None or sys.stdin.isatty():
        raise InputError(
            "input",
            "no sound is piped in; name a file, pipe in sound, or give --device",
        )
    return os.fdopen(os.dup(sys.stdin.fileno()), "rb")


COMMAND = Command(
    "listen",
    "print bearings of all sources, live from a pipe or a sound card",
    _add_arguments,
    _prepare,
    live=True,
    examples=(
        "listen recording.wav --geometry array.yaml",
        "listen --device default --geometry array.yaml",
        "listen --channels 4 --rate 48000 --format s16le --geometry array.yaml --json",
    ),
)
