"""Each source is one track: talkers at rest with pauses, and sources that turn fast."""

from __future__ import annotations

from functools import partial

import numpy as np

from studies.support.hearing_cases.case import HearingCase, Outcome
from studies.support.hearing_cases.one_opinion import (
    RATE,
    SQUARE,
    Array,
    circle,
    off_deg,
    record,
    speech,
    tracks_of,
)
from studies.support.moving_talkers import moving_sound, ring_scene
from studies.support.talker_trials import impulse_responses, with_noise

TITLE = "identities"

_WITHIN_DEG = 10.0
_SECONDS = 8.0


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    found = []
    seed = 0
    for name, places in (("square", SQUARE), ("circle of 6", circle(6, 0.0465))):
        for t60 in (0.2, 0.4):
            for bearings in ((0.0, -45.0), (30.0, 120.0), (0.0, 60.0, -100.0)):
                for pause_s in (0.0, 2.0):
                    seed += 1
                    judge = partial(_resting, places, bearings, t60, pause_s, seed)
                    text = f"{name}, {bearings}, T60 {t60} s"
                    text += f", with pauses of {pause_s:g} s" if pause_s else ""
                    found.append(HearingCase(text, judge))
    for speed in (10.0, -20.0, 45.0, 90.0):
        for kind in ("noise", "talker"):
            judge = partial(_turning, speed, kind)
            found.append(HearingCase(f"{kind} at {speed:g} deg/s", judge))
    return found


def _resting(
    places: Array, bearings: tuple[float, ...], t60_s: float, pause_s: float, seed: int
) -> Outcome:
    sounds = []
    for k, bearing in enumerate(bearings):
        sound = speech(10 * seed + k, _SECONDS)
        first = round((1.5 + 1.2 * k) * RATE)
        sound[first : first + round(pause_s * RATE)] = 0.0
        sounds.append((sound, (bearing, 5.0 + 20.0 * (k == 0)), 1.2))
    samples = record(places, sounds, t60_s=t60_s, seed=seed)
    tracks = tracks_of(samples, places, RATE)
    said = {k: round(float(np.median(b))) for k, b in tracks.items()}
    near = [
        any(off_deg(float(np.median(b)), at) < _WITHIN_DEG for b in tracks.values())
        for at in bearings
    ]
    return Outcome(all(near) and len(tracks) == len(bearings), str(said))


def _turning(speed_deg_s: float, kind: str) -> Outcome:
    seconds = 5.0
    way = speed_deg_s * np.arange(round(RATE * seconds)) / RATE
    scene = ring_scene(float(way.min()) - 3.0, float(way.max()) + 3.0, step_deg=3.0)
    sound = speech(7, seconds)
    if kind == "noise":
        sound = np.random.default_rng(7).standard_normal(way.size)
    heard = moving_sound(
        impulse_responses(scene, SQUARE), sound, (way - scene.bearings_deg[0]) / 3.0
    )
    samples = with_noise(heard, 25.0, np.random.default_rng(8))
    tracks = tracks_of(samples, SQUARE, RATE)
    longest = max(len(b) for b in tracks.values()) if tracks else 0
    # The source may be heard as another one while its rate is not known yet.
    right = len(tracks) <= (2 if abs(speed_deg_s) > 30.0 else 1) and longest > 25
    return Outcome(right, str({k: len(b) for k, b in tracks.items()}))
