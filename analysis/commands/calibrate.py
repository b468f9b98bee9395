"""``phonotaxis calibrate``: microphone positions from sounds at known positions."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.commands.arguments import take_json
from analysis.commands.command import Command, Job, Take
from analysis.commands.first_words import say

if TYPE_CHECKING:
    from analysis.calibration.calibrate import CalibrationRun


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "sounds",
        metavar="SOUNDS.yaml",
        help="recordings, and the positions of their sources",
    )
    parser.add_argument(
        "--geometry", metavar="FILE.yaml", help="stated positions of the microphones"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="directory for array.yaml and calibration.json"
    )
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Job[CalibrationRun]:
    from analysis.calibration.calibration_sounds import load_calibration_sounds
    from analysis.recordings.array_geometry import ArrayGeometry, load_geometry

    sounds = load_calibration_sounds(Path(options.sounds))
    geometry = (
        load_geometry(Path(options.geometry)) if options.geometry else ArrayGeometry()
    )
    place = take(options.out) if options.out is not None else None
    say(f"calibrating by {options.sounds}")

    from analysis.calibration.calibrate import calibrate
    from analysis.calibration.calibration_text import (
        calibration_document,
        calibration_text,
        write_calibration,
    )

    def summary(run: CalibrationRun) -> dict[str, Any]:
        where = {"out": str(place.out)} if place is not None else {}
        return {**calibration_document(run), **where}

    def write(run: CalibrationRun, document: dict[str, Any]) -> None:
        if place is not None:
            write_calibration(document, place.directory)

    return Job(
        run=lambda _: calibrate(sounds, geometry),
        summary=summary,
        text=lambda run, _: calibration_text(run),
        out=place.out if place is not None else None,
        write=write,
        where="geometry in {out}/array.yaml",
        remarks=lambda run: run.remarks,
    )


COMMAND = Command(
    "calibrate",
    "positions of microphones from sounds at known positions",
    _add_arguments,
    _prepare,
    examples=("calibrate sounds.yaml --out results/calibrated",),
)
