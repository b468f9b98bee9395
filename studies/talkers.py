"""Several talkers at once, still and walking.

Recordings of simulated rooms through what ``phonotaxis locate`` does, number of
sources unknown: recall and false sources, single talkers, steady noises, talkers who
cross, begin and end of tracks, and pyroomacoustics' searches beside ours. With
``--voices`` the talkers say what is in the mono WAV files of a folder; with
``--recordings`` real recordings of one source by a square of four microphones are
located and mixed. Each row names its bound; those missed are listed at the end.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.heard_sources import HeardSources, heard_sources
from analysis.arrays.voting.direction_votes import VotePlan
from analysis.arrays.voting.source_listener import (
    ListenerMemory,
    ListenerParameters,
    TrackedSources,
    hear_sources,
)
from studies.support.figures import Figure, bounds_table
from studies.support.synthetic_speech import speech_like
from studies.support.talker_peers import (
    OPEN_PEERS,
    PEERS,
    by_file,
    by_file_unknown,
    by_votes,
)
from studies.support.talker_rooms import (
    RATE,
    Recording,
    Voices,
    Walk,
    crossings,
    mixtures,
    noises,
    talkers,
    voices_of,
)
from studies.support.talker_trials import (
    TALKER_ARRAYS,
    draw_talkers,
    heard_from,
    impulse_responses,
    score_bearings,
    with_noise,
)
from studies.tables import Table
from systems.sound.array_shape import ArrayShape

C = 343.0
BAND_HZ = (300.0, 0.45 * RATE)
SQUARE = "square, 4.6 cm"
RECORDED_SQUARE_M = 0.02285 * np.array(
    [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]]
)
RECORDED_DEG = 180.0

#: Separation in deg, T60 in s, and the least recall.
CELLS = (
    (20.0, 0.0, 0.9),
    (30.0, 0.3, 0.9),
    (30.0, 0.6, 0.75),
    (45.0, 0.3, 0.95),
    (45.0, 0.6, 0.95),
)
MOST_FALSE, LEAST_SINGLE, LEAST_KEPT, LEAST_SURE = 0.1, 0.99, 0.8, 0.9

Namer = Callable[[Recording], list[float]]


class Tally:
    """What was found of some recordings."""

    def __init__(self) -> None:
        self.recordings = self.found = self.talkers = self.false = self.exact = 0
        self.errors: list[float] = []

    def add(self, named_deg: list[float], true_deg: list[float]) -> None:
        """One more recording."""
        score = score_bearings(named_deg, true_deg)
        self.recordings += 1
        self.found += score.found
        self.talkers += score.talkers
        self.false += score.false
        self.exact += score.found == score.talkers and score.false == 0
        self.errors += score.errors_deg

    @property
    def recall(self) -> float:
        """Share of the talkers that were named within 10 deg."""
        return self.found / self.talkers

    @property
    def false_each(self) -> float:
        """False sources a recording."""
        return self.false / self.recordings

    @property
    def rms_deg(self) -> float:
        """Of the errors of those found, deg."""
        return math.sqrt(np.mean(np.square(self.errors))) if self.errors else math.nan


def heard(channels: NDArray[np.float32], places: NDArray[np.float64]) -> HeardSources:
    """As ``phonotaxis locate`` hears a recording."""
    equal = channels - channels.mean(axis=1, keepdims=True)
    equal = equal / equal.std(axis=1, keepdims=True)
    return heard_sources(equal, ArrayShape.of(places), C, float(RATE), BAND_HZ)


def tally(recordings: Iterable[Recording], name: Namer) -> Tally:
    """What a method finds."""
    counts = Tally()
    for recording in recordings:
        counts.add(name(recording), recording.bearings_deg)
    return counts


def product(places: NDArray[np.float64], sure: list[tuple[float, bool]]) -> Namer:
    """Ours; each source's confidence and whether it is true goes into ``sure``."""

    def name(recording: Recording) -> list[float]:
        sources = heard(recording.channels, places).sources
        for source in sources:
            score = score_bearings([source.bearing_deg], recording.bearings_deg)
            sure.append((source.confidence, score.found == 1))
        return [source.bearing_deg for source in sources]

    return name


TALKERS_HEADINGS = (
    "array",
    "talkers",
    "apart",
    "T60",
    "recordings",
    "recall",
    "required",
    "false each",
    "all found, none false",
    "rms error",
)


