"""Following one source among others.

A robot follows a source that drives round a corner while one or two other loudspeakers
sound, 30 to 120 deg beside it as the robot first sees them; random layouts in the free
field, full audio, 12 s. Level is that of the others together over the followed source
where the robot starts. Each layout with ``tdoa.choose`` loudest and followed, the
latter with a first bearing that is off by 3 deg (standard deviation). Exit status 1 if
with equally loud continuous noise more than a tenth of the layouts is not followed, or
more than 2 % of the estimates point to another source.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import soundfile
from numpy.typing import NDArray

from analysis.runs.measured_run import MeasuredRun
from diagrams import RunResult, load_scenario, simulate
from studies.support.figures import Figure, bounds_table
from studies.support.synthetic_speech import speech_like
from studies.tables import Table

DURATION_S = 12.0
SPEECH_RATE_HZ = 16_000
#: Right: within this of the source's bearing, and of its range where one is given.
BEARING_DEG, RANGE_SHARE = 10.0, 0.2
#: Standard deviation of the first bearing that the robot is told, deg.
FIRST_BEARING_STD_DEG = 3.0
#: A way never comes nearer to another source, m.
CLEAR_M = 0.9
#: What the others play, and what is no matter of their place.
SOUNDS = {
    "continuous noise": "kind: band_noise, on_s: 60.0, period_s: 60.0",
    "bursts of noise, at once": "kind: band_noise",
    "bursts of noise, 0.9 s later": "kind: band_noise, start_s: 0.9",
    "speech": "kind: wav, on_s: 10.0, period_s: 10.0, file: {file}",
}
#: With ``--room``: large enough for all ways.
ROOM = [
    "room.size_m=[16.0, 16.0, 3.0]",
    "room.corner_m=[-8.0, -8.0]",
    "room.reverberation_time_s=0.3",
]
#: Rows of the table: sound, number of others, level in dB.
ROWS = [
    *(("continuous noise", 1, level) for level in (-6.0, 0.0, 6.0)),
    ("continuous noise", 2, 0.0),
    *((name, 1, 0.0) for name in SOUNDS if name != "continuous noise"),
]
HEADINGS = (
    "others",
    "number",
    "level",
    "`tdoa.choose`",
    "frames of bursts with a right place",
    "estimates that point to another source",
    "off otherwise",
    "layouts followed",
    "error of distance, median",
)


class Layout(NamedTuple):
    """Who stands where."""

    settings: list[str]
    """Of the scenario."""
    first_bearing_deg: float
    """Of the followed source, as the robot is told."""
    others: NDArray[np.float64]
    """(k, 2) places of the other sources in W, m."""


class Score(NamedTuple):
    """Frames of one run, or of several."""

    bursts: int
    """Of the followed source's bursts."""
    right: int
    """Of these, with a right place."""
    located: int
    """With any place, in all of the run."""
    astray: int
    """Of these, near the bearing of another source and not of the followed one."""
    off: int
    """Of these, neither right nor near another source's bearing."""


def draw_layout(seed: int, sound: str, count: int, level_db: float) -> Layout:
    """A random layout.

    Args:
        seed: Of the draw, and of the run.
        sound: Of the others: a line of ``SOUNDS``, filled in.
        count: How many others.
        level_db: Of all of them together, over the followed source.
    """
    rng = np.random.default_rng(seed)
    bearing = math.radians(rng.uniform(-50.0, 50.0))
    distance = rng.uniform(1.6, 2.4)
    leaves = bearing + rng.uniform(-0.5, 0.5)
    turns = leaves + rng.choice([-1.0, 1.0]) * rng.uniform(0.8, 1.6)
    legs = [_along(distance, bearing)]
    legs += [_along(rng.uniform(1.5, 2.5), angle) for angle in (leaves, turns)]
    way = np.cumsum(legs, axis=0)
    share = np.linspace(0.0, 1.0, 20)[:, np.newaxis]
    corners = [np.zeros(2), *way]
    passed = np.vstack([a + share * (b - a) for a, b in pairwise(corners)])
    others, settings = np.empty((count, 2)), []
    for k in range(count):
        others[k] = passed[0]
        while np.linalg.norm(passed - others[k], axis=1).min() < CLEAR_M:
            beside = rng.choice([-1.0, 1.0]) * math.radians(rng.uniform(30.0, 120.0))
            others[k] = _along(rng.uniform(1.5, 3.5), bearing + beside)
        louder = 10.0 ** (level_db / 20.0) / math.sqrt(count)
        pressure = 0.05 * louder * np.linalg.norm(others[k]) / distance
        settings += [
            f"sources.other_{k}.waypoints_m=[{others[k].tolist()}]",
            f"sources.other_{k}.body=false",
            f"sources.other_{k}.sound={{{sound}, level_pa: {pressure:.6f}}}",
        ]
    told = math.degrees(bearing) + FIRST_BEARING_STD_DEG * rng.standard_normal()
    followed = ["follows=followed", f"sources.followed.waypoints_m={way.tolist()}"]
    run = ["obstacles=[]", f"duration_s={DURATION_S}", "arena_m=[30,30]"]
    return Layout([*run, f"seed={seed}", *followed, *settings], told, others)


