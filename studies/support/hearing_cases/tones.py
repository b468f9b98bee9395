"""Continuous tones, alarms with harmonics, and tones in rooms."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pyroomacoustics as pra
from numpy.typing import NDArray

from analysis.arrays.array_geometry import ArrayGeometry
from phonotaxis import locate
from studies.support.free_field_recordings import free_field, with_noise
from studies.support.hearing_cases.case import HearingCase, Outcome
from systems.framework.input_error import InputError

TITLE = "continuous tones"

_C = 343.2

# Array; bearing, deg, and frequencies, Hz, of each source; duration, s; sample rate,
# Hz; signal to noise ratio, dB; reverberation time, s.
_Row = tuple[str, list[tuple[float, tuple[float, ...]]], float, int, float, float]


def _circle(count: int, diameter_m: float) -> NDArray[np.float64]:
    angle = 2.0 * np.pi * np.arange(count) / count
    ring = [np.cos(angle), np.sin(angle), np.zeros(count)]
    return 0.5 * diameter_m * np.stack(ring, axis=1)


_ARRAYS = {
    "square of 4.57 cm": _circle(4, 0.0646),
    "row of 4, 5 cm apart": np.outer((-0.075, -0.025, 0.025, 0.075), (1, 0, 0)),
    "circle of 6, 9.3 cm": _circle(6, 0.093),
    "circle of 8, 20 cm": _circle(8, 0.2),
    "tetrahedron of 12 cm": 0.12
    * np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.87, 0], [0.5, 0.29, 0.82]]),
    "L of 1 m": np.array(
        [[0, 0, 0], [0.04, 0, 0], [1, 0, 0], [0, 1.0, 0], [0, 0.04, 0]]
    ),
}


def _tone(
    tones_hz: tuple[float, ...], seconds: float, rate: int, seed: int
) -> NDArray[np.float64]:
    t = np.arange(round(seconds * rate)) / rate
    starts = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(tones_hz))
    parts = [
        np.sin(2.0 * np.pi * f * t + start)
        for f, start in zip(tones_hz, starts, strict=True)
    ]
    return np.asarray(np.sum(parts, axis=0))


def _is_unique(
    places: NDArray[np.float64], place: NDArray[np.float64], tones_hz: tuple[float, ...]
) -> bool:
    """Returns whether no other bearing gives nearly the same phases of plane waves."""
    azimuth, height = np.meshgrid(
        np.radians(np.arange(0.0, 360.0, 0.5)), np.radians(np.arange(-90.0, 90.0, 1.0))
    )
    level = np.cos(height)
    u = np.stack(
        (level * np.cos(azimuth), level * np.sin(azimuth), np.sin(height)), -1
    ).reshape(-1, 3)
    true = place / np.linalg.norm(place)
    worst = np.zeros(len(u))
    for f in tones_hz:
        phase = 2.0 * np.pi * f / _C * ((u - true) @ places.T)
        off = np.angle(np.exp(1j * (phase - phase[:, :1])))
        worst = np.maximum(worst, np.abs(off).max(axis=1))
    # Directions with nearly the same delays, such as mirror images, do not count.
    delays = (u - true) @ places.T
    other = np.ptp(delays, axis=1) > 0.15 * np.linalg.norm(places, axis=1).max()
    return not bool(np.any(worst[other] < 0.1))


def _judge(
    array: str,
    sources: list[tuple[float, tuple[float, ...]]],
    seconds: float,
    rate: int,
    snr_db: float,
    t60_s: float,
    seed: int,
) -> Outcome:
    """Judges tones from bearings in deg, whose frequencies are in Hz."""
    places = _ARRAYS[array]
    center = places.mean(axis=0)
    sounds = []
    for bearing, tones_hz in sources:
        angle, height = math.radians(bearing), math.radians(15.0)
        level = math.cos(height)
        u = [level * math.cos(angle), level * math.sin(angle), math.sin(height)]
        range_m = 1.5 if t60_s else 3.0
        place = center + range_m * np.array(u)
        sounds.append((_tone(tones_hz, seconds, rate, seed), tuple(place.tolist())))
    if t60_s:
        heard = _in_room(sounds, places, rate, t60_s)
    else:
        heard = free_field(sounds, places, rate, _C)
    heard = with_noise(heard, snr_db, seed)
    geometry = ArrayGeometry.model_validate(
        {"microphones": places.tolist(), "temperature_c": 20.0}
    )
    try:
        result = locate(heard, geometry, sample_rate_hz=rate)
    except InputError as error:
        return Outcome(right=False, said=str(error))
    told = result.main_source()
    said = f"{told['bearing_deg']} +- {told['bearing_std_deg']} for {sources}"
    true = [bearing for bearing, _ in sources]
    named = any(fault.kind == "tone" for fault in result.faults)
    claims = any(
        s.confidence > 0.5 and min(_off(s.bearing_deg, b) for b in true) > 10.0
        for s in result.agreed.sources
    )
    if told["bearing_deg"] is None:
        place = np.array(sounds[0][1]) - center
        unique = _is_unique(places, place, sources[0][1]) and not t60_s
        right = named if not unique else False
        return Outcome(right or t60_s > 0.0, f"nothing, {result.faults}", claims)
    said_deg = [told["bearing_deg"]]
    said_deg += [other["bearing_deg"] for other in told["alternatives"]]
    off = min(_off(one, other) for one in said_deg for other in true)
    right = off < max(5.0, 3.0 * told["bearing_std_deg"])
    return Outcome(right and not claims, said, claims)


def _off(one: float, other: float) -> float:
    return abs((one - other + 180.0) % 360.0 - 180.0)


def _in_room(
    sounds: list[tuple[NDArray[np.float64], tuple[float, ...]]],
    places: NDArray[np.float64],
    rate: int,
    t60_s: float,
) -> NDArray[np.float64]:
    size = np.array([6.0, 5.0, 2.8])
    absorption, order = pra.inverse_sabine(t60_s, size)
    room = pra.ShoeBox(
        size, fs=rate, materials=pra.Material(absorption), max_order=min(order, 12)
    )
    room.set_sound_speed(_C)
    at = np.array([3.0, 2.2, 1.2])
    for samples, place in sounds:
        room.add_source(at + np.array(place), signal=samples)
    room.add_microphone_array((at + places).T)
    room.simulate()
    return np.asarray(room.mic_array.signals[:, : sounds[0][0].size])


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    alarm = (1000.0, 2000.0, 3000.0)
    square, row = "square of 4.57 cm", "row of 4, 5 cm apart"
    six, eight, tetrahedron = (
        "circle of 6, 9.3 cm",
        "circle of 8, 20 cm",
        "tetrahedron of 12 cm",
    )
    rows: list[_Row] = [
        (square, [(50.0, (f,))], s, 16_000, snr, 0.0)
        for f, s, snr in (
            (230.0, 1.0, 30),
            (440.0, 2.0, 20),
            (1000.0, 1.0, 30),
            (2500.0, 1.0, 15),
            (3600.0, 3.0, 30),
            (4500.0, 1.0, 30),
            (6000.0, 2.0, 30),
        )
    ]
    rows += [
        (row, [(65.0, (1000.0,))], 1.0, 16_000, 30, 0.0),
        (row, [(110.0, (3300.0,))], 1.0, 48_000, 20, 0.0),
        (row, [(20.0, (5500.0,))], 1.0, 16_000, 30, 0.0),
        (six, [(-130.0, (700.0,))], 1.0, 48_000, 20, 0.0),
        (six, [(170.0, (3500.0,))], 2.0, 16_000, 30, 0.0),
        (eight, [(-20.0, (1900.0,))], 1.0, 48_000, 10, 0.0),
        (eight, [(75.0, (5000.0,))], 1.0, 44_100, 30, 0.0),
        (tetrahedron, [(100.0, (600.0,))], 1.0, 16_000, 30, 0.0),
        (tetrahedron, [(-60.0, (1300.0,))], 2.0, 48_000, 25, 0.0),
        ("L of 1 m", [(50.0, (3000.0,))], 1.0, 48_000, 30, 0.0),
        (square, [(50.0, alarm)], 1.0, 16_000, 30, 0.0),
        (eight, [(140.0, alarm)], 1.0, 48_000, 20, 0.0),
        (six, [(-75.0, (2000.0, 4000.0, 6000.0))], 1.0, 16_000, 30, 0.0),
        (square, [(153.0, (1200.0,)), (45.0, (2100.0,))], 2.0, 16_000, 30, 0.0),
        (eight, [(0.0, (900.0,)), (120.0, (1300.0,))], 2.0, 16_000, 30, 0.0),
        (square, [(50.0, (1000.0,))], 0.2, 16_000, 30, 0.0),
        (square, [(50.0, (1500.0,))], 2.0, 16_000, 30, 0.2),
        (six, [(-40.0, (800.0,))], 2.0, 16_000, 30, 0.3),
        (eight, [(110.0, (1100.0,))], 2.0, 16_000, 30, 0.4),
        (eight, [(30.0, alarm)], 2.0, 16_000, 30, 0.3),
    ]
    return [
        HearingCase(_name(row), partial(_judge, *row, seed))
        for seed, row in enumerate(rows)
    ]


def _name(row: _Row) -> str:
    array, sources, seconds, _, snr_db, t60_s = row
    tones = "; ".join(
        f"{' and '.join(f'{f:g}' for f in tones_hz)} Hz from {bearing:g} deg"
        for bearing, tones_hz in sources
    )
    return f"{array}, {tones}, {seconds:g} s, {snr_db:g} dB, T60 {t60_s:g} s"
