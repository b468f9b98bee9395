"""Recordings whose summary, sources and faults must not contradict each other."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import phonotaxis
from analysis.arrays.voting.direction_votes import VotePlan
from analysis.arrays.voting.source_listener import (
    ListenerMemory,
    ListenerParameters,
    hear_sources,
)
from studies.support.hearing_cases.case import CLAIM, HearingCase, Outcome
from studies.support.synthetic_speech import speech_like
from studies.support.talker_trials import (
    TalkerScene,
    heard_from,
    impulse_responses,
    with_noise,
)
from systems.framework.input_error import InputError

TITLE = "one opinion"

Array = NDArray[np.float64]
Degrees = tuple[float, float]

RATE = 16_000
# Largest error of a right bearing, deg, unless its standard deviation is larger.
_WITHIN_DEG = 5.0


def circle(count: int, radius_m: float) -> Array:
    """Returns (count, 3) positions of microphones on a level circle, m."""
    a = 2.0 * np.pi * np.arange(count) / count
    return radius_m * np.column_stack((np.cos(a), np.sin(a), 0.0 * a))


def row(count: int, step_m: float) -> Array:
    """Returns (count, 3) positions of microphones along x, m."""
    x = step_m * (np.arange(count) - 0.5 * (count - 1))
    return np.column_stack((x, 0.0 * x, 0.0 * x))


SQUARE = circle(4, 0.0323) @ np.array(
    [[0.5**0.5, 0.5**0.5, 0.0], [-(0.5**0.5), 0.5**0.5, 0.0], [0.0, 0.0, 1.0]]
)
# Two recorders in an L of 1 m, with one close pair.
ELL = np.array([[0.015, 0, 0], [1.01, 0, 0], [0, 0, 0], [0, 0, 1.01]])
CROSS = circle(4, 0.4)
# Microphones along the walls of a room of 5 m by 4 m.
IN_ROOM = np.array(
    [
        [-2.2, -1.7, 0.3],
        [0.1, -1.8, 0.9],
        [2.2, -1.7, 0.2],
        [2.3, 1.7, 1.0],
        [-0.2, 1.8, 0.1],
        [-2.3, 1.6, 0.8],
    ]
)


def speech(seed: int, seconds: float = 5.0, rate: int = RATE) -> Array:
    """Returns sound like that of a talker, with an RMS of 1."""
    return speech_like(np.random.default_rng([seed, 1]), seconds, rate)


def fan(kind: str, seed: int, seconds: float = 5.0, rate: int = RATE) -> Array:
    """Returns white, pink or brown noise above 60 Hz."""
    rng = np.random.default_rng([seed, 2])
    spectrum = np.fft.rfft(rng.standard_normal(round(seconds * rate)))
    f = np.fft.rfftfreq(round(seconds * rate), 1.0 / rate)
    slope = {"white": 0.0, "pink": 0.5, "brown": 1.0}[kind]
    spectrum *= np.where(f > 60.0, np.maximum(f, 60.0) ** -slope, 0.0)
    return np.asarray(np.fft.irfft(spectrum, round(seconds * rate)))


def siren(seconds: float = 5.0, rate: int = RATE) -> Array:
    """Returns a tone that sweeps between 400 and 1400 Hz, once a second."""
    t = np.arange(round(seconds * rate)) / rate
    f = 900.0 + 500.0 * np.sin(2.0 * np.pi * t)
    return np.asarray(np.sin(2.0 * np.pi * np.cumsum(f) / rate))


def clap(seed: int, seconds: float = 1.0, rate: int = 48_000) -> Array:
    """Returns noise that decays within 4 ms, 0.3 s after the start."""
    sound = np.zeros(round(seconds * rate))
    t = np.arange(round(0.03 * rate)) / rate
    noise = np.random.default_rng([seed, 3]).standard_normal(t.size)
    first = round(0.3 * rate)
    sound[first : first + t.size] = noise * np.exp(-t / 0.004)
    return sound


def loudness_db(sound: Array, rate: int = RATE) -> float:
    """Returns the A-weighted level of a sound (IEC 61672-1), dB."""
    f = np.fft.rfftfreq(sound.size, 1.0 / rate)[1:]
    weight = (12194.0**2 * f**4) / (
        (f**2 + 20.6**2)
        * np.sqrt((f**2 + 107.7**2) * (f**2 + 737.9**2))
        * (f**2 + 12194.0**2)
    )
    power = np.sum(np.abs(np.fft.rfft(sound)[1:] * weight) ** 2)
    return float(10.0 * np.log10(power / sound.size**2))


def record(
    places: Array,
    sounds: list[tuple[Array, Degrees, float]],
    *,
    t60_s: float = 0.0,
    snr_db: float = 25.0,
    rate: int = RATE,
    seed: int = 0,
) -> Array:
    """Returns the (n, samples) channels of sounds in a room of 6 m by 5 m by 2.8 m.

    Each sound has its samples, its bearing and elevation in deg, and its distance from
    the origin of the array in m.
    """
    scene = TalkerScene(
        bearings_deg=tuple(at[0] for _, at, _ in sounds),
        elevations_deg=tuple(at[1] for _, at, _ in sounds),
        distances_m=tuple(distance for _, _, distance in sounds),
        center_m=(3.0, 2.4, 1.2),
        t60_s=t60_s,
    )
    responses = impulse_responses(scene, places, sample_rate_hz=rate)
    heard = np.sum(
        [heard_from(r, s) for r, (s, _, _) in zip(responses, sounds, strict=True)],
        axis=0,
    )
    return with_noise(heard, snr_db, np.random.default_rng([seed, 4]))


def off_deg(first: float, second: float) -> float:
    """Returns the angle between two bearings, deg."""
    return abs((first - second + 180.0) % 360.0 - 180.0)


def _geometry(places: Array, side: str | None) -> phonotaxis.ArrayGeometry:
    return phonotaxis.ArrayGeometry.model_validate(
        {"microphones": places.tolist(), "sound_speed": 343.0, "side": side}
    )


def locate_answer(
    samples: Array, places: Array, rate: int, side: str | None = None
) -> dict[str, Any] | str:
    """Returns the document of ``locate``, or the message of its refusal."""
    geometry = _geometry(places, side)
    try:
        return phonotaxis.locate(samples, geometry, sample_rate_hz=rate).document()
    except InputError as error:
        return str(error)


def tracks_of(
    samples: Array, places: Array, rate: int, side: str | None = None
) -> dict[int, list[float]]:
    """Returns the bearings that ``listen`` reports of each identity, deg."""
    known = _geometry(places, side).known
    plan = VotePlan.of(known.shape, known.c, rate, band_hz=(200.0, 0.45 * rate))
    steps, _ = hear_sources(
        samples, ListenerMemory.blank(plan), plan, ListenerParameters()
    )
    tracks: dict[int, list[float]] = {}
    for step in steps:
        for track in step.tracks:
            at = math.degrees(track.bearing)
            tracks.setdefault(track.identity, []).append(at)
    return tracks


def brief(document: dict[str, Any] | str) -> str:
    """Returns what a document says in one line."""
    if isinstance(document, str):
        return "refused: " + document[:90]
    summary = document["summary"]
    if summary["bearing_deg"] is None:
        said = "none"
    else:
        said = f"{summary['bearing_deg']:.1f} +-{summary['bearing_std_deg']:.1f}"
        if summary["elevation_deg"] is not None:
            said += f", el {summary['elevation_deg']:.0f}"
    sources = " ".join(
        f"({s['bearing_deg']:.0f}, {s['confidence']:.2f})" for s in document["sources"]
    )
    faults = ",".join(f["kind"] for f in summary["faults"])
    count = summary["number_of_sources"]
    return f"{said}; {count}: {sources}; {faults or 'no fault'}"


def contradicts(document: dict[str, Any]) -> bool:
    """Returns whether the summary and the list of sources differ."""
    summary, sources = document["summary"], document["sources"]
    if not sources:
        return summary["bearing_deg"] is not None
    if summary["bearing_deg"] is None:
        return True
    count = summary["number_of_sources"]
    off = off_deg(sources[0]["bearing_deg"], summary["bearing_deg"])
    return off > 1e-6 or (count is not None and count != len(sources))


def false_claim(document: dict[str, Any], truth: list[Degrees]) -> bool:
    """Returns whether a source with a confidence above 0.5 is at no true direction."""
    for source in document["sources"]:
        allowed = max(_WITHIN_DEG, 3.0 * source["bearing_std_deg"])
        far = all(
            off_deg(source["bearing_deg"], at[0]) * math.cos(math.radians(at[1]))
            > allowed
            for at in truth
        )
        if far and source["confidence"] > CLAIM:
            return True
    return False


def judged(
    make: Callable[[], tuple[Array, Array]],
    truth: list[Degrees],
    *,
    rate: int = RATE,
    counts: tuple[int | None, ...] = (1, None),
    sure: bool = False,
    silent: bool = False,
    side: str | None = None,
) -> Outcome:
    """Judges ``locate``: the summary is at the first of the true directions.

    Args:
        make: Makes the (n, samples) recording and the stated places of microphones.
        truth: Bearings and elevations of all sources, deg. Empty if no answer is right.
        rate: Samples per second.
        counts: Right numbers of sources.
        sure: Whether the first source must have a confidence above 0.5.
        silent: Whether no estimate, or a refusal, is right as well.
        side: Side of the array on which the sources are.

    Returns:
        The outcome.
    """
    document = locate_answer(*make(), rate, side)
    if isinstance(document, str):
        return Outcome(silent or not truth, brief(document))
    summary = document["summary"]
    claim = false_claim(document, truth)
    right = not claim and not contradicts(document)
    if not truth:
        return Outcome(right, brief(document), claim)
    bearing, elevation = truth[0]
    if summary["bearing_deg"] is None:
        return Outcome(right and silent, brief(document), claim)
    allowed = max(_WITHIN_DEG, 3.0 * summary["bearing_std_deg"])
    off = off_deg(summary["bearing_deg"], bearing)
    right &= off * math.cos(math.radians(elevation)) <= allowed
    right &= summary["number_of_sources"] in counts
    if sure:
        right &= document["sources"][0]["confidence"] > CLAIM
    return Outcome(bool(right), brief(document), claim)


class Wrong(NamedTuple):
    """What is wrong with a recording or its geometry."""

    order: tuple[int, ...] = ()
    """Order of the channels. Empty if it is right."""
    late_s: float = 0.0
    """How late the second half of the channels is, s."""
    scale: float = 1.0
    """Factor of all stated positions."""


def _speech_in(
    places: Array,
    at: Degrees,
    distance_m: float,
    t60_s: float,
    snr_db: float,
    seed: int,
    wrong: Wrong = Wrong(),
) -> tuple[Array, Array]:
    """Makes a recording of one talker, with channels in a wrong order or late."""
    heard = record(
        places,
        [(speech(seed), at, distance_m)],
        t60_s=t60_s,
        snr_db=snr_db,
        seed=seed,
    )
    half = len(heard) // 2
    heard[half:] = np.roll(heard[half:], round(wrong.late_s * RATE), axis=1)
    if wrong.order:
        heard = heard[list(wrong.order)]
    return heard, places * wrong.scale


def _sound_at(
    places: Array,
    sound: Array,
    at: Degrees,
    distance_m: float,
    t60_s: float,
    rate: int,
    snr_db: float = 25.0,
) -> tuple[Array, Array]:
    heard = record(
        places, [(sound, at, distance_m)], t60_s=t60_s, rate=rate, snr_db=snr_db
    )
    return heard, places


def _case(
    name: str, make: Callable[[], tuple[Array, Array]], **how: Any
) -> HearingCase:
    return HearingCase(name, partial(judged, make, **how))


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    return [*_wide(), *_inside(), *_claps(), *_faulty(), *_unsure()]


def _wide() -> list[HearingCase]:
    """Long arrays in rooms, in which side lobes are possible."""
    triangle = circle(3, 0.45)
    found = []
    for name, places, at in (
        ("L of 1 m", ELL, (49.0, 5.0)),
        ("triangle of 0.8 m", triangle, (-100.0, 0.0)),
        ("circle of 6, 1 m", circle(6, 0.5), (20.0, 5.0)),
        ("row of 5, 1.2 m", row(5, 0.3), (60.0, 0.0)),
    ):
        for k, t60 in enumerate((0.3, 0.6)):
            make = partial(_speech_in, places, at, 1.9, t60, 25.0, 10 + k)
            # Bearings are from the centroid of the microphones.
            center = places.mean(axis=0)
            a, e = np.radians(at)
            p = 1.9 * np.array(
                [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
            )
            x, y, _ = p - center
            truth = [(math.degrees(math.atan2(y, x)), at[1])]
            found.append(_case(f"{name}, T60 {t60} s", make, truth=truth, silent=True))
    return found


def _inside() -> list[HearingCase]:
    found = []
    center = IN_ROOM.mean(axis=0)
    for k, (x, y) in enumerate(((-0.4, -0.2), (0.7, 0.5), (-1.0, 0.6), (1.4, -0.4))):
        at = (math.degrees(math.atan2(y, x)), 0.0)
        make = partial(_speech_in, IN_ROOM, at, math.hypot(x, y), 0.3, 25.0, 20 + k)
        bearing = math.degrees(math.atan2(y - center[1], x - center[0]))
        found.append(
            _case(
                f"talker among six microphones, ({x}, {y})",
                make,
                truth=[(bearing, 0.0)],
                silent=True,
            )
        )
    return found


def _claps() -> list[HearingCase]:
    return [
        _case(
            f"clap, {name}, T60 {t60} s",
            partial(_sound_at, places, clap(k), (50.0, 5.0), 1.8, t60, 48_000),
            truth=[(50.0, 5.0)],
            rate=48_000,
        )
        for k, (name, places) in enumerate(
            (("cross of 0.8 m", CROSS), ("square", SQUARE), ("circle", circle(6, 0.1)))
        )
        for t60 in (0.3, 0.8)
    ]


def _faulty() -> list[HearingCase]:
    """Wrong orders, late cards and wrong units, which leave no right direction."""
    six, eight = circle(6, 0.0465), circle(8, 0.1)
    found = []
    for name, places, order in (
        ("row 2143", row(4, 0.05), (1, 0, 3, 2)),
        ("row 3412", row(4, 0.05), (2, 3, 0, 1)),
        ("circle of 6, 135246", six, (0, 2, 4, 1, 3, 5)),
        ("circle of 6, 213456", six, (1, 0, 2, 3, 4, 5)),
        ("circle of 8, 13572468", eight, (0, 2, 4, 6, 1, 3, 5, 7)),
        ("circle of 8, 21436587", eight, (1, 0, 3, 2, 5, 4, 7, 6)),
    ):
        for k, t60 in enumerate((0.0, 0.3)):
            make = partial(
                _speech_in, places, (70.0, 10.0), 1.5, t60, 25.0, 30 + k, Wrong(order)
            )
            found.append(_case(f"{name}, T60 {t60} s", make, truth=[]))
    for late_s in (1.0 / RATE, 0.001, 0.01, 0.05, 0.2):
        for name, places in (("square", SQUARE), ("circle of 6", six)):
            make = partial(
                _speech_in, places, (50.0, 10.0), 1.5, 0.3, 25.0, 40, Wrong((), late_s)
            )
            found.append(
                _case(f"{name}, half of it {1e3 * late_s:.3g} ms late", make, truth=[])
            )
    for name, scale in (
        ("inches", 1.0 / 0.0254),
        ("half", 0.5),
        ("feet", 1.0 / 0.3048),
    ):
        make = partial(
            _speech_in, SQUARE, (50.0, 30.0), 1.5, 0.3, 25.0, 50, Wrong((), 0.0, scale)
        )
        found.append(
            _case(f"square in {name}", make, truth=[(50.0, 30.0)], silent=True)
        )
    return found


def _unsure() -> list[HearingCase]:
    """Sounds that the stretches hardly hear, but the votes do."""
    found = []
    for name, places in (
        ("square", SQUARE),
        ("circle of 6", circle(6, 0.0465)),
        ("row", row(4, 0.05)),
    ):
        at = (50.0, 5.0)
        speaks = partial(_speech_in, places, at, 1.5, 0.0, 0.0, 60)
        found.append(_case(f"{name}, speech at 0 dB", speaks, truth=[at], sure=True))
        wails = partial(_sound_at, places, siren(), at, 1.5, 0.0, RATE)
        found.append(_case(f"{name}, siren", wails, truth=[at]))
    return found
