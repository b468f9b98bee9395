"""How often noise is taken for a sound, and a sound in noise is heard."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.free_field import Loudspeaker
from systems.array_shape import ArrayShape
from systems.delays import look
from systems.localise import HearingMemory, Localiser, TDOAParameters
from systems.mic_array import FRAME_SAMPLES
from systems.noise import tick_generator
from systems.signals import FRAME_PERIOD_S

__all__ = ["DetectionPoint", "detection_curve", "noise_chances"]

#: Frames of noise alone before a sound, which tell its level.
_NOISE_FRAMES = 8

#: A bearing that is off by more is wrong, deg.
_WRONG_DEG = 5.0


@dataclass(frozen=True)
class DetectionPoint:
    """What became of frames with a sound at one level."""

    snr_db: float
    """Level of the sound at the array over the noise from 0 to 50 kHz, dB."""
    trials: int
    heard: int
    """Frames in which a sound was located."""
    ranged: int
    """Those with a range."""
    wrong: int
    """Those whose bearing is off by more than 5 deg and five of its stated
    standard deviations."""


def noise_chances(
    frames: int, *, shape: ArrayShape, c: float, seed: int
) -> NDArray[np.float64]:
    """(frames,) what the search makes of white noise.

    Each is the probability that noise has peaks as high: a false alarm of every
    rate above it.
    """
    plan = Localiser.of(TDOAParameters(), shape, c).plan
    chances = []
    for tick in range(frames):
        noise = tick_generator(seed, tick).standard_normal(
            (shape.count, FRAME_SAMPLES), dtype=np.float32
        )
        seen = look(noise, plan)
        assert seen is not None
        chances.append(seen[0].chance)
    return np.array(chances)


def detection_curve(
    loudspeaker: Loudspeaker,
    levels_db: list[float],
    *,
    shape: ArrayShape,
    c: float,
    trials: int,
    seed: int,
    range_m: float = 2.0,
    parameters: TDOAParameters | None = None,
) -> list[DetectionPoint]:
    """Frames heard against the level of the sound.

    Args:
        loudspeaker: What sounds.
        levels_db: Levels at the array over the noise, dB.
        shape: The microphones, in the plane.
        c: Speed of sound, m/s.
        trials: Frames a level, from bearings of -60 to 60 deg.
        seed: Of stretches, bearings and noise.
        range_m: Of the source, m.
        parameters: Of the estimator.
    """
    localiser = Localiser.of(parameters or TDOAParameters(), shape, c)
    points = []
    for level in levels_db:
        noise_pa = loudspeaker.level_pa / range_m * 10.0 ** (-level / 20.0)
        memory = _after_noise(localiser, noise_pa, seed)
        heard = ranged = wrong = 0
        for trial in range(trials):
            rng = tick_generator(seed, trial)
            bearing = rng.uniform(-math.pi / 3.0, math.pi / 3.0)
            p_AS = range_m * np.array([math.cos(bearing), math.sin(bearing)])
            begin = rng.uniform(0.1, loudspeaker.seconds - 2.0 * FRAME_PERIOD_S)
            frame = loudspeaker.pressure(begin, p_AS, shape.p_AM, c)
            frame += noise_pa * rng.standard_normal(frame.shape, dtype=np.float32)
            fix, _ = localiser.localise(frame, memory)
            if fix is None:
                continue
            heard += 1
            ranged += fix.range_valid
            error = abs(fix.bearing - bearing)
            wrong += error > max(math.radians(_WRONG_DEG), 5.0 * fix.bearing_std)
        points.append(DetectionPoint(level, trials, heard, ranged, wrong))
    return points


def _after_noise(localiser: Localiser, noise_pa: float, seed: int) -> HearingMemory:
    memory = localiser.blank()
    shape = (localiser.plan.shape.count, FRAME_SAMPLES)
    for k in range(_NOISE_FRAMES):
        noise = tick_generator(seed, -1 - k).standard_normal(shape, dtype=np.float32)
        _, memory = localiser.localise(np.float32(noise_pa) * noise, memory)
    return memory
