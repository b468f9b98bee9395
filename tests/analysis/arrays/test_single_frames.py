"""Single frames of sound in the free field."""

from __future__ import annotations

import math

import numpy as np
from scipy import fft

from analysis.arrays.single_frames import Loudspeaker
from systems.base.robot import RobotParameters
from systems.sound.array_shape import ArrayShape

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
LOUDSPEAKER = Loudspeaker.of("band_noise", seed=3)


def test_pressure_is_the_sound_delayed_and_weakened():
    """Against a delay by the Fourier transform of the whole sound."""
    p_AS = np.array([1.2, 0.7])
    begin = 0.43217
    heard = LOUDSPEAKER.pressure(begin, p_AS, SHAPE.p_AM, C)
    spectrum = fft.rfft(LOUDSPEAKER.samples.astype(float))
    frequency = fft.rfftfreq(len(LOUDSPEAKER.samples), 1e-5)
    for channel, p in zip(heard, SHAPE.p_AM, strict=True):
        distance = math.hypot(*(p_AS - p))
        turned = spectrum * np.exp(2j * np.pi * frequency * (begin - distance / C))
        exact = fft.irfft(turned, len(LOUDSPEAKER.samples))[:2500] / distance
        np.testing.assert_allclose(channel, exact, atol=1e-4 * exact.std())
