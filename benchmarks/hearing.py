"""``python -m benchmarks.hearing``: time a frame, and what is heard in noise.

``--picture FILE.png`` draws the detection curve, too, as in
``docs/localization.md``. Times are processor time on one core, the best of
several rounds; exit status 1 if one misses its bound.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from time import process_time

import numpy as np
from numpy.typing import NDArray

from analysis.hearing.detection import (
    DetectionPoint,
    FalseAlarms,
    detection_curve,
    false_alarms,
)
from analysis.hearing.detection_plots import plot_detection
from analysis.hearing.free_field import Loudspeaker
from analysis.reporting.markdown import markdown_head, markdown_row
from benchmarks.figures import Figure, print_figures, stay_on_one_core
from systems.base.robot import RobotParameters
from systems.framework.signals import FRAME_SAMPLES
from systems.hearing.localise import HearingMemory, Localiser
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
LEVELS_DB = [float(level) for level in range(-16, 13, 2)]
RATES = (1e-1, 1e-2, 1e-3, 1e-4)

#: Frames a round, and rounds; the fastest counts.
FRAMES, ROUNDS = 40, 7

#: A source, and the image of it that a wall 1.5 m behind the robot makes, m.
SOURCE, IMAGE = np.array([2.0, 1.0]), np.array([-5.0, 1.0])


def frames_to_hear() -> dict[str, list[NDArray[np.float32]]]:
    """Frames of noise alone, of a sound 20 dB above it, and of that with echoes."""
    loudspeaker, rng = Loudspeaker.of("chirp", seed=3), np.random.default_rng(1)
    level = loudspeaker.level_pa / float(np.linalg.norm(SOURCE))
    frames: dict[str, list[NDArray[np.float32]]] = {
        "noise": [],
        "sound": [],
        "echo": [],
    }
    for begin in np.linspace(0.1, 1.9, FRAMES):
        shape = (SHAPE.count, FRAME_SAMPLES)
        noise = 0.1 * level * rng.standard_normal(shape, dtype=np.float32)
        sound = noise + loudspeaker.pressure(begin, SOURCE, SHAPE.p_AM, C)
        echo = sound + loudspeaker.pressure(begin, IMAGE, SHAPE.p_AM, C)
        for name, frame in (("noise", noise), ("sound", sound), ("echo", echo)):
            frames[name].append(frame)
    return frames


def frame_time_ms(
    localiser: Localiser, frames: list[NDArray[np.float32]], memory: HearingMemory
) -> float:
    """Processor time a frame, ms."""
    rounds = []
    for _ in range(ROUNDS + 1):  # the first one compiles
        start = process_time()
        for frame in frames:
            localiser.localise(frame, memory)
        rounds.append(process_time() - start)
    return 1e3 * min(rounds[1:]) / len(frames)


def frame_figures() -> list[Figure]:
    """Times beside the bounds of the fast method and of maximum likelihood."""
    gcc = Localiser(TDOAParameters(), SHAPE, C)
    ml = Localiser(TDOAParameters(method="ml"), SHAPE, C)
    frames = frames_to_hear()
    memory = gcc.blank()
    for frame in frames["noise"]:
        _, memory = gcc.localise(frame, memory)
    return [
        Figure(f"{title}, ms a frame", frame_time_ms(*heard, memory), "<=", bound)
        for title, heard, bound in (
            ("noise", (gcc, frames["noise"]), 0.4),
            ("sound, gcc", (gcc, frames["sound"]), 0.4),
            ("sound with echoes, gcc", (gcc, frames["echo"]), 4.0),
            ("sound, ml", (ml, frames["sound"]), 4.0),
        )
    ]


def print_detection(trials: int) -> dict[str, list[DetectionPoint]]:
    """Share of frames heard, with a range, and wrong, against the level.

    Returns:
        The points by sound.
    """
    curves = {}
    print(markdown_head(["sound", *(f"{level:g} dB" for level in LEVELS_DB)]))
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
            row = [f"{100.0 * share:.1f}" for share in shares]
            print(markdown_row([f"{kind}, {what}, %", *row]), flush=True)
        curves[kind] = points
    return curves


def print_false_alarms(frames: int) -> list[FalseAlarms]:
    """Measured beside set rates, in noise alone."""
    rates = (*RATES, TDOAParameters().false_alarm_rate)
    alarms = false_alarms(rates, frames, shape=SHAPE, c=C, seed=9)
    print(markdown_head(["set rate", f"share of {frames} frames of noise"]))
    for alarm in alarms:
        share = f"{alarm.count / frames:.2g} ({alarm.count})"
        print(markdown_row([f"{alarm.rate:g}", share]))
    return alarms


def main() -> int:
    """Prints times, the detection curve and the false alarms."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=500, help="frames a level")
    parser.add_argument("--noise-frames", type=int, default=24_000, help="10 minutes")
    parser.add_argument("--picture", type=Path, help="PNG file to draw")
    arguments = parser.parse_args()
    if min(arguments.trials, arguments.noise_frames) < 1:
        parser.error("--trials and --noise-frames must be at least 1")
    stay_on_one_core()
    status = print_figures(frame_figures())
    print()
    curves = print_detection(arguments.trials)
    print()
    alarms = print_false_alarms(arguments.noise_frames)
    if arguments.picture is not None:
        rate = TDOAParameters().false_alarm_rate
        plot_detection(curves, alarms, rate).savefig(arguments.picture, dpi=110)
    return status


if __name__ == "__main__":
    sys.exit(main())
