"""Makes the settings with which an array listens for talkers."""

from __future__ import annotations

from analysis.arrays.voting.direction_votes import VotePlan
from systems.sound.array_shape import ArrayShape

# Highest frequency to use, Hz. Lower frequencies suffice to separate speech and most
# noises.
_HIGHEST_HZ = 8_000.0


def vote_plan(
    shape: ArrayShape, c: float, sample_rate_hz: float, band_hz: tuple[float, float]
) -> VotePlan:
    """Makes the settings with which an array votes for directions in a useful band.

    Args:
        shape: The n microphones, which must measure bearings.
        c: Speed of sound, m/s.
        sample_rate_hz: Sample rate, Hz.
        band_hz: Lowest and highest frequency of the sound, Hz. The votes use no
            frequencies above 8 kHz or twice the lowest frequency, whichever is larger.

    Returns:
        The settings.

    Raises:
        InputError: The array cannot measure bearings.
    """
    highest = min(band_hz[1], max(_HIGHEST_HZ, 2.0 * band_hz[0]))
    return VotePlan.of(shape, c, sample_rate_hz, band_hz=(band_hz[0], highest))
