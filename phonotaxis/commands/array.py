"""``phonotaxis array``: what a microphone array can resolve."""

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
    from phonotaxis.arrays import ResolutionResult
    from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    geometry = parser.add_argument(
        "geometry", metavar="FILE.yaml", help="positions of the microphones"
    )
    completed_by(geometry, "file")
    parser.add_argument(
        "--snr-db",
        metavar="DB",
        type=float,
        default=20.0,
        help="level of the sound over the noise (default: 20)",
    )
    parser.add_argument(
        "--seconds",
        metavar="S",
        type=float,
        default=0.5,
        help="duration of the sound (default: 0.5)",
    )
    take_output(parser, "directory for array.json and array.png (default: no files)")


def _prepare(options: Namespace, take: Take) -> Prepared[ResolutionResult]:
    from analysis.arrays.array_geometry import load_geometry

    geometry = load_geometry(options.geometry)
    take_wanted_place(options, take)
    say(f"predicting the errors of {options.geometry}")

    from phonotaxis.arrays import prepare_resolution

    return prepare_resolution(geometry, options.snr_db, options.seconds)


COMMAND = Command(
    "array",
    "predict what an array of microphones can resolve",
    _add_arguments,
    _prepare,
    where="\nresults in {out}",
    examples=(
        "array array.yaml",
        "array array.yaml --snr-db 10 --seconds 2 --out results/array",
    ),
)
