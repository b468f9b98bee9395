"""What is heard in noise: detection against the level, and false alarms.

``--picture FILE.png`` draws the detection curve, too, for docs/results_hearing.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from analysis.arrays.single_frames import Loudspeaker
from studies.support.detection import (
    DetectionPoint,
    FalseAlarms,
    detection_curve,
    false_alarms,
)
from studies.support.detection_plots import plot_detection
from studies.tables import Table
from systems.base.robot import RobotParameters
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
LEVELS_DB = [float(level) for level in range(-16, 13, 2)]
RATES = (1e-1, 1e-2, 1e-3, 1e-4)


def detection_rows(
    trials: int, curves: dict[str, list[DetectionPoint]]
) -> Iterator[Sequence[str]]:
    """Share of frames heard, with a range, and wrong, against the level.

    Args:
        trials: Frames a level.
        curves: Gets the points by sound.
    """
    for kind in ("chirp", "band_noise"):
        points = detection_curve(
            Loudspeaker.of(kind, seed=3),
            LEVELS_DB,
            shape=SHAPE,
            c=C,
            trials=trials,
            seed=5,
        )
        for what in ("heard", "ranged", "wrong"):
            shares = (getattr(point, what) / point.trials for point in points)
            row = (f"{100.0 * share:.1f}" for share in shares)
            yield f"{kind}, {what}, %", *row
        curves[kind] = points


def false_alarms_table(alarms: Sequence[FalseAlarms], frames: int) -> Table:
    """Measured beside set rates, in noise alone."""
    rows = [
        (f"{alarm.rate:g}", f"{alarm.count / frames:.2g} ({alarm.count})")
        for alarm in alarms
    ]
    head = ("set rate", f"share of {frames} frames of noise")
    return Table("false alarms", head, rows)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--trials", type=int, default=500, help="frames a level")
    parser.add_argument("--noise-frames", type=int, default=24_000, help="10 minutes")
    parser.add_argument("--picture", type=Path, help="PNG file to draw")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """Both tables; draws the curve where it is asked for."""
    curves: dict[str, list[DetectionPoint]] = {}
    head = ["sound", *(f"{level:g} dB" for level in LEVELS_DB)]
    yield Table("detection", head, detection_rows(options.trials, curves))
    rate, frames = TDOAParameters().false_alarm_rate, options.noise_frames
    alarms = false_alarms((*RATES, rate), frames, shape=SHAPE, c=C, seed=9)
    yield false_alarms_table(alarms, frames)
    if options.picture is not None:
        plot_detection(curves, alarms, rate).savefig(options.picture, dpi=110)