def talkers_rows(
    arrays: list[str],
    draws: int,
    seed: int,
    voices: Voices,
    figures: list[Figure],
    sure: list[tuple[float, bool]],
) -> Iterator[Sequence[str]]:
    """Two and three talkers."""
    for array in arrays:
        share = draws if array == SQUARE else max(1, draws // 3)
        name = product(TALKER_ARRAYS[array], sure)
        for apart, t60, asked in CELLS:
            for count in (2, 3):
                rooms = talkers(array, count, apart, t60, share, seed, voices)
                counts = tally(rooms, name)
                cell = f"{array}, {count} at {apart:g} deg, T60 {t60:g} s"
                figures += [
                    Figure(f"{cell}: recall", counts.recall, ">=", asked),
                    Figure(f"{cell}: false", counts.false_each, "<=", MOST_FALSE),
                ]
                yield _counts(array, str(count), f"{apart:g} deg", t60, counts, asked)


def singles_rows(
    arrays: list[str], draws: int, seed: int, voices: Voices, figures: list[Figure]
) -> Iterator[Sequence[str]]:
    """Single talkers, six times as many where it echoes most."""
    for array in arrays:
        share = draws if array == SQUARE else max(1, draws // 3)
        name = product(TALKER_ARRAYS[array], [])
        for t60 in (1.2, 0.6, 0.3):
            many = 6 * share if t60 == 1.2 else share
            counts = tally(talkers(array, 1, 0.0, t60, many, seed, voices), name)
            exact = counts.exact / counts.recordings
            cell = f"{array}, single, T60 {t60:g} s: exactly one"
            figures.append(Figure(cell, exact, ">=", LEAST_SINGLE))
            yield _counts(array, "1", "-", t60, counts, LEAST_SINGLE)


def _counts(
    array: str, count: str, apart: str, t60: float, counts: Tally, asked: float
) -> Sequence[str]:
    return (
        array,
        count,
        apart,
        f"{t60:g} s",
        str(counts.recordings),
        f"{counts.recall:.3f}",
        f"{asked:g}",
        f"{counts.false_each:.3f}",
        f"{counts.exact / counts.recordings:.3f}",
        f"{counts.rms_deg:.1f} deg",
    )


def confidence_rows(
    sure: list[tuple[float, bool]], figures: list[Figure]
) -> Iterator[Sequence[str]]:
    """How many sources of a confidence are true."""
    for low, high in ((0.0, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1.01)):
        true = [is_true for confidence, is_true in sure if low <= confidence < high]
        if not true:
            continue
        share = float(np.mean(true))
        yield f"{low:g} to {min(high, 1.0):g}", str(len(true)), f"{share:.3f}"
        if low == LEAST_SURE:
            figures.append(Figure("true of those above 0.9", share, ">=", LEAST_SURE))


CROSSINGS_HEADINGS = ("two who cross", "T60", "recordings", "identities kept")
BEGINS_HEADINGS = (
    "T60",
    "recordings",
    "begins within 0.5 s",
    "ends within 2 s",
    "one track",
)
RECORDED_HEADINGS = (
    "recordings",
    "number",
    "recall",
    "false each",
    "all found, none false",
)
NOISES_HEADINGS = (
    "array",
    "steady noises",
    "T60",
    "recordings",
    "number not told",
    "main source is one of them",
    "largest confidence",
)


def noises_rows(
    draws: int, seed: int, figures: list[Figure]
) -> Iterator[Sequence[str]]:
    """Stationary noises: their number is not told, nor is it for one."""
    for array, places in TALKER_ARRAYS.items():
        for count in (1, 2):
            for t60 in (0.0, 0.3, 0.6):
                steady, right, confidence = [], [], [0.0]
                for recording in noises(array, count, t60, draws, seed):
                    told = heard(recording.channels, places)
                    named = [source.bearing_deg for source in told.sources]
                    score = score_bearings(named, recording.bearings_deg)
                    steady.append(told.steady)
                    right.append(score.found == 1 and score.false == 0)
                    confidence += [source.confidence for source in told.sources]
                yield (
                    array,
                    str(count),
                    f"{t60:g} s",
                    str(len(steady)),
                    f"{np.mean(steady):.3f}",
                    f"{np.mean(right):.3f}",
                    f"{max(confidence):.2f}",
                )
                cell = f"{array}, {count} noises, T60 {t60:g} s"
                figures.append(Figure(cell, float(np.mean(steady)), ">=", 0.99))


def crossings_rows(
    draws: int, seed: int, figures: list[Figure]
) -> Iterator[Sequence[str]]:
    """Talkers who walk past each other."""
    for speeds in ((20.0, 0.0), (10.0, -10.0), (20.0, -20.0)):
        for t60 in (0.0, 0.3):
            seconds = 240.0 / (abs(speeds[0]) + abs(speeds[1]) + 20.0)
            walks = crossings(SQUARE, speeds, t60, draws, seed, seconds)
            kept = [_keeps(_steps(walk.channels), walk) for walk in walks]
            share = float(np.mean(kept))
            cell = f"{speeds[0]:g} and {speeds[1]:g} deg/s"
            yield cell, f"{t60:g} s", str(len(kept)), f"{share:.3f}"
            figures.append(Figure(f"{cell}, T60 {t60:g} s", share, ">=", LEAST_KEPT))


def _steps(channels: NDArray[np.float32]) -> list[TrackedSources]:
    """As ``phonotaxis listen`` hears them, in blocks of 20 ms."""
    plan = VotePlan.of(
        ArrayShape.of(TALKER_ARRAYS[SQUARE]), C, float(RATE), band_hz=BAND_HZ
    )
    memory, steps = ListenerMemory.blank(plan), []
    size = round(0.02 * RATE)
    for first in range(0, channels.shape[1], size):
        block = channels[:, first : first + size]
        told, memory = hear_sources(block, memory, plan, ListenerParameters())
        steps += told
    return steps


def _keeps(steps: list[TrackedSources], walk: Walk) -> bool:
    """Whether each talker has one identity before and after, and not the other's.

    They are compared in the second before they are 20 deg apart, and in the one that
    begins 0.2 s after they are so again.
    """
    near = np.flatnonzero(np.abs(np.diff(walk.bearings_deg, axis=0)[0]) < 20.0) / RATE
    before = _identities(steps, walk, near[0] - 1.0, near[0])
    after = _identities(steps, walk, near[-1] + 0.2, near[-1] + 1.2)
    return None not in before and before == after and before[0] != before[1]


def _identities(
    steps: list[TrackedSources], walk: Walk, begin: float, end: float
) -> list[int | None]:
    """The track that is within 12 deg of each talker most of a time."""
    late = 0.5 * ListenerParameters().window_s
    found: list[int | None] = []
    for way in walk.bearings_deg:
        near = [
            track.identity
            for step in steps
            if begin <= step.t_s - late < end
            for track in step.tracks
            if abs(
                _wrapped_deg(
                    math.degrees(track.bearing) - way[round((step.t_s - late) * RATE)]
                )
            )
            < 12.0
        ]
        found.append(max(set(near), key=near.count) if near else None)
    return found


def _wrapped_deg(angle: float) -> float:
    return 180.0 - (180.0 - angle) % 360.0


def begins_rows(
    draws: int, seed: int, figures: list[Figure]
) -> Iterator[Sequence[str]]:
    """Silence, a talker for 3 s, and silence again."""
    rng = np.random.default_rng(seed)
    for t60 in (0.0, 0.3, 0.6):
        begins, ends, single = [], [], []
        scene = draw_talkers(rng, 24, 15.0, t60_s=t60)
        responses = impulse_responses(scene, TALKER_ARRAYS[SQUARE])
        for _ in range(draws):
            speech = speech_like(rng, 3.0, RATE)
            speech = speech[np.flatnonzero(np.abs(speech) > 0.05)[0] :]
            sound = np.zeros(7 * RATE)
            sound[RATE : RATE + speech.size] = speech
            channels = heard_from(responses[rng.integers(24)], sound)
            steps = _steps(with_noise(channels, 20.0, rng).astype(np.float32))
            told = [step.t_s for step in steps if step.tracks]
            begins.append(bool(told) and told[0] <= 1.5 + 1e-9)
            ends.append(bool(told) and told[-1] <= 1.0 + speech.size / RATE + 2.0)
            single.append(len({t.identity for s in steps for t in s.tracks}) == 1)
        shares = [float(np.mean(each)) for each in (begins, ends, single)]
        yield f"{t60:g} s", str(draws), *(f"{share:.3f}" for share in shares)
        figures += [
            Figure(f"begins within 0.5 s, T60 {t60:g} s", shares[0], ">=", 0.9),
            Figure(f"ends within 2 s, T60 {t60:g} s", shares[1], ">=", 0.99),
        ]


def recordings_rows(folder: Path, figures: list[Figure]) -> Iterator[Sequence[str]]:
    """Real recordings, alone and mixed."""
    for turns in ((0,), (0, 1), (0, 2), (0, 1, 2), (0, 1, 3)):
        counts = tally(
            mixtures(folder, turns, RECORDED_DEG), product(RECORDED_SQUARE_M, [])
        )
        title = " + ".join(f"{90 * turn} deg" for turn in turns)
        yield (
            title,
            str(counts.recordings),
            f"{counts.recall:.3f}",
            f"{counts.false_each:.3f}",
            f"{counts.exact / counts.recordings:.3f}",
        )
        figures += [
            Figure(f"recorded, {title}: recall", counts.recall, ">=", 0.95),
            Figure(f"recorded, {title}: false", counts.false_each, "<=", MOST_FALSE),
        ]


def peers_table(draws: int, seed: int, folder: Path | None) -> Table:
    """Ours and pyroomacoustics' on the same recordings."""
    cells = {
        f"{count} at {apart:g}, T60 {t60:g}": list(
            talkers(SQUARE, count, apart, t60, draws, seed)
        )
        for count, apart, t60 in (
            (1, 0.0, 0.6),
            (2, 30.0, 0.3),
            (2, 45.0, 0.6),
            (3, 45.0, 0.6),
        )
    }
    places = dict.fromkeys(cells, TALKER_ARRAYS[SQUARE])
    if folder is not None:
        for title, turns in (("2 recorded", (0, 1)), ("3 recorded", (0, 1, 2))):
            cells[title] = list(mixtures(folder, turns, RECORDED_DEG))
            places[title] = RECORDED_SQUARE_M
    methods: list[tuple[str, Callable[[NDArray[np.float64]], Namer]]] = [
        ("our method, number unknown", lambda at: product(at, []))
    ]
    for peer in PEERS:
        methods += [
            (f"{peer}, file, number given", partial(by_file, peer)),
            (f"{peer}, vote of blocks", partial(by_votes, peer)),
        ]
    methods += [
        (f"{peer}, file, peaks", partial(by_file_unknown, peer)) for peer in OPEN_PEERS
    ]

    def rows() -> Iterator[Sequence[str]]:
        number = sum(len(recordings) for recordings in cells.values())
        for title, method in methods:
            begin, row = time.perf_counter(), [title]
            for cell, recordings in cells.items():
                counts = tally(recordings, method(places[cell]))
                row.append(f"{counts.recall:.2f} / {counts.false_each:.2f}")
            row.append(f"{(time.perf_counter() - begin) / number:.2f}")
            yield row

    head = ("method", *cells, "s a recording")
    return Table("recall / false sources a recording", head, rows())


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument(
        "--draws", type=int, default=50, help="recordings a row, 4 or more (50)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of all that is drawn (1)")
    parser.add_argument("--voices", type=Path, help="folder of mono WAV files")
    parser.add_argument("--recordings", type=Path, help="folder of recordings")
    parser.add_argument("--array", choices=TALKER_ARRAYS, help="of talkers, one alone")
    parser.add_argument(
        "--only",
        choices=("talkers", "singles", "noises", "crossings", "recordings", "peers"),
    )


def run(options: argparse.Namespace) -> Iterator[Table]:
    """All tables, or those of one part, and their bounds."""
    draws, seed, part = max(4, options.draws), options.seed, options.only
    figures: list[Figure] = []
    arrays = [options.array] if options.array else list(TALKER_ARRAYS)
    voices = voices_of(options.voices)
    if part in (None, "talkers"):
        sure: list[tuple[float, bool]] = []
        rows = talkers_rows(arrays, draws, seed, voices, figures, sure)
        yield Table("several talkers", TALKERS_HEADINGS, rows)
        rows = confidence_rows(sure, figures)
        yield Table("confidence", ("confidence", "sources", "true"), rows)
    if part in (None, "singles"):
        rows = singles_rows(arrays, draws, seed, voices, figures)
        yield Table("single talkers", TALKERS_HEADINGS, rows)
    if part in (None, "noises"):
        rows = noises_rows(max(4, draws // 6), seed, figures)
        yield Table("steady noises", NOISES_HEADINGS, rows)
    if part in (None, "crossings"):
        rows = crossings_rows(draws // 4, seed, figures)
        yield Table("crossings", CROSSINGS_HEADINGS, rows)
        rows = begins_rows(draws // 4, seed, figures)
        yield Table("begins and ends", BEGINS_HEADINGS, rows)
    if part in (None, "recordings") and options.recordings:
        rows = recordings_rows(options.recordings, figures)
        yield Table("recorded", RECORDED_HEADINGS, rows)
    if part in (None, "peers"):
        yield peers_table(max(4, draws // 8), seed, options.recordings)
    yield from bounds_table(figures)
