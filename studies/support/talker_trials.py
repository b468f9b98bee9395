"""Recordings of several simulated talkers in a room, and what is found in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import oaconvolve

from studies.support.synthetic_speech import speech_like
from systems.framework.input_error import InputError

ROOM_M = (6.0, 5.0, 2.8)
#: Images of a source are counted so many walls deep.
_MOST_REFLECTIONS = 60

_CIRCLE = [
    [0.1 * math.cos(a), 0.1 * math.sin(a), 0.0] for a in np.pi * np.arange(8) / 4
]
#: Microphones of the arrays that are tried, m.
TALKER_ARRAYS: dict[str, NDArray[np.float64]] = {
    "square, 4.6 cm": 0.023
    * np.array(
        [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]]
    ),
    "circle of 8, 20 cm": np.array(_CIRCLE),
    "tetrahedron, 8 cm": 0.08
    / math.sqrt(8.0)
    * np.array(
        [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]
    ),
}


@dataclass(frozen=True)
class TalkerScene:
    """Who talks from where, and in which room."""

    bearings_deg: tuple[float, ...]
    """Of the talkers from the array, deg."""
    elevations_deg: tuple[float, ...]
    """As many, deg."""
    distances_m: tuple[float, ...]
    """As many, m."""
    center_m: tuple[float, float, float]
    """Of the array, in the room."""
    t60_s: float = 0.3
    """Reverberation time by Sabine's formula, s; 0: the free field."""
    snr_db: float = 20.0
    """Of all talkers together over white noise in each channel, dB."""


def draw_talkers(
    rng: np.random.Generator,
    talkers: int,
    separation_deg: float,
    *,
    t60_s: float,
    snr_db: float = 20.0,
) -> TalkerScene:
    """Talkers side by side, at 1 to 2 m, 0 to 20 deg above the array.

    Args:
        rng: Draws the first bearing, the distances, heights and the array's place.
        talkers: Their number.
        separation_deg: Between neighbors, deg.
        t60_s: Reverberation time, s.
        snr_db: Over the noise, dB.

    Returns:
        The scene.

    Raises:
        InputError: They do not fit around the array.
    """
    if talkers < 1 or (talkers > 1 and talkers * separation_deg > 360.0):
        raise InputError(
            "talkers", f"{talkers} at {separation_deg:g} deg do not fit into 360 deg"
        )
    first = rng.uniform(-180.0, 180.0)
    bearings = (first + separation_deg * np.arange(talkers) + 180.0) % 360.0 - 180.0
    x, y, z = rng.uniform((2.3, 2.2, 1.0), (3.7, 2.8, 1.4))
    return TalkerScene(
        bearings_deg=tuple(bearings.tolist()),
        elevations_deg=tuple(rng.uniform(0.0, 20.0, talkers).tolist()),
        distances_m=tuple(rng.uniform(1.0, 2.0, talkers).tolist()),
        center_m=(float(x), float(y), float(z)),
        t60_s=t60_s,
        snr_db=snr_db,
    )


def record_talkers(
    scene: TalkerScene,
    microphones: ArrayLike,
    rng: np.random.Generator,
    *,
    seconds: float = 3.0,
    sample_rate_hz: int = 16_000,
    c: float = 343.0,
    voices: Sequence[NDArray[np.float64]] | None = None,
) -> NDArray[np.float64]:
    """What an array records of talkers in a room, by image sources.

    Args:
        scene: Places, room and noise.
        microphones: (n, 3) about the array's center, m.
        rng: Draws the voices and the noise.
        seconds: How long.
        sample_rate_hz: Of the recording, Hz.
        c: Speed of sound, m/s.
        voices: As for ``talker_sounds``.

    Returns:
        (n, samples), full scale 1.

    Raises:
        InputError: There are fewer voices than talkers.
    """
    count = len(scene.bearings_deg)
    sounds = talker_sounds(
        count, rng, seconds=seconds, sample_rate_hz=sample_rate_hz, voices=voices
    )
    responses = impulse_responses(
        scene, microphones, sample_rate_hz=sample_rate_hz, c=c
    )
    heard = np.sum(
        [heard_from(r, s) for r, s in zip(responses, sounds, strict=True)], axis=0
    )
    return with_noise(heard, scene.snr_db, rng)


