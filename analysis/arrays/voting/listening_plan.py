"""How an array listens for talkers."""

from __future__ import annotations

from analysis.arrays.voting.direction_votes import VotePlan
from systems.sound.array_shape import ArrayShape

# Speech and most noises have what is told apart below this.
_HIGHEST_HZ = 8_000.0


def vote_plan(
    shape: ArrayShape, c: float, sample_rate_hz: float, band_hz: tuple[float, float]
) -> VotePlan:
    """How an array votes in a band that may be wider than what is told apart.

    Args:
        shape: The n microphones; they must tell bearings.
        c: Speed of sound, m/s.
        sample_rate_hz: Of the samples, Hz.
        band_hz: Lowest and highest frequency that counts, Hz.

    Returns:
        The plan.

    Raises:
        InputError: The array tells no bearings.
    """
    highest = min(band_hz[1], max(_HIGHEST_HZ, 2.0 * band_hz[0]))
    return VotePlan.of(shape, c, sample_rate_hz, band_hz=(band_hz[0], highest))
