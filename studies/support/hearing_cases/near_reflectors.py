"""Walls close behind an array, which bend its bearings; and rooms, which do not."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from phonotaxis import locate
from studies.support.hearing_cases.case import HearingCase, Outcome
from studies.support.hearing_cases.errors_in_rooms import (
    ARRAYS,
    RATE,
    C,
    geometry,
    recorded,
)
from studies.support.synthetic_speech import speech_like

TITLE = "walls close behind"


def before_a_wall(
    places: NDArray[np.float64],
    bearing_deg: float,
    wall_m: float,
    *,
    reflected: float = 0.8,
    seconds: float = 2.0,
    seed: int = 3,
) -> NDArray[np.float64]:
    """Records speech at 2 m in front of the wall x = -wall_m, by its mirror source."""
    rng = np.random.default_rng(seed)
    voice = speech_like(rng, seconds, RATE)
    spectrum = np.fft.rfft(voice)
    f = np.fft.rfftfreq(voice.size, 1.0 / RATE)
    azimuth = math.radians(bearing_deg)
    source = 2.0 * np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    mirrored = np.array([-2.0 * wall_m - source[0], source[1], 0.0])
    heard = np.zeros((len(places), f.size), dtype=complex)
    for place, gain in ((source, 1.0), (mirrored, reflected)):
        way = np.linalg.norm(place - places, axis=1)[:, np.newaxis]
        heard += gain * spectrum * np.exp(-2j * np.pi * f * way / C) / way
    samples = np.fft.irfft(heard, voice.size)
    noise = 0.03 * samples.std() * rng.standard_normal(samples.shape)
    return np.asarray(samples + noise)


def cases() -> list[HearingCase]:
    """Returns walls at 6 to 15 cm, and rooms without a wall nearby."""
    found = [
        HearingCase(
            f"{name}, wall at {100 * wall_m:g} cm, source at {bearing_deg:g} deg",
            partial(_wall, name, bearing_deg, wall_m),
        )
        for name in ("square, 6.5 cm", "circle of 6, 9.3 cm", "circle of 8, 20 cm")
        for wall_m, bearing_deg in (
            (0.06, 50.0), (0.1, 20.0), (0.1, 60.0), (0.1, 85.0), (0.15, -40.0),
        )
    ]  # fmt: skip
    found += [
        HearingCase(f"{name}, T60 {t60:g} s", partial(_room, name, t60, seed))
        for name in ("square, 6.5 cm", "circle of 8, 20 cm")
        for seed, t60 in enumerate((0.0, 0.2, 0.4, 0.6))
    ]
    return found


def _wall(array: str, bearing_deg: float, wall_m: float) -> Outcome:
    """The wall is named, or the bearing is right within three deviations."""
    samples = before_a_wall(ARRAYS[array], bearing_deg, wall_m)
    found = locate(samples, geometry(ARRAYS[array]), sample_rate_hz=RATE)
    summary = found.main_source()
    named = "reflector" in [fault.kind for fault in found.faults]
    bearing, std = summary["bearing_deg"], summary["bearing_std_deg"]
    off = 0.0
    if bearing is not None:
        off = math.remainder(bearing - bearing_deg, 360.0)
    within = bearing is not None and abs(off) < max(3.0 * std, 5.0)
    return Outcome(
        right=named or within,
        said=f"off by {off:.1f} deg, {'named' if named else 'not named'}",
        false_claim=not named and not within,
    )


def _room(array: str, t60_s: float, seed: int) -> Outcome:
    """No wall is named."""
    samples = recorded(ARRAYS[array], t60_s, 300 + seed, seconds=2.0).samples
    found = locate(samples, geometry(ARRAYS[array]), sample_rate_hz=RATE)
    kinds = [fault.kind for fault in found.faults]
    return Outcome(right="reflector" not in kinds, said=", ".join(kinds) or "no fault")
