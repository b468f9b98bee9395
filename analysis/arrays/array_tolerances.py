"""Draws errors of a real microphone array: positions, delays and gains."""

from __future__ import annotations

from typing import NamedTuple

from numpy.random import Generator

from systems.sound.real_array import ChannelErrors


class ArrayTolerances(NamedTuple):
    """Largest errors of an array and of the assumed speed of sound."""

    position_m: float = 0.0
    """Largest error of the position of each microphone in x and in y, m."""
    delay_s: float = 0.0
    """Largest time by which each channel is sampled earlier or later, s."""
    gain_db: float = 0.0
    """Largest error of the gain of each channel, dB."""
    sound_speed_share: float = 0.0
    """Largest error of the speed of sound, as a share of the speed."""


def draw_errors(
    tolerances: ArrayTolerances, count: int, generator: Generator
) -> tuple[ChannelErrors, float]:
    """Draws errors of an array of ``count`` microphones, uniform within tolerances.

    The second result is the true speed of sound divided by the assumed one.
    """
    places = generator.uniform(-1.0, 1.0, (count, 2))
    delays = generator.uniform(-1.0, 1.0, count)
    gains_db = generator.uniform(-1.0, 1.0, count) * tolerances.gain_db
    errors = ChannelErrors(
        position_errors=places * tolerances.position_m,
        channel_delays=delays * tolerances.delay_s,
        gains=10.0 ** (gains_db / 20.0),
    )
    return errors, 1.0 + tolerances.sound_speed_share * generator.uniform(-1.0, 1.0)
