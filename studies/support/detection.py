"""How often noise is taken for a sound, and a sound in noise is heard."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.arrays.single_frames import Loudspeaker
from systems.framework.noise import tick_generator
from systems.framework.signals import FRAME_SAMPLES, TICK_S
from systems.hearing.localize import HearingMemory, Localizer
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

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


@dataclass(frozen=True)
class FalseAlarms:
    """Frames of noise in which a sound was heard, at one rate."""

    rate: float
    """``TDOAParameters.false_alarm_rate``."""
    frames: int
    count: int


def false_alarms(
    rates: Sequence[float], frames: int, *, shape: ArrayShape, c: float, seed: int
) -> list[FalseAlarms]:
    """How often white noise is taken for a sound.

    Whether such a sound is located as well, which is far rarer, does not count.

    Args:
        rates: To set.
        frames: Successive frames of noise, the same for every rate.
        shape: The microphones, in the plane.
        c: Speed of sound, m/s.
        seed: Of the noise.

    Returns:
        How many of the frames were taken for a sound, one a rate.
    """
    localizers = [
        Localizer(TDOAParameters(false_alarm_rate=rate), shape, c) for rate in rates
    ]
    memories = [localizer.blank() for localizer in localizers]
    counts = [0] * len(rates)
    for tick in range(frames):
        noise = tick_generator(seed, tick).standard_normal(
            (shape.count, FRAME_SAMPLES), dtype=np.float32
        )
        for k, localizer in enumerate(localizers):
            _, after = localizer.localize(noise, memories[k])
            # What is heard says nothing about the noise.
            counts[k] += after.energy == memories[k].energy
            memories[k] = after
    return [
        FalseAlarms(rate, frames, count)
        for rate, count in zip(rates, counts, strict=True)
    ]


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

    Returns:
        Frames located, ranged and wrong, one a level.
    """
    localizer = Localizer(parameters or TDOAParameters(), shape, c)
    points = []
    for level in levels_db:
        noise_pa = loudspeaker.level_pa / range_m * 10.0 ** (-level / 20.0)
        memory = _after_noise(localizer, noise_pa, seed)
        heard = ranged = wrong = 0
        for trial in range(trials):
            rng = tick_generator(seed, trial)
            bearing = rng.uniform(-math.pi / 3.0, math.pi / 3.0)
            p_AS = range_m * np.array([math.cos(bearing), math.sin(bearing)])
            begin = rng.uniform(0.1, loudspeaker.seconds - 2.0 * TICK_S)
            frame = loudspeaker.pressure(begin, p_AS, shape.p_AM, c)
            frame += noise_pa * rng.standard_normal(frame.shape, dtype=np.float32)
            fix, _ = localizer.localize(frame, memory)
            if fix is None:
                continue
            heard += 1
            ranged += fix.range_valid
            error = abs(fix.bearing - bearing)
            wrong += error > max(math.radians(_WRONG_DEG), 5.0 * fix.bearing_std)
        points.append(DetectionPoint(level, trials, heard, ranged, wrong))
    return points


def _after_noise(localizer: Localizer, noise_pa: float, seed: int) -> HearingMemory:
    memory = localizer.blank()
    shape = (localizer.plan.shape.count, FRAME_SAMPLES)
    for k in range(_NOISE_FRAMES):
        noise = tick_generator(seed, -1 - k).standard_normal(shape, dtype=np.float32)
        _, memory = localizer.localize(np.float32(noise_pa) * noise, memory)
    return memory
