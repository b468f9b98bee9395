"""Sounds located from delays: arrays, distances, errors, and grossly wrong delays."""

from __future__ import annotations

import math
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from phonotaxis import ArrayGeometry, locate_delays
from phonotaxis.delays import DelayResult
from studies.support.hearing_cases.case import HearingCase, Outcome
from studies.support.sphere_recordings import spiral_sphere

TITLE = "delays in, place out"

_C, _SOUNDS, _NOISE_S, _PLACE_STD_M = 343.0, 12, 3e-6, 5e-4
_TURNS = 2.0 * math.pi * np.arange(5) / 5.0
_ARRAYS: dict[str, NDArray[np.float64]] = {
    "row of 4, 15 cm": np.array([[-0.075, 0], [-0.025, 0], [0.025, 0], [0.075, 0]]),
    "ring of 5, 20 cm": 0.1 * np.stack((np.cos(_TURNS), np.sin(_TURNS), 0 * _TURNS), 1),
    "tetrahedron of 0.5 m": 0.3
    * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    "12 in 1 m": 0.5 * spiral_sphere(12) * np.linspace(0.6, 1.0, 12)[:, np.newaxis],
    "48 in 0.25 m": 0.125
    * spiral_sphere(48)
    * np.linspace(0.5, 1.0, 48)[:, np.newaxis],
}
_DISTANCES_M = (1.5, 25.0)
_FLAWS = ("none", "errors stated 5 times too small", "one delay of 0.75 s", "unstated")


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    found = []
    for number, (array, distance_m, flaw) in enumerate(
        product(_ARRAYS, _DISTANCES_M, _FLAWS)
    ):
        # Without spare delays, nothing can replace a stated error or a lost delay.
        if flaw == "none" or len(_ARRAYS[array]) >= 12:
            name = f"{array}, sounds at {distance_m:g} m, flaw: {flaw}"
            judge = partial(_judge, array, distance_m, flaw, number)
            found.append(HearingCase(name, judge))
    return found


def _judge(array: str, distance_m: float, flaw: str, seed: int) -> Outcome:
    """Right: nine of ten places within two deviations, or all if there are few."""
    rng = np.random.default_rng([12, seed])
    places = _ARRAYS[array]
    count, dimension = places.shape
    geometry = ArrayGeometry(
        microphones=tuple(map(tuple, places)),
        sound_speed=_C,
        sound_speed_std=0.6,
        position_std_m=_PLACE_STD_M,
        delay_std_s=0.0,
    )
    azimuth = rng.uniform(-1.2, 1.2, _SOUNDS)
    height = rng.uniform(0.3, 0.9, _SOUNDS) if dimension == 3 else np.zeros(_SOUNDS)
    # A row along x distinguishes the sides of y.
    azimuth += math.pi / 2.0
    level = np.cos(height)
    u = np.stack(
        (level * np.cos(azimuth), level * np.sin(azimuth), np.sin(height)), axis=1
    )[:, :dimension]
    sources = places.mean(axis=0) + distance_m * u
    true = places + _PLACE_STD_M * rng.standard_normal((_SOUNDS, *places.shape))
    arrival = np.linalg.norm(sources[:, np.newaxis] - true, axis=2)
    arrival /= _C + 0.6 * rng.standard_normal((_SOUNDS, 1))
    arrival += _NOISE_S * rng.standard_normal(arrival.shape)
    if flaw == "one delay of 0.75 s":
        arrival[np.arange(_SOUNDS), rng.integers(0, count, _SOUNDS)] += 0.75
    stated = _NOISE_S / 5.0 if flaw.startswith("errors") else _NOISE_S
    covariance = stated**2 * (np.eye(count - 1) + 1.0)
    found = locate_delays(
        arrival[:, 1:] - arrival[:, :1],
        geometry,
        covariance=None if flaw == "unstated" else covariance,
    )
    z = _deviations(found, np.degrees(azimuth), np.degrees(height), distance_m)
    share = float(np.mean(z < 2.0))
    missing = _SOUNDS - sum(e.direction is not None for e in found.estimates)
    said = f"{100 * share:.0f} % within 2 deviations, {missing} without a direction"
    right = share >= 0.85 and float(z.max()) < 4.5 and missing == 0
    return Outcome(right=right, said=said, false_claim=bool(np.mean(z > 4.5) > 0.1))


def _deviations(
    found: DelayResult,
    azimuth_deg: NDArray[np.float64],
    height_deg: NDArray[np.float64],
    distance_m: float,
) -> NDArray[np.float64]:
    """Errors of all bearings, elevations and ranges, in stated deviations."""
    z = []
    for e, azimuth, height in zip(
        found.estimates, azimuth_deg, height_deg, strict=True
    ):
        # Four microphones in space: two places can have the same delays.
        around = [
            abs((c.bearing_deg - azimuth + 180.0) % 360.0 - 180.0)
            for c in (e, *e.alternatives)
            if c.bearing_deg is not None
        ]
        if around and min(around) < around[0] - 1e-6:
            continue
        for value, std, true in (
            (e.bearing_deg, e.bearing_std_deg, azimuth),
            (e.elevation_deg, e.elevation_std_deg, height),
            (e.range_m, e.range_std_m, distance_m),
        ):
            if value is not None and std is not None:
                off = value - true
                if true is not distance_m:
                    off = (off + 180.0) % 360.0 - 180.0
                z.append(abs(off) / std)
    return np.array(z or [math.inf])
