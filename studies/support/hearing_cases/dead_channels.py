"""Channels in order, far from others in a room with echoes, and channels that are dead.

Public report: a source localization project with four of its microphones 1 m apart and
two 2 cm apart (jpers1/sound-source-localization). Claps in a room.
"""

from __future__ import annotations

import logging
from functools import partial

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import ArrayGeometry
from phonotaxis import locate
from studies.support.faulty_recordings import Setting
from studies.support.hearing_cases.case import (
    HearingCase,
    Outcome,
    claims_elsewhere,
    is_near,
)

TITLE = "dead channels"

_RATE = 44_100
_ROOM, _MIDDLE = (6.0, 7.0, 2.8), (0.5, 0.4, 0.9)
_ARRAYS = {
    "L of 1 m with a pair of 1.5 cm": [
        [0.015, 0, 0],
        [1.01, 0, 0],
        [0, 0, 0],
        [0, 0, 1.01],
    ],
    "row of 2 cm and 1 m": [[0, 0, 0], [0.02, 0, 0], [1, 0, 0]],
    "square of 1 m with a pair of 2 cm": [
        [0, 0, 0],
        [0.02, 0, 0],
        [1, 0, 0],
        [0, 1, 0],
        [1, 1, 0.1],
    ],
}
_PLACES = ((2.9, 3.0, 1.24), (1.6, 3.5, 1.1), (4.5, 2.5, 1.4), (2.2, 5.0, 1.6))


def _clap(name: str, place: int, t60_s: float) -> tuple[NDArray[np.float64], Setting]:
    rng = np.random.default_rng([place, round(10 * t60_s)])
    away = np.array(_PLACES[place]) - _MIDDLE
    level = float(np.hypot(away[0], away[1]))
    setting = Setting(
        np.array(_ARRAYS[name], dtype=float),
        float(np.degrees(np.arctan2(away[1], away[0]))),
        float(np.degrees(np.arctan2(away[2], level))),
        float(np.linalg.norm(away)),
        t60_s,
        _RATE,
        snr_db=float(rng.uniform(5.0, 20.0)),
        room_m=_ROOM,
        middle_m=_MIDDLE,
    )
    count = round(0.03 * _RATE)
    sound = np.zeros(round(0.6 * _RATE))
    decay = np.exp(-np.arange(count) / (0.004 * _RATE))
    sound[4000 : 4000 + count] = rng.standard_normal(count) * decay
    samples = setting.heard(sound, rng)
    first = max(0, int(np.abs(samples).max(axis=0).argmax()) - round(0.04 * _RATE))
    length = round(rng.uniform(0.2, 0.4) * _RATE)
    return samples[:, first : first + length], setting


def _sound_one(name: str, place: int, t60_s: float) -> Outcome:
    """A recording in order is not refused, and its bearing is right."""
    samples, setting = _clap(name, place, t60_s)
    geometry = ArrayGeometry(
        microphones=tuple(map(tuple, setting.places.tolist())), temperature_c=20.0
    )
    logging.disable(logging.WARNING)
    try:
        result = locate(samples, geometry, sample_rate_hz=_RATE)
    except ValueError as error:
        return Outcome(right=False, said=str(error))
    finally:
        logging.disable(logging.NOTSET)
    # Bearings are from the centroid. In a row, they are those of cones.
    source = setting.source - setting.places.mean(axis=0)
    truth = float(np.degrees(np.arctan2(source[1], source[0])))
    if len(samples) == 3:
        truth = float(np.degrees(np.arccos(source[0] / np.linalg.norm(source))))
    main = result.main_source()
    bearing, std = main["bearing_deg"], main["bearing_std_deg"] or 0.0
    kinds = [fault.kind for fault in result.faults]
    said = f"{bearing} +- {std:.1f} for {truth:.1f}, {kinds}"
    near = is_near(bearing, std, truth) and "dead" not in kinds
    return Outcome(near, said, claims_elsewhere(result.agreed.sources, [truth]))


def _dead_one(name: str, place: int, t60_s: float, channel: int) -> Outcome:
    """A channel of noise alone, as loud as the others, is dead."""
    samples, setting = _clap(name, place, t60_s)
    rng = np.random.default_rng(place)
    noise = rng.standard_normal(samples.shape[1])
    samples[channel] = samples[channel].std() * noise
    geometry = ArrayGeometry(
        microphones=tuple(map(tuple, setting.places.tolist())), temperature_c=20.0
    )
    try:
        locate(samples, geometry, sample_rate_hz=_RATE)
    except ValueError as error:
        right = f"channel {channel + 1}: dead" in str(error)
        return Outcome(right, str(error))
    return Outcome(right=False, said="not refused")


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    found = []
    for name in _ARRAYS:
        for place in range(len(_PLACES)):
            found += [
                HearingCase(
                    f"{name}, place {place}, T60 {t60_s} s",
                    partial(_sound_one, name, place, t60_s),
                )
                for t60_s in (0.3, 0.4, 0.6)
            ]
            found.append(
                HearingCase(
                    f"{name}, place {place}, channel 3 of noise",
                    partial(_dead_one, name, place, 0.3, 2),
                )
            )
    return found
