"""A talker over the steady noise of a fan from one direction."""

from __future__ import annotations

from functools import partial

from studies.support.hearing_cases.case import CLAIM, HearingCase, Outcome
from studies.support.hearing_cases.one_opinion import (
    RATE,
    SQUARE,
    Array,
    brief,
    circle,
    contradicts,
    false_claim,
    fan,
    locate_answer,
    loudness_db,
    off_deg,
    record,
    speech,
)

TITLE = "talkers over fans"

_WITHIN_DEG = 8.0


def cases() -> list[HearingCase]:
    """Returns the cases of this kind."""
    six = circle(6, 0.0465)
    found = []
    for name, places, talker, at in (
        ("square", SQUARE, 0.0, 120.0),
        ("circle of 6", six, 70.0, -40.0),
    ):
        for kind in ("white", "pink", "brown"):
            for louder, t60 in ((6.0, 0.0), (6.0, 0.3), (10.0, 0.0), (15.0, 0.3)):
                judge = partial(_judged, places, talker, at, kind, louder, t60)
                text = f"{name}, {kind} fan, talker {louder:g} dB louder, T60 {t60} s"
                found.append(HearingCase(text, judge))
    return found


def _judged(
    places: Array, talker: float, at: float, kind: str, louder_db: float, t60_s: float
) -> Outcome:
    seed = round(louder_db)
    voice, noise = speech(seed), fan(kind, seed)
    level = loudness_db(voice) - louder_db - loudness_db(noise)
    sounds = [
        (voice, (talker, 10.0), 1.5),
        (noise * 10.0 ** (level / 20.0), (at, 10.0), 1.5),
    ]
    samples = record(places, sounds, t60_s=t60_s, snr_db=30.0, seed=seed)
    document = locate_answer(samples, places, RATE)
    if isinstance(document, str):
        return Outcome(right=False, said=brief(document))
    summary = document["summary"]
    claim = false_claim(document, [(talker, 10.0), (at, 10.0)])
    right = not claim and not contradicts(document)
    right &= summary["bearing_deg"] is not None
    if right:
        right &= off_deg(summary["bearing_deg"], talker) <= _WITHIN_DEG
        right &= document["sources"][0]["confidence"] > CLAIM
    return Outcome(bool(right), brief(document), claim)
