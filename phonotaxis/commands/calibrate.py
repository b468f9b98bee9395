"""``phonotaxis calibrate``: finds microphone positions by sounds at known positions."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import say, take_output, take_wanted_place
from phonotaxis.commands.command import Command, Take

if TYPE_CHECKING:
    from phonotaxis.recordings import CalibrationResult
    from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "sounds",
        metavar="SOUNDS.yaml",
        help="recordings, and the positions of their sources",
    )
    parser.add_argument(
        "--geometry", metavar="FILE.yaml", help="stated positions of the microphones"
    )
    take_output(
        parser, "directory for array.yaml, calibration.json (default: no files)"
    )


def _prepare(options: Namespace, take: Take) -> Prepared[CalibrationResult]:
    from analysis.arrays.array_geometry import ArrayGeometry, load_geometry
    from analysis.arrays.calibration_sounds import load_calibration_sounds

    sounds = load_calibration_sounds(options.sounds)
    given = options.geometry
    geometry = load_geometry(given) if given else ArrayGeometry()
    take_wanted_place(options, take)
    say(f"calibrating by {options.sounds}")

    from phonotaxis.recordings import prepare_calibration

    return prepare_calibration(sounds, geometry)


COMMAND = Command(
    "calibrate",
    "positions of microphones from sounds at known positions",
    _add_arguments,
    _prepare,
    where="geometry in {out}/array.yaml",
    examples=("calibrate sounds.yaml --out results/calibrated",),
)