def talker_sounds(
    count: int,
    rng: np.random.Generator,
    *,
    seconds: float = 3.0,
    sample_rate_hz: int = 16_000,
    voices: Sequence[NDArray[np.float64]] | None = None,
) -> NDArray[np.float64]:
    """What talkers say.

    Args:
        count: Of the talkers.
        rng: Draws what they say.
        seconds: How long.
        sample_rate_hz: Of the sounds, Hz.
        voices: What is said, at that rate: different ones are drawn, repeated where
            they are too short. None: ``speech_like``.

    Returns:
        (count, samples) of RMS 1.

    Raises:
        InputError: There are fewer voices than talkers.
    """
    if voices is None:
        return np.array(
            [speech_like(rng, seconds, sample_rate_hz) for _ in range(count)]
        )
    if len(voices) < count:
        raise InputError(
            "voices", f"{len(voices)} given for {count} talkers; give one for each"
        )
    sounds = np.empty((count, round(seconds * sample_rate_hz)))
    for row, k in enumerate(rng.permutation(len(voices))[:count]):
        turned = np.roll(voices[k], rng.integers(len(voices[k])))
        sounds[row] = np.resize(turned, sounds.shape[1])
    return sounds / np.sqrt(np.mean(sounds**2, axis=1, keepdims=True))


def impulse_responses(
    scene: TalkerScene,
    microphones: ArrayLike,
    *,
    sample_rate_hz: int = 16_000,
    c: float = 343.0,
) -> NDArray[np.float64]:
    """From each talker's place to each microphone, by image sources.

    Args:
        scene: Places and room.
        microphones: (n, 3) about the array's center, m.
        sample_rate_hz: Of the responses, Hz.
        c: Speed of sound, m/s.

    Returns:
        (talkers, n, samples).
    """
    import pyroomacoustics as pra

    absorption, order = 1.0, 0
    if scene.t60_s > 0.0:
        absorption, order = pra.inverse_sabine(scene.t60_s, ROOM_M, c)
    room = pra.ShoeBox(
        ROOM_M,
        fs=sample_rate_hz,
        materials=pra.Material(absorption),
        max_order=min(order, _MOST_REFLECTIONS),
    )
    room.set_sound_speed(c)
    center = np.array(scene.center_m)
    for distance, direction in zip(scene.distances_m, _directions(scene), strict=True):
        room.add_source(center + distance * direction)
    room.add_microphone_array((np.asarray(microphones, dtype=np.float64) + center).T)
    room.compute_rir()
    length = max(len(response) for row in room.rir for response in row)
    responses = np.zeros((len(scene.distances_m), len(room.rir), length))
    for n, row in enumerate(room.rir):
        for k, response in enumerate(row):
            responses[k, n, : len(response)] = response
    return responses


def heard_from(
    responses: NDArray[np.float64], sound: NDArray[np.float64]
) -> NDArray[np.float64]:
    """What an array hears of a sound from one place.

    Args:
        responses: (n, taps) of that place.
        sound: (samples,).

    Returns:
        (n, samples).
    """
    heard = oaconvolve(sound[np.newaxis], responses, axes=1)
    return np.asarray(heard[:, : sound.size])


def with_noise(
    heard: NDArray[np.float64], snr_db: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """With white noise in each channel, scaled to be recorded.

    Args:
        heard: (n, samples).
        snr_db: Of all channels over the noise, dB.
        rng: Draws the noise.

    Returns:
        (n, samples), full scale 1.
    """
    noise = heard.std() * 10.0 ** (-snr_db / 20.0)
    heard = heard + noise * rng.standard_normal(heard.shape)
    return np.asarray(0.5 * heard / np.abs(heard).max())


def _directions(scene: TalkerScene) -> NDArray[np.float64]:
    """(talkers, 3) unit vectors."""
    azimuth = np.radians(scene.bearings_deg)
    elevation = np.radians(scene.elevations_deg)
    level = np.cos(elevation)
    parts = (level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation))
    return np.stack(parts, axis=1)


class TalkerScore(NamedTuple):
    """Bearings that were named beside the true ones."""

    found: int
    """True ones with a named one near."""
    talkers: int
    """True ones."""
    false: int
    """Named ones without a true one near."""
    errors_deg: tuple[float, ...]
    """Of those found, deg."""


def score_bearings(
    named_deg: ArrayLike, true_deg: Sequence[float], *, within_deg: float = 10.0
) -> TalkerScore:
    """Which talkers were found.

    Each is matched with one bearing at most, so that the most are found, by the
    nearest.

    Args:
        named_deg: (m,) bearings, deg.
        true_deg: (n,) true ones, deg.
        within_deg: How far off a bearing may be, deg.

    Returns:
        The counts, and the errors of those found.
    """
    from scipy.optimize import linear_sum_assignment

    named = np.atleast_1d(np.asarray(named_deg, dtype=np.float64))
    off = (named[:, np.newaxis] - np.asarray(true_deg) + 180.0) % 360.0 - 180.0
    cost = np.where(np.abs(off) <= within_deg, np.abs(off), 1e3)
    pairs = zip(*linear_sum_assignment(cost), strict=True)
    errors = tuple(float(off[i, j]) for i, j in pairs if cost[i, j] < 1e3)
    return TalkerScore(len(errors), len(true_deg), len(named) - len(errors), errors)
