"""Recordings of talkers for ``studies.talkers``: still ones, and ones who walk.

A room with talkers all around the array serves for several recordings: each draws some
of the places, and new voices.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import soundfile
from numpy.typing import NDArray
from scipy.signal import resample_poly

from studies.support.moving_talkers import moving_sound, ring_scene
from studies.support.talker_trials import (
    TALKER_ARRAYS,
    draw_talkers,
    heard_from,
    impulse_responses,
    talker_sounds,
    with_noise,
)

RATE = 16_000
SECONDS = 3.0
SNR_DB = 20.0

# Recordings from one room, and voices made of one by playing it faster and slower.
_OF_A_ROOM = 25
_SPEEDS = (88, 94, 100, 106, 112)

Voices = Sequence[NDArray[np.float64]] | None


class Recording(NamedTuple):
    """What an array heard, and of whom."""

    channels: NDArray[np.float32]
    """(n, samples)."""
    bearings_deg: list[float]
    """Of the talkers."""


class Walk(NamedTuple):
    """Two talkers who pass each other."""

    channels: NDArray[np.float32]
    """(n, samples)."""
    bearings_deg: NDArray[np.float64]
    """(2, samples)."""


def voices_of(folder: Path | None) -> Voices:
    """Each mono WAV in a folder as five voices; None: synthetic speech."""
    if folder is None:
        return None
    voices = []
    for path in sorted(folder.glob("*.wav")):
        sound, rate = soundfile.read(path, always_2d=True)
        if sound.shape[1] == 1:
            voices += [
                resample_poly(sound[:, 0], 100 * RATE, speed * rate)
                for speed in _SPEEDS
            ]
    if not voices:
        raise SystemExit(f"{folder}: no mono WAV; give a folder with recorded speech")
    return voices


def talkers(
    array: str,
    count: int,
    apart_deg: float,
    t60_s: float,
    draws: int,
    seed: int,
    voices: Voices = None,
) -> Iterator[Recording]:
    """Talkers side by side who all speak for the whole of a recording."""
    microphones = TALKER_ARRAYS[array]
    places = 18 if apart_deg == 20.0 else 24
    step = round(apart_deg * places / 360.0)
    rng = np.random.default_rng([seed, count, round(apart_deg), round(10 * t60_s)])
    for k in range(draws):
        if k % _OF_A_ROOM == 0:
            scene = draw_talkers(rng, places, 360.0 / places, t60_s=t60_s)
            responses = impulse_responses(scene, microphones)
        who = (rng.integers(places) + step * np.arange(count)) % places
        sounds = talker_sounds(count, rng, seconds=SECONDS, voices=voices)
        yield Recording(
            _heard(responses[who], sounds, rng), [scene.bearings_deg[i] for i in who]
        )


def noises(
    array: str, count: int, t60_s: float, draws: int, seed: int
) -> Iterator[Recording]:
    """The same of stationary white noises, 60 deg apart."""
    rng = np.random.default_rng([seed, 99])
    samples = round(SECONDS * RATE)
    voices = [rng.standard_normal(samples) for _ in range(20)]
    yield from talkers(array, count, 60.0, t60_s, draws, seed, voices)


def crossings(
    array: str,
    speeds_deg_s: tuple[float, float],
    t60_s: float,
    draws: int,
    seed: int,
    seconds: float = 6.0,
) -> Iterator[Walk]:
    """Two talkers who walk around the array and meet halfway through a recording."""
    reach = 0.5 * seconds * max(abs(speed) for speed in speeds_deg_s)
    scene = ring_scene(-reach - 2.0, reach + 2.0, t60_s=t60_s)
    responses = impulse_responses(scene, TALKER_ARRAYS[array])
    rng = np.random.default_rng([seed, round(10 * t60_s)])
    t_s = np.arange(round(seconds * RATE)) / RATE
    ways = np.array([speed * (t_s - 0.5 * seconds) for speed in speeds_deg_s])
    first, step = scene.bearings_deg[0], scene.bearings_deg[1] - scene.bearings_deg[0]
    for _ in range(draws):
        sounds = talker_sounds(2, rng, seconds=seconds)
        heard = np.sum(
            [
                moving_sound(responses, sound, (way - first) / step)
                for sound, way in zip(sounds, ways, strict=True)
            ],
            axis=0,
        )
        yield Walk(with_noise(heard, SNR_DB, rng).astype(np.float32), ways)


def mixtures(
    folder: Path, turns: Sequence[int], bearing_deg: float
) -> Iterator[Recording]:
    """Recordings of a square of four that are turned by quarters, and added.

    Each is of one source at the same bearing; the channels of a square turned by a
    quarter are those of a source that is turned.
    """
    files = [soundfile.read(path)[0].T for path in sorted(folder.rglob("*.wav"))]
    for k in range(len(files)):
        chosen = [files[(k + 2 * i) % len(files)] for i in range(len(turns))]
        length = min(sound.shape[1] for sound in chosen)
        # Microphone i of the turned array stands where i - turn stood.
        parts = [
            np.roll(sound[:, :length] / sound.std(), turn, axis=0)
            for sound, turn in zip(chosen, turns, strict=True)
        ]
        bearings = [bearing_deg + 90.0 * turn for turn in turns]
        mixed = np.sum(parts, axis=0)
        yield Recording(mixed.astype(np.float32), bearings)


def _heard(
    responses: NDArray[np.float64],
    sounds: NDArray[np.float64],
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    parts = [heard_from(r, s) for r, s in zip(responses, sounds, strict=True)]
    return with_noise(np.sum(parts, axis=0), SNR_DB, rng).astype(np.float32)