def _along(distance: float, angle: float) -> NDArray[np.float64]:
    return distance * np.array([math.cos(angle), math.sin(angle)])


def score_of(result: RunResult, others: NDArray[np.float64]) -> Score:
    """How a run's estimates compare with where the sources are.

    Args:
        result: Of a run of ``draw_layout``.
        others: (k, 2) places of the other sources in W, m.
    """
    columns, scenario = result.columns, result.scenario
    heading = columns["theta_WB"]
    cosine, sine = np.cos(heading), np.sin(heading)
    x_P = columns["p_WB_x"] + scenario.only.robot.control_point_m * cosine
    y_P = columns["p_WB_y"] + scenario.only.robot.control_point_m * sine

    def seen(x: Any, y: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bearing, in the half plane ahead, and range from P, amid the microphones."""
        dx, dy = x - x_P, y - y_P
        ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
        return np.arctan2(left, np.abs(ahead)), np.hypot(dx, dy)

    heard = columns["detected"] > 0.5
    x, y = columns["p_PS_B_x"], columns["p_PS_B_y"]
    bearing, distance = seen(columns["p_WS_x"], columns["p_WS_y"])
    limit = math.radians(BEARING_DEG)
    near = np.abs(np.arctan2(y, x) - bearing) < limit
    ranged = columns["range_valid"] > 0.5
    miss = np.abs(np.hypot(x, y) / distance - 1.0)
    right = heard & near & (~ranged | (miss < RANGE_SHARE))
    beside = np.zeros_like(heard)
    for place in others:
        beside |= np.abs(np.arctan2(y, x) - seen(*place)[0]) < limit
    astray = heard & ~near & beside
    bursts = scenario.source.sound.sounds(
        result.time - 0.5 * scenario.follower.microphones.frame_s
    )
    frames = bursts, right & bursts, heard, astray, heard & ~right & ~astray
    return Score(*(int(np.count_nonzero(each)) for each in frames))


def table_rows(
    layouts: int, file: str, room: list[str], found: dict[tuple[Any, ...], Any]
) -> Iterator[Sequence[object]]:
    """A line a row of ``ROWS`` and way to choose.

    Args:
        layouts: How many a row.
        file: Of speech.
        room: Settings of the room, for all.
        found: Of each row and way to choose it gets the score of all frames, and the
            share of layouts that were followed.
    """
    for name, count, level in ROWS:
        sound = SOUNDS[name].format(file=file)
        drawn = [draw_layout(seed, sound, count, level) for seed in range(layouts)]
        for choose in ("loudest", "followed"):
            scores, causes, errors = [], [], []
            for layout in drawn:
                chosen = [f"tdoa.choose={choose}"]
                if choose == "followed":
                    chosen += [f"tdoa.first_bearing_deg={layout.first_bearing_deg:.1f}"]
                settings = [*layout.settings, *chosen, *room]
                scenario = load_scenario("default", settings)
                result = simulate(scenario, engine="compiled")
                scores.append(score_of(result, layout.others))
                causes.append(result.cause)
                errors.append(
                    float(np.median(np.abs(MeasuredRun(result).following_error)))
                )
            total = Score(*np.sum(scores, axis=0).tolist())
            share = causes.count("completed") / layouts
            found[name, count, level, choose] = total, share
            yield (
                name,
                count,
                f"{level:+.0f} dB",
                choose,
                f"{total.right / total.bursts:.3f}",
                f"{total.astray / max(total.located, 1):.4f}",
                f"{total.off / max(total.located, 1):.4f}",
                f"{causes.count('completed')} of {layouts}",
                f"{np.median(errors):.2f} m",
            )


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--layouts", type=int, default=8, help="a row")
    parser.add_argument("--room", action="store_true", help="that reverberates, 0.3 s")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table and its bounds."""
    found: dict[tuple[Any, ...], Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "speech.wav"
        speech = speech_like(np.random.default_rng(0), 10.0, SPEECH_RATE_HZ)
        soundfile.write(file, 0.9 * speech / np.abs(speech).max(), SPEECH_RATE_HZ)
        room = ROOM if options.room else []
        rows = table_rows(options.layouts, str(file), room, found)
        yield Table("one source among others", HEADINGS, rows)
    score, share = found["continuous noise", 1, 0.0, "followed"]
    astray = score.astray / score.located
    yield from bounds_table(
        [
            Figure("continuous noise, 0 dB: followed", share, ">=", 0.9),
            Figure("pointing to another source", astray, "<=", 0.02),
        ]
    )
