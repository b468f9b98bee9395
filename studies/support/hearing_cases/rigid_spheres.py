"""Arrays on a rigid sphere, with and without its mention in the geometry."""

from __future__ import annotations

import math
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from phonotaxis import ArrayGeometry, InputError, locate
from studies.support.hearing_cases.case import CLAIM, HearingCase, Outcome
from studies.support.sphere_recordings import sphere_recording, spiral_sphere
from studies.support.synthetic_speech import speech_like

TITLE = "arrays on a rigid sphere"

_C, _SECONDS = 343.2, 2.5
_TURNS = 2.0 * math.pi * np.arange(6) / 6.0

# Unit vectors to the microphones, and the radius, m.
_ARRAYS: dict[str, tuple[NDArray[np.float64], float]] = {
    "32 on 4.2 cm": (spiral_sphere(32), 0.042),
    "4 on 4.2 cm": (
        np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / math.sqrt(3.0),
        0.042,
    ),
    "8 on 9 cm": (spiral_sphere(8), 0.09),
    "ring of 6 on 8 cm": (
        np.stack((np.cos(_TURNS), np.sin(_TURNS), 0.0 * _TURNS), axis=1),
        0.08,
    ),
    "19 on 5.5 cm": (spiral_sphere(19), 0.055),
}
_SOUNDS = ("speech", "noise", "bursts")
_PLACES_DEG = ((78.0, -14.0), (-130.0, 25.0))


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    found = []
    for number, (array, sound, at) in enumerate(product(_ARRAYS, _SOUNDS, _PLACES_DEG)):
        name = f"{array}, {sound} from {at[0]:g}, {at[1]:g} deg"
        found.append(HearingCase(name, partial(_judge, array, sound, at, number)))
    found += [
        HearingCase(
            f"{array}, sphere not stated", partial(_judge_unstated, array, number)
        )
        for number, array in enumerate(_ARRAYS)
    ]
    return found


def _recorded(
    array: str, sound: str, at: tuple[float, float], seed: int
) -> tuple[NDArray[np.float64], float]:
    rng = np.random.default_rng([40, seed])
    toward, radius = _ARRAYS[array]
    rate = 48_000.0 if sound == "bursts" else 16_000.0
    if sound == "speech":
        emitted = speech_like(rng, _SECONDS, rate)
    else:
        emitted = rng.standard_normal(round(_SECONDS * rate))
    if sound == "bursts":
        emitted *= np.arange(emitted.size) % round(0.5 * rate) < 0.1 * rate
    azimuth, height = np.radians(at)
    u = np.array(
        [
            math.cos(height) * math.cos(azimuth),
            math.cos(height) * math.sin(azimuth),
            math.sin(height),
        ]
    )
    heard = sphere_recording(
        toward, radius, u, emitted, rate, c=_C, snr_db=30.0, rng=rng
    )
    return heard, rate


def _judge(array: str, sound: str, at: tuple[float, float], seed: int) -> Outcome:
    heard, rate = _recorded(array, sound, at, seed)
    toward, radius = _ARRAYS[array]
    geometry = ArrayGeometry.model_validate(
        {
            "microphones": (radius * toward).tolist(),
            "temperature_c": 20.0,
            "body": {"sphere_m": radius},
        }
    )
    try:
        found = locate(heard, geometry, sample_rate_hz=rate)
    except InputError as error:
        return Outcome(right=False, said=str(error))
    told = found.main_source()
    sources = [
        (s.bearing_deg, s.confidence) for s in found.heard.sources if s.confidence
    ]
    said = (
        f"{told['bearing_deg']} +-{told['bearing_std_deg']}, {told['elevation_deg']} "
        f"+-{told['elevation_std_deg']}; {sources}; {[f.kind for f in found.faults]}"
    )
    claim = any(abs(_off(b, at[0])) > 15.0 and s > CLAIM for b, s in sources)
    if told["bearing_deg"] is None or found.faults:
        return Outcome(right=False, said=said, false_claim=claim)
    off = abs(_off(told["bearing_deg"], at[0]))
    right = off < max(3.0 * told["bearing_std_deg"], 5.0)
    # The other side of a ring has equal delays.
    height = at[1] if len(told["alternatives"]) == 0 else abs(at[1])
    steep = abs(told["elevation_deg"] - height)
    right &= steep < max(3.0 * told["elevation_std_deg"], 5.0)
    return Outcome(right=bool(right), said=said, false_claim=claim)


def _judge_unstated(array: str, seed: int) -> Outcome:
    """Judges an answer without the sphere; right, too, is a remedy that names it."""
    at = _PLACES_DEG[0]
    heard, rate = _recorded(array, "speech", at, seed + 50)
    toward, radius = _ARRAYS[array]
    try:
        found = locate(heard, (radius * toward).tolist(), sample_rate_hz=rate)
    except InputError as error:
        return Outcome(right="body" in str(error), said=str(error))
    told = found.main_source()
    said = f"{told['bearing_deg']} +-{told['bearing_std_deg']}; {found.notes}"
    if any("body" in note for note in found.notes):
        return Outcome(right=True, said=said)
    if told["bearing_deg"] is None:
        return Outcome(right=False, said=said)
    off = abs(_off(told["bearing_deg"], at[0]))
    right = off < max(3.0 * told["bearing_std_deg"], 5.0)
    return Outcome(right=right, said=said)


def _off(found_deg: float, true_deg: float) -> float:
    return (found_deg - true_deg + 180.0) % 360.0 - 180.0
