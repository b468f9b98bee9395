"""Echoes that are louder than the direct sound; and sounds without such echoes."""

from __future__ import annotations

import math
from functools import partial
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from phonotaxis import ArrayGeometry, locate
from studies.support.hearing_cases.case import (
    HearingCase,
    Outcome,
    claims_elsewhere,
    is_near,
)
from studies.support.hearing_cases.errors_in_rooms import ARRAYS, RATE, C, recorded
from studies.support.synthetic_speech import speech_like

TITLE = "echoes louder than the direct sound"

_TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.058
_ROW = np.array([[x, 0.0, 0.0] for x in (-0.075, -0.025, 0.025, 0.075)])
_ARRAYS = {
    **{name: ARRAYS[name] for name in ARRAYS if not name.startswith(("six", "L"))},
    "tetrahedron, 16 cm": _TETRAHEDRON,
    "row, 15 cm": _ROW,
}
_SOUNDS = ("speech", "noise")
# Delays in s, and gains in dB.
_ECHOES = (
    (2.5e-3, 6.0), (5e-3, 6.0), (3e-3, 2.0), (9e-3, 10.0), (19e-3, 4.0), (14e-3, 8.0),
)  # fmt: skip
# Directions of the direct sound and of the echo, deg.
_TURNS = ((30.0, 140.0), (75.0, 20.0), (110.0, 45.0))


def with_echo(
    places: NDArray[np.float64],
    sound: NDArray[np.float64],
    direct_deg: float,
    echo_deg: float,
    *,
    later_s: float,
    gain_db: float,
    seed: int,
) -> NDArray[np.float64]:
    """Records plane waves of a sound and its echo, with noise 25 dB below them."""
    size = sound.size + round(0.1 * RATE)
    f = np.fft.rfftfreq(size, 1.0 / RATE)
    heard = np.zeros((len(places), f.size), dtype=complex)
    waves = ((direct_deg, 1.0, 0.01), (echo_deg, 10.0 ** (gain_db / 20.0), later_s))
    for bearing_deg, gain, start_s in waves:
        azimuth, height = math.radians(bearing_deg), math.radians(8.0)
        u = [math.cos(azimuth), math.sin(azimuth), math.tan(height)]
        arrival_s = 0.01 * (gain != 1.0) + start_s - places @ u * math.cos(height) / C
        heard += gain * np.exp(-2j * math.pi * np.outer(arrival_s, f))
    samples = np.fft.irfft(heard * np.fft.rfft(sound, size), size)
    noise = np.random.default_rng(seed).standard_normal(samples.shape)
    return np.asarray(samples + samples.std() * 10.0 ** (-25.0 / 20.0) * noise)


def _sound(kind: str, seed: int) -> NDArray[np.float64]:
    rng = np.random.default_rng([seed, 7])
    if kind == "noise":
        return rng.standard_normal(2 * RATE)
    return speech_like(rng, 2.0, RATE)


def cases() -> list[HearingCase]:
    """Returns loud echoes, fainter echoes, and one and two talkers in rooms."""
    found = []
    turns, echoes = cycle(_TURNS), cycle(_ECHOES)
    for name in _ARRAYS:
        for sound in (*_SOUNDS, *_SOUNDS):
            (later_s, gain_db), turn = next(echoes), next(turns)
            text = f"{name}, {sound}, {gain_db:g} dB after {1e3 * later_s:g} ms"
            judge = partial(_loud, name, sound, turn, later_s, gain_db)
            found.append(HearingCase(f"{text}, {turn}", judge))
        found.append(
            HearingCase(
                f"{name}, -3 dB after 6 ms",
                partial(_loud, name, "speech", (30.0, 140.0), 6e-3, -3.0),
            )
        )
    for k, (name, t60_s) in enumerate(
        (name, t60_s) for name in ARRAYS for t60_s in (0.2, 0.4, 0.6)
    ):
        found.append(
            HearingCase(f"{name}, T60 {t60_s:g} s", partial(_room, name, t60_s, k, 1))
        )
    found += [
        HearingCase(
            f"{name}, two talkers, T60 {t60_s:g} s", partial(_room, name, t60_s, k, 2)
        )
        for k, (name, t60_s) in enumerate(
            (name, t60_s)
            for name in ("square, 6.5 cm", "circle of 8, 20 cm")
            for t60_s in (0.2, 0.4, 0.6)
        )
    ]
    return found


def _loud(
    array: str, sound: str, turn: tuple[float, float], later_s: float, gain_db: float
) -> Outcome:
    """The echo is named, or the direction is that of the direct sound."""
    places = _ARRAYS[array]
    samples = with_echo(
        places, _sound(sound, 3), *turn, later_s=later_s, gain_db=gain_db, seed=4
    )
    geometry = ArrayGeometry.model_validate(
        {"microphones": places.tolist(), "sound_speed": C}
    )
    found = locate(samples, geometry, sample_rate_hz=RATE)
    summary = found.main_source()
    kinds = [fault.kind for fault in found.faults]
    near = is_near(summary["bearing_deg"], summary["bearing_std_deg"], turn[0])
    named = kinds == ["echo"]
    return Outcome(
        right=named != near if gain_db > 0.0 else near and not kinds,
        said=f"{summary['bearing_deg']} for {turn[0]}; {kinds}",
        false_claim=claims_elsewhere(found.agreed.sources, turn),
    )


def _room(array: str, t60_s: float, seed: int, talkers: int) -> Outcome:
    """No echo is named."""
    places = ARRAYS[array]
    drawn = [
        recorded(places, t60_s, 900 + seed + 3 * k, seconds=2.0) for k in range(talkers)
    ]
    geometry = ArrayGeometry.model_validate(
        {"microphones": places.tolist(), "sound_speed": C, "side": "above"}
    )
    samples = sum(each.samples / each.samples.std() for each in drawn)
    found = locate(samples, geometry, sample_rate_hz=RATE)
    kinds = [fault.kind for fault in found.faults]
    said = f"{found.main_source()['bearing_deg']}; {kinds}"
    return Outcome(right="echo" not in kinds, said=said)
