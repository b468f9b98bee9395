"""Calls and shots at recorders far apart, bats, and hydrophones, in the free field."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.array_geometry import ArrayGeometry
from phonotaxis import LocateResult, locate
from studies.support.free_field_recordings import (
    at_times,
    free_field,
    shot,
    song,
    sweep,
    with_noise,
)
from studies.support.hearing_cases.case import HearingCase, Outcome
from systems.framework.input_error import InputError

TITLE = "arrays of recorders"

_SQUARE = np.array([[0, 0, 1.5], [1, 0, 1.5], [1, 1, 1.5], [0, 1, 1.5]], dtype=float)
_STAR = np.array([[0, 0, 0], [0, 1, 0], [0.87, -0.5, 0], [-0.87, -0.5, 0.6]])
_TEN = np.array([[0, 0, 0], [9, 1, 0], [4, 8, 3], [-5, 6, 1], [-3, -7, 2], [6, -6, 0]])
_FIVE = np.array([[0, 0], [25, 2], [22, 24], [-1, 20], [12, 11]], dtype=float)
_NINE = np.array([[x, y, 1.5 + (x * y) % 3] for x in (0, 1, 2) for y in (0, 1, 2)])


@dataclass(frozen=True)
class _Net:
    """Recorders, a sound, and what is known of both."""

    places: NDArray[np.float64]
    """(n, 2 or 3) true places of the microphones, m."""
    source: tuple[float, float, float]
    sound: str
    snr_db: float
    rate: int = 48_000
    times_s: tuple[float, ...] = (0.6,)
    seconds: float = 5.0
    place_std: float = 0.1
    c: float = 343.2
    known: dict[str, Any] = field(default_factory=dict)
    """Further entries of the geometry file."""


def _nets() -> dict[str, _Net]:
    def scaled(shape: NDArray[np.float64], size: float) -> NDArray[np.float64]:
        return shape * [size, size, 1.0]

    water = {"sound_speed": 1480.0, "sound_speed_std": 5.0}
    still = {"temperature_c": 20.0}
    wide = {"temperature_c": 20.0, "temperature_std_c": 1.0}
    return {
        "4 in a square of 50 m, song inside": _Net(
            scaled(_SQUARE, 50), (31, 22, 4), "song", 15, known=still
        ),
        "4 in a square of 50 m, song outside, 0 dB": _Net(
            scaled(_SQUARE, 50), (75, 20, 8), "song", 0, seconds=10, known=still
        ),
        "4 in a square of 25 m, song in the middle": _Net(
            scaled(_SQUARE, 25), (12.5, 12.5, 5), "song", 10, known=still
        ),
        "4 in a square of 71 m, 24 kHz, by (x, y)": _Net(
            scaled(_SQUARE, 50)[:, :2], (10, 35, 0), "song", 5, 24_000, known=still
        ),
        "4 in a square of 100 m, song 150 m away": _Net(
            scaled(_SQUARE, 100), (190, 120, 10), "song", 5, known=still
        ),
        "9 in a grid of 80 m, song inside, three times": _Net(
            scaled(_NINE, 40),
            (55, 30, 6),
            "song",
            10,
            24_000,
            times_s=(0.6, 2.0, 3.1),
            known=still,
        ),
        "9 in a grid of 80 m, song at a corner, -3 dB": _Net(
            scaled(_NINE, 40), (75, 70, 6), "song", -3, 24_000, seconds=8, known=still
        ),
        "9 in a grid of 200 m, loud near one recorder": _Net(
            scaled(_NINE, 100), (190, 180, 6), "faint song", 20, 24_000, known=still
        ),
        "6 within 14 m, song among them": _Net(
            _TEN.astype(float), (2, 3, 4), "song", 10, place_std=0.02, known=still
        ),
        "6 within 14 m, song outside": _Net(
            _TEN.astype(float), (25, 18, 3), "song", 5, place_std=0.02, known=still
        ),
        "5 within 30 m, places by GPS to 1 m": _Net(
            _FIVE,
            (40, 17, 0),
            "song",
            5,
            place_std=1.0,
            known=still,
        ),
        "5 within 30 m in map coordinates": _Net(
            _FIVE + np.array([481_300.0, 5_212_700.0]),
            (481_308, 5_212_717, 0),
            "song",
            5,
            known=still,
        ),
        "6 within 1 km, shot inside": _Net(
            100.0 * _TEN * [1, 1, 0.05], (120, -150, 2), "shot", 15, 8_000,
            seconds=12, known=wide,
        ),
        "6 within 1 km, shot outside": _Net(
            100.0 * _TEN * [1, 1, 0.05], (1500, 700, 2), "shot", 10, 8_000,
            seconds=12, known=wide,
        ),
        "6 within 2 km, two shots": _Net(
            200.0 * _TEN * [1, 1, 0.05], (-300, 500, 2), "shot", 15, 8_000,
            times_s=(0.6, 1.9), seconds=16, known=wide,
        ),
        "4 within 700 m, shot, 16 kHz, long before": _Net(
            scaled(_SQUARE, 500), (150, 300, 2), "shot", 10, 16_000,
            times_s=(14.0,), seconds=30, known=wide,
        ),
        "bat, 4 within 0.3 m, 384 kHz": _Net(
            0.17 * _STAR, (2, 2, 1), "bat", 20, 384_000, (0.05, 0.15, 0.25), 0.4,
            0.0005, known=still,
        ),
        "bat, 4 within 1.9 m, 500 kHz": _Net(
            1.1 * _STAR, (3, 4, 2), "bat", 15, 500_000, (0.05, 0.15), 0.3,
            0.001, known=still,
        ),
        "bat, 4 within 1.2 m, 250 kHz, one call": _Net(
            0.7 * _STAR, (-2, 3, 1), "bat", 10, 250_000, (0.1,), 0.5,
            0.001, known=still,
        ),
        "bat, 4 in a square of 0.5 m, 384 kHz": _Net(
            0.5 * _SQUARE, (3, -1, 2.0), "bat", 20, 384_000, (0.05, 0.15), 0.3,
            0.001, known=still,
        ),
        "hydrophones, 4 within 3 km, clicks": _Net(
            1700.0 * _STAR * [1, 1, 0.1], (400, 900, -50), "click", 20, 48_000,
            (0.6, 2.9), 6.0, 1.0, 1480.0, water,
        ),
        "hydrophones, 6 within 150 m, whistle": _Net(
            10.0 * _TEN, (-40, 90, 10), "whistle", 10, 48_000, (0.6,), 4.0,
            0.5, 1480.0, water,
        ),
    }  # fmt: skip


def _sound(name: str, seed: int, rate: int) -> NDArray[np.float64]:
    if "song" in name:
        return song(seed, 0.4, rate)
    if name == "shot":
        return shot(rate)
    if name == "bat":
        return sweep(80e3, 30e3, 0.005, rate)
    if name == "whistle":
        return sweep(8e3, 13e3, 0.5, rate)
    return np.diff(shot(rate)) * 10.0


def recording(
    net: _Net, seed: int
) -> tuple[NDArray[np.float64], ArrayGeometry, NDArray[np.float64]]:
    """Returns the (n, samples) recording, the stated array, and the (d,) source, m."""
    rng = np.random.default_rng(seed)
    one = _sound(net.sound, seed, net.rate)
    played = at_times(one, list(net.times_s), net.seconds, net.rate)
    d = net.places.shape[1]
    source = np.array(net.source[:d])
    heard = free_field([(played, tuple(source))], net.places, net.rate, net.c)
    heard = with_noise(heard, net.snr_db, seed, of_nearest="faint" in net.sound)
    errors = net.place_std * rng.standard_normal(net.places.shape)
    stated = {
        "microphones": (net.places + errors).tolist(),
        "position_std_m": net.place_std,
        **net.known,
    }
    return heard, ArrayGeometry.model_validate(stated), source


def judge_position(result: LocateResult, source: NDArray[np.float64]) -> Outcome:
    """Judges the bearing, and the position if there is one."""
    told = result.main_source()
    center = np.mean(result.array["microphones"], axis=0)
    off = source - center
    true = math.degrees(math.atan2(off[1], off[0]))
    said = (
        f"bearing {told['bearing_deg']} +- {told['bearing_std_deg']} for {true:.1f}, "
        f"position {told['position_m']} for {source.tolist()}"
    )
    if told["bearing_deg"] is None:
        return Outcome(right=False, said=f"nothing; {result.faults}")
    directions = [told["bearing_deg"]]
    directions += [other["bearing_deg"] for other in told["alternatives"]]
    limit = max(3.0 * told["bearing_std_deg"], 5.0)
    right = min(abs((d - true + 180) % 360 - 180) for d in directions) < limit
    if told["position_m"] is not None:
        std = np.sqrt(np.diag(told["position_covariance_m2"]))
        error = np.abs(np.array(told["position_m"]) - source)[:2]
        right = right and bool(np.all(error < 3.5 * std[:2]))
    sources = result.document()["sources"]
    claims = any(
        s["confidence"] > 0.5
        and min(abs((s["bearing_deg"] - d + 180) % 360 - 180) for d in (true,)) > limit
        for s in sources
    )
    return Outcome(right and not claims, said, claims)


def _judge(net: _Net, seed: int) -> Outcome:
    samples, geometry, source = recording(net, seed)
    try:
        result = locate(samples, geometry, sample_rate_hz=net.rate)
    except InputError as error:
        return Outcome(right=False, said=str(error))
    return judge_position(result, source)


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    return [
        HearingCase(name, partial(_judge, net, seed))
        for seed, (name, net) in enumerate(_nets().items())
    ]
