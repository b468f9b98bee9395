"""Sources in reverberant rooms, whose stated errors must hold."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from analysis.arrays.voting.direction_votes import VotePlan
from analysis.arrays.voting.source_listener import (
    ListenerMemory,
    ListenerParameters,
    hear_sources,
)
from phonotaxis import ArrayGeometry, locate
from studies.support.hearing_cases.case import CLAIM, HearingCase, Outcome
from studies.support.synthetic_speech import speech_like
from systems.sound.array_shape import ArrayShape

TITLE = "errors in rooms"

RATE = 16_000
C = 343.0
_ROOMS_M = ((6.0, 5.0, 2.8), (4.2, 3.4, 2.5), (8.0, 6.5, 3.2))
_MOST_ORDER = 20


def _ring(count: int, radius_m: float) -> NDArray[np.float64]:
    angle = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    level = np.zeros(count)
    return radius_m * np.stack((np.cos(angle), np.sin(angle), level), axis=1)


ARRAYS = {
    "square, 6.5 cm": _ring(4, 0.0325),
    "circle of 6, 9.3 cm": _ring(6, 0.0465),
    "six around one, 8.6 cm": np.vstack((np.zeros(3), _ring(6, 0.043))),
    "square, 12 cm": _ring(4, 0.06),
    "L of 5, 14 cm": np.array(
        [[0, 0, 0], [0.04, 0, 0], [0.1, 0, 0], [0, 0.04, 0], [0, 0.1, 0.0]]
    ),
    "circle of 8, 20 cm": _ring(8, 0.1),
}
_ROW = "row, 15 cm"
LIVE_ARRAYS = {
    "square, 6.5 cm": ARRAYS["square, 6.5 cm"],
    "square, 12 cm": ARRAYS["square, 12 cm"],
    "circle of 8, 20 cm": ARRAYS["circle of 8, 20 cm"],
    _ROW: np.array([[0.0, y, 0.0] for y in (-0.075, -0.025, 0.025, 0.075)]),
    "circle of 6, 9.3 cm": ARRAYS["circle of 6, 9.3 cm"],
    "triangle, 10 cm": _ring(3, 0.0577),
    "tetrahedron, 12 cm": 0.0424
    * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
}


class RoomRecording(NamedTuple):
    """What an array records of one talker in a room."""

    samples: NDArray[np.float64]
    """(n, samples)."""
    bearing_deg: float
    elevation_deg: float


def recorded(
    places: NDArray[np.float64],
    t60_s: float,
    seed: int,
    *,
    elevations_deg: tuple[float, float] = (5.0, 30.0),
    snr_db: float = 25.0,
    seconds: float = 3.0,
    largest_bearing_deg: float = 180.0,
) -> RoomRecording:
    """Records a talker at 0.8 to 1.8 m in a room of image sources; 0 s: free field."""
    import pyroomacoustics as pra

    rng = np.random.default_rng(seed)
    room_m = np.array(_ROOMS_M[seed % len(_ROOMS_M)])
    bearing = rng.uniform(-largest_bearing_deg, largest_bearing_deg)
    elevation = rng.uniform(*elevations_deg)
    azimuth, rise = math.radians(bearing), math.radians(elevation)
    u = np.array(
        [
            math.cos(rise) * math.cos(azimuth),
            math.cos(rise) * math.sin(azimuth),
            math.sin(rise),
        ]
    )
    center = room_m * np.array([0.5, 0.5, 0.42]) + rng.uniform(-0.3, 0.3, 3)
    reach = min(1.8, float(np.min(0.5 * room_m[:2] - 0.4)))
    source = center + rng.uniform(0.8, reach) * u
    absorption, order = pra.inverse_sabine(t60_s, room_m, C) if t60_s else (1.0, 0)
    room = pra.ShoeBox(
        room_m,
        fs=RATE,
        materials=pra.Material(absorption),
        max_order=min(order, _MOST_ORDER),
    )
    room.set_sound_speed(C)
    room.add_source(source)
    room.add_microphone_array((places - places.mean(axis=0) + center).T)
    room.compute_rir()
    voice = speech_like(rng, seconds, RATE)
    heard = np.array([oaconvolve(voice, rir[0])[: voice.size] for rir in room.rir])
    noise = heard.std() * 10.0 ** (-snr_db / 20.0) * rng.standard_normal(heard.shape)
    return RoomRecording(heard + noise, bearing, elevation)


def geometry(places: NDArray[np.float64]) -> ArrayGeometry:
    """Returns the geometry of a planar array with all sources above it."""
    return ArrayGeometry.model_validate(
        {"microphones": places.tolist(), "sound_speed": C, "side": "above"}
    )


def cases() -> list[HearingCase]:
    """Returns elevations by ``locate``, and bearings by ``listen``."""
    found = [
        HearingCase(f"{name}, T60 {t60:g} s", partial(_located, name, t60, seed))
        for seed, (name, t60) in enumerate(
            (name, t60) for name in ARRAYS for t60 in (0.0, 0.2, 0.3, 0.45, 0.6)
        )
    ]
    found += [
        HearingCase(f"listen, {name}, T60 {t60:g} s", partial(_live, name, t60, seed))
        for seed, (name, t60) in enumerate(
            (name, t60) for name in LIVE_ARRAYS for t60 in (0.0, 0.2, 0.4, 0.6)
        )
    ]
    return found


def _located(array: str, t60_s: float, seed: int) -> Outcome:
    """Elevations are right within two deviations, which are 15 deg at most."""
    places = ARRAYS[array]
    drawn = recorded(places, t60_s, 100 + seed)
    found = locate(drawn.samples, geometry(places), sample_rate_hz=RATE)
    summary = found.main_source()
    bearing, elevation = summary["bearing_deg"], summary["elevation_deg"]
    if bearing is None or elevation is None:
        return Outcome(right=False, said="nothing")
    turned = math.remainder(bearing - drawn.bearing_deg, 360.0)
    raised = elevation - drawn.elevation_deg
    turned_std, raised_std = summary["bearing_std_deg"], summary["elevation_std_deg"]
    level = abs(turned) < max(3.0 * turned_std, 5.0)
    claims = [
        source
        for source in found.agreed.sources
        if source.confidence > CLAIM
        and abs(math.remainder(source.bearing_deg - drawn.bearing_deg, 360.0)) > 15.0
    ]
    return Outcome(
        right=level and abs(raised) < max(2.0 * raised_std, 2.0) and raised_std < 15.0,
        said=f"bearing off by {turned:.1f} +-{turned_std:.1f}, elevation by "
        f"{raised:.1f} +-{raised_std:.1f} deg",
        false_claim=not level or bool(claims),
    )


def _live(array: str, t60_s: float, seed: int) -> Outcome:
    """Most bearings are right within two deviations, which stay small."""
    places, is_row = LIVE_ARRAYS[array], array == _ROW
    drawn = recorded(
        places,
        t60_s,
        200 + seed,
        elevations_deg=(0.0, 0.0) if is_row else (0.0, 20.0),
        snr_db=20.0,
        largest_bearing_deg=60.0 if is_row else 180.0,
    )
    shape = ArrayShape.of(places[:, :2] if is_row else places)
    plan = VotePlan.of(shape, C, float(RATE))
    steps, _ = hear_sources(
        drawn.samples, ListenerMemory.blank(plan), plan, ListenerParameters()
    )
    off, std = [], []
    for step in steps:
        for track in step.tracks:
            turned = math.degrees(track.bearing) - drawn.bearing_deg
            off.append(math.remainder(turned, 360.0))
            std.append(math.degrees(track.bearing_std))
    if not off:
        return Outcome(right=False, said="nothing")
    z = np.abs(off) / np.array(std)
    within, median = float(np.mean(z < 2.0)), float(np.median(std))
    return Outcome(
        right=within > 0.8 and median < (10.0 if is_row else 3.0),
        said=f"{100.0 * within:.0f} % of bearings within two of +-{median:.1f} deg",
        false_claim=bool(np.mean(np.abs(off) > 15.0) > 0.5),
    )
