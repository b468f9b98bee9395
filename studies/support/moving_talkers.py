"""Talkers who walk around an array while they talk."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.support.talker_trials import TalkerScene, heard_from
from systems.framework.input_error import InputError


def ring_scene(
    from_deg: float,
    to_deg: float,
    *,
    step_deg: float = 2.0,
    distance_m: float = 1.5,
    elevation_deg: float = 10.0,
    t60_s: float = 0.0,
    snr_db: float = 20.0,
) -> TalkerScene:
    """Places side by side on an arc around the array, in the middle of the room.

    Args:
        from_deg: Bearing of the first place, deg.
        to_deg: Bearing up to which they reach, deg; larger.
        step_deg: Between neighbors, deg.
        distance_m: From the array, m.
        elevation_deg: Above it, deg.
        t60_s: Reverberation time, s.
        snr_db: Over the noise, dB.

    Returns:
        The scene: a talker at each place.
    """
    count = math.ceil((to_deg - from_deg) / step_deg) + 1
    return TalkerScene(
        bearings_deg=tuple((from_deg + step_deg * np.arange(count)).tolist()),
        elevations_deg=(elevation_deg,) * count,
        distances_m=(distance_m,) * count,
        center_m=(3.0, 2.5, 1.2),
        t60_s=t60_s,
        snr_db=snr_db,
    )


def moving_sound(
    responses: NDArray[np.float64], sound: NDArray[np.float64], place: ArrayLike
) -> NDArray[np.float64]:
    """What an array hears of a sound that moves over places.

    Between two places it fades from one to the other. They must be so near to each
    other that their delays differ by less than a quarter of a period.

    Args:
        responses: (k, n, taps) of the places in their order.
        sound: (samples,).
        place: (samples,) where it is at each sample, 0 at the first place and k - 1
            at the last.

    Returns:
        (n, samples).

    Raises:
        InputError: It leaves the places.
    """
    at = np.asarray(place, dtype=np.float64)
    if not (at.min() >= 0.0 and at.max() <= len(responses) - 1):
        raise InputError(
            "place",
            f"{at.min():g} to {at.max():g}, of {len(responses)} places; stay within",
        )
    heard = np.zeros((responses.shape[1], sound.size))
    for k, response in enumerate(responses):
        share = np.maximum(0.0, 1.0 - np.abs(at - k))
        if share.any():
            heard += heard_from(response, share * sound)
    return heard
