"""``python -m benchmarks.hearing``: time to hear a frame.

Times are processor time on one core, the best of several rounds; exit status 1 if one
misses its bound.
"""

from __future__ import annotations

import sys
from time import process_time

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.single_frames import Loudspeaker
from studies.support.figures import Figure, print_figures, stay_on_one_core
from systems.base.robot import RobotParameters
from systems.framework.signals import FRAME_SAMPLES
from systems.hearing.localize import HearingMemory, Localizer
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)

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
    localizer: Localizer, frames: list[NDArray[np.float32]], memory: HearingMemory
) -> float:
    """Processor time a frame, ms."""
    rounds = []
    for _ in range(ROUNDS + 1):  # the first one compiles
        start = process_time()
        for frame in frames:
            localizer.localize(frame, memory)
        rounds.append(process_time() - start)
    return 1e3 * min(rounds[1:]) / len(frames)


def frame_figures() -> list[Figure]:
    """Times beside the bounds of the fast method and of maximum likelihood."""
    gcc = Localizer(TDOAParameters(), SHAPE, C)
    ml = Localizer(TDOAParameters(method="ml"), SHAPE, C)
    frames = frames_to_hear()
    memory = gcc.blank()
    for frame in frames["noise"]:
        _, memory = gcc.localize(frame, memory)
    return [
        Figure(f"{title}, ms a frame", frame_time_ms(*heard, memory), "<=", bound)
        for title, heard, bound in (
            ("noise", (gcc, frames["noise"]), 0.4),
            ("sound, gcc", (gcc, frames["sound"]), 0.4),
            ("sound with echoes, gcc", (gcc, frames["echo"]), 4.0),
            ("sound, ml", (ml, frames["sound"]), 4.0),
        )
    ]


if __name__ == "__main__":
    stay_on_one_core()
    sys.exit(print_figures(frame_figures()))
