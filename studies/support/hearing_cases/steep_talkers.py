"""One talker at any elevation is one source, for locate and for listen."""

from __future__ import annotations

import math
from functools import partial

from studies.support.hearing_cases.case import CLAIM, HearingCase, Outcome
from studies.support.hearing_cases.one_opinion import (
    RATE,
    SQUARE,
    Array,
    Degrees,
    brief,
    circle,
    contradicts,
    locate_answer,
    off_deg,
    record,
    speech,
    tracks_of,
)

TITLE = "talkers at any elevation"

# Largest error of a right direction, deg, unless its standard deviation is larger. In
# rooms, elevations of small arrays are uncertain.
_WITHIN_DEG, _IN_ROOMS_DEG = 5.0, 15.0


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    six, eight = circle(6, 0.0465), circle(8, 0.1)
    free = [
        (name, places, (bearing, elevation), 0.0, None)
        for name, places, bearing in (
            ("square", SQUARE, 50.0),
            ("circle of 6", six, -120.0),
            ("circle of 8", eight, 170.0),
        )
        for elevation in (40.0, 60.0, 66.0, 70.0, 75.0, 80.0, 86.0, 90.0)
    ]
    ceiling = [
        ("square under a ceiling", SQUARE, (30.0, -75.0), t60, "below")
        for t60 in (0.3, 0.5)
    ]
    rooms = [
        ("circle of 8", eight, (-60.0, 75.0), 0.3, None),
        ("circle of 6", six, (100.0, 80.0), 0.3, None),
    ]
    found = []
    for k, (name, places, at, t60, side) in enumerate([*free, *ceiling, *rooms]):
        judge = partial(_judged, places, at, t60, k, side)
        found.append(HearingCase(f"{name}, {at[1]:g} deg, T60 {t60} s", judge))
    return found


def _judged(
    places: Array, at: Degrees, t60_s: float, seed: int, side: str | None
) -> Outcome:
    distance = 1.1 if at[1] < 0.0 else 1.4
    samples = record(
        places, [(speech(seed, 4.0), at, distance)], t60_s=t60_s, seed=seed
    )
    document = locate_answer(samples, places, RATE, side)
    if isinstance(document, str):
        return Outcome(right=False, said=brief(document))
    sources, summary = document["sources"], document["summary"]
    tracks = tracks_of(samples, places, RATE, side)
    wrong = sum(not _is_at(s, at, t60_s) for s in sources if s["confidence"] > CLAIM)
    right = len(sources) == 1 and not contradicts(document) and not wrong
    right &= summary["bearing_deg"] is not None and len(tracks) == 1
    said = f"{brief(document)}; {len(tracks)} tracks"
    return Outcome(bool(right), said, wrong > 0)


def _is_at(source: dict[str, float], at: Degrees, t60_s: float) -> bool:
    within = _IN_ROOMS_DEG if t60_s else _WITHIN_DEG
    off = off_deg(source["bearing_deg"], at[0]) * math.cos(math.radians(at[1]))
    std = source["bearing_std_deg"] * math.cos(math.radians(at[1]))
    high = abs(source["elevation_deg"] - at[1])
    return off <= max(within, 3.0 * std) and high <= max(
        within, 3.0 * source["elevation_std_deg"]
    )
