"""How searches by smell and by ear end, and how well bearings are heard.

``python -m studies searches odor|bearings|sound|mission [RUNS]`` prints a table of
docs/searches.md; 300, 100, 200 and 100 starts unless told. Compiled runs, on all
processors: 2 to 15 minutes each.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from os import cpu_count
from typing import Any

import numpy as np
import pandas as pd

from analysis.batches.comparison_plans import library_layouts
from analysis.report.intervals import Estimate, estimate_rate
from analysis.runs.metric_table import ARMS_M
from studies.support.bearing_trials import FAN_M, BearingTrial, hear_once
from studies.support.listening_methods import (
    PlaneEstimator,
    PlaneListener,
    PrintedEstimator,
    PrintedListener,
)
from studies.support.search_outcomes import (
    SEED as SEED,
    SearchOutcomes,
    search_outcomes,
    search_runs,
)
from studies.tables import Table
from systems.sound.parameters import RoomParameters, SoundParameters

_SONG = {"search.rules": "song2011", "search.gate": False}
_NARROW = {"wind.meander_intensity": 0.25}
_SECTOR = {
    "start.position_m": {
        "sector": {
            "about_m": [-0.7, 0.0],
            "range_m": [0.8, 2.0],
            "bearing_deg": [-45.0, 45.0],
        }
    }
}
_ANY_HEADING = {"start.heading_deg": {"uniform": [-180.0, 180.0]}}
_JET = {"wind.kind": "jet", "wind.jet_diameter_m": 0.5}
_Changes = Mapping[str, Any]

#: What each row of the table of smell is, what is set, and what is drawn.
ODOR_ROWS: Sequence[tuple[str, _Changes, _Changes]] = (
    ("`song2011`, k U = 3", _SONG, {}),
    (
        "`song2011`, k U = 1.2, as narrated",
        {**_SONG, "airflow_sensors.gain_s_m": 1.2},
        {},
    ),
    ("`song2011`, k U = 3, with the gate", {"search.rules": "song2011"}, {}),
    ("`song2011`, U = 0.5 m/s", {**_SONG, "wind.speed_m_s": 0.5}, {}),
    ("`song2011`, U = 1.5 m/s", {**_SONG, "wind.speed_m_s": 1.5}, {}),
    ("`song2011`, crosswind wires", {**_SONG, "airflow_sensors.lobe": "crosswind"}, {}),
    ("`song2011`, sector +-45 deg", _SONG, _SECTOR),
    ("`song2011`, wait 2 s", {**_SONG, "search.wait_s": 2.0}, {}),
    ("`upwind_gradient`", {}, {}),
    ("U = 0.5 m/s", {"wind.speed_m_s": 0.5}, {}),
    ("U = 1.5 m/s", {"wind.speed_m_s": 1.5}, {}),
    ("k U = 1.2", {"airflow_sensors.gain_s_m": 1.2}, {}),
    ("crosswind wires", {"airflow_sensors.lobe": "crosswind"}, {}),
    ("any heading", {}, _ANY_HEADING),
    ("sector +-45 deg", {}, _SECTOR),
    ("meander 0.25", _NARROW, {}),
    ("a fan's jet", _JET, {}),
    ("steady plume", {"odor.kind": "steady"}, {}),
    ("GADEN's time constants", {"gas_sensors.preset": "tgs2620"}, {}),
    ("wait 2 s", {"search.wait_s": 2.0}, {}),
    (
        "sealed 37.5 m^3, 10 min old",
        {"odor.room_volume_m3": 37.5, "odor.age_s": 600.0},
        {},
    ),
    (
        "sealed 37.5 m^3, 30 min old",
        {"odor.room_volume_m3": 37.5, "odor.age_s": 1800.0},
        {},
    ),
    ("without the gate", {"search.gate": False}, {}),
)


def _percent(share: Estimate) -> str:
    value, low, high = (100.0 * each for each in (share.value, *share.ends))
    return f"{value:.1f} ({low:.1f} to {high:.1f})"


def _row(name: str, outcome: SearchOutcomes) -> list[str]:
    ends = ", ".join(f"{cause} {count}" for cause, count in outcome.causes.items())
    steps, time = outcome.median_steps, outcome.median_time_s
    efficiency = outcome.median_efficiency
    return [
        name,
        _percent(outcome.share),
        _percent(outcome.found_share),
        "-" if steps is None else f"{steps:.0f}",
        "-" if time is None else f"{time:.0f}",
        "-" if efficiency is None else f"{efficiency:.2f}",
        ends or "-",
    ]


_HEAD = [
    "starts",
    "found in 10 steps, %",
    "found, %",
    "steps",
    "time, s",
    "efficiency",
    "others, of all",
]


def odor_table(runs: int = 300) -> Table:
    """Searches by smell.

    Args:
        runs: Starts a row.

    Returns:
        A row a condition, shares with 95 % intervals of Wilson, medians of finds.
    """
    layouts = library_layouts()["odor_search"]
    rows = []
    for name, settings, draw in ODOR_ROWS:
        table = search_runs(layouts, runs, settings, draw=draw)
        rows.append(_row(name, search_outcomes(table)))
    return Table("odor", _HEAD, rows)


#: Rooms and stops of the table of searches by ear.
SOUND_ROWS: Sequence[tuple[str, _Changes]] = (
    ("free field", {"room": None}),
    ("T60 0.25 s", {}),
    ("T60 0.4 s", {"room.reverberation_time_s": 0.4}),
    ("T60 0.25 s, noise", {"sound.kind": "band_noise"}),
    (
        "T60 0.25 s, `gcc_plane`",
        {"blocks": [f"{PlaneEstimator.__module__}:PlaneEstimator"]},
    ),
    (
        "T60 0.25 s, `gcc_si`, as printed",
        {"blocks": [f"{PrintedEstimator.__module__}:PrintedEstimator"]},
    ),
    (
        "T60 0.25 s, stop by radio at 0.2 m, as printed",
        {"sound_search.stop": "radio", "sound_search.radio_stop_m": 0.2},
    ),
)


def sound_table(runs: int = 200) -> Table:
    """Searches by ear.

    Args:
        runs: Starts a row.

    Returns:
        As ``odor_table``, and how often the arms can have touched.
    """
    layouts = library_layouts()["sound_search"]
    rows = []
    for name, settings in SOUND_ROWS:
        table = search_runs(layouts, runs, settings)
        rows.append([*_row(name, search_outcomes(table)), _arms(table, "")])
    return Table("sound", [*_HEAD, "arms touched, %"], rows)


def _arms(table: pd.DataFrame, prefix: str) -> str:
    near = table[f"{prefix}minimum_distance_m"] < ARMS_M
    count, runs = int(near.sum()), len(table)
    return _percent(estimate_rate(count, runs))


def mission_table(runs: int = 100) -> Table:
    """Whole missions.

    Args:
        runs: Starts a row.

    Returns:
        All three robots, and each alone.
    """
    layouts = library_layouts()["odor_then_sound"]
    rows = []
    for name, settings in (("T60 0.25 s", {}), ("free field", {"room": None})):
        table = search_runs(layouts, runs, settings)
        robots = ("finder", "first", "second")
        outcome = search_outcomes(table, robots)
        rows.append(_row(f"{name}: all three", outcome))
        for robot in robots:
            own = search_outcomes(table, (robot,))
            rows.append(_row(f"{name}: {robot}", own))
    return Table("mission", _HEAD, rows)


def _trial(task: tuple[BearingTrial, dict[str, Any]]) -> tuple[float, bool]:
    """Error, deg, infinite where nothing is heard; and whether it is ambiguous."""
    trial, how = task
    heard = hear_once(trial, **how)
    if heard is None:
        return math.inf, False
    off = math.degrees(math.remainder(heard.bearing - trial.bearing, math.tau))
    return abs(off), heard.ambiguous


def _trials(count: int, seed: int, **changes: Any) -> list[BearingTrial]:
    """Stops in the arena, 0.4 to 2.5 m from a sound that is in it, too."""
    generator = np.random.default_rng(seed)
    trials: list[BearingTrial] = []
    while len(trials) < count:
        x, y = generator.uniform((-2.2, -1.2), (2.2, 1.2))
        distance = float(generator.choice([0.4, 1.0, 1.75, 2.5]))
        bearing = float(generator.uniform(-math.pi, math.pi))
        u, v = x + distance * math.cos(bearing), y + distance * math.sin(bearing)
        fan = {}
        if "fan_snr_db" in changes:
            fan["fan_bearing"] = float(generator.uniform(-math.pi, math.pi))
            angle = fan["fan_bearing"]
            a, b = x + FAN_M * math.cos(angle), y + FAN_M * math.sin(angle)
            if changes.get("room") and (abs(a) > 2.5 or abs(b) > 1.5):
                continue
        if abs(u) < 2.4 and abs(v) < 1.4:
            own = {**changes, **fan}
            place = float(x), float(y)
            number = seed + len(trials)
            sound = own.pop("sound")
            trials.append(BearingTrial(sound, distance, bearing, number, place, **own))
    return trials


def _room(time_s: float) -> RoomParameters | None:
    if time_s == 0.0:
        return None
    return RoomParameters(
        size_m=(5.2, 3.2, 2.7), corner_m=(-2.6, -1.6), reverberation_time_s=time_s
    )


def bearings_table(count: int = 100) -> Table:
    """Bearings of single stops.

    Args:
        count: Stops a cell.

    Returns:
        Share within 10 deg by method, and how many are called ambiguous.
    """
    on: dict[str, Any] = {"on_s": 1.0, "period_s": 1.0}
    siren = SoundParameters(kind="siren", **on)
    noise = SoundParameters(kind="band_noise", **on)
    tone = SoundParameters(kind="tone", tone_hz=2700.0, **on)
    rows: list[tuple[str, dict[str, Any]]] = [
        (f"{name}, T60 {time} s", {"sound": sound, "room": _room(time)})
        for name, sound in (("siren", siren), ("noise", noise))
        for time in (0.0, 0.25, 0.4, 0.6)
    ]
    rows += [
        (f"siren, fan at {snr:g} dB", {"sound": siren, "fan_snr_db": snr})
        for snr in (0.0, -5.0, -10.0)
    ]
    rows += [
        (
            f"{name}, fan at -5 dB, T60 0.25 s",
            {"sound": sound, "fan_snr_db": -5.0, "room": _room(0.25)},
        )
        for name, sound in (("siren", siren), ("noise", noise))
    ]
    rows.append(("steady tone of 2.7 kHz", {"sound": tone}))
    methods: list[tuple[str, dict[str, Any]]] = [
        ("`srp_near`", {}),
        ("without subtraction", {"subtract": False}),
        ("`gcc_plane`", {"method": PlaneListener}),
        ("`gcc_si`, as printed", {"method": PrintedListener}),
    ]
    text = []
    context = get_context("forkserver")
    with ProcessPoolExecutor(cpu_count(), mp_context=context) as pool:
        for name, changes in rows:
            trials = _trials(count, SEED, **changes)
            cells, ambiguous = [], 0
            for number, (_, how) in enumerate(methods):
                tasks = [(trial, how) for trial in trials]
                found = list(pool.map(_trial, tasks, chunksize=4))
                good = sum(off <= 10.0 for off, _ in found)
                cells.append(_percent(estimate_rate(good, count)))
                if number == 0:
                    ambiguous = sum(each for _, each in found)
            text.append([name, *cells, f"{100.0 * ambiguous / count:.0f}"])
    head = ["sound", *(name for name, _ in methods), "ambiguous, %"]
    return Table("bearings", head, text)


_TABLES: Mapping[str, Callable[..., Table]] = {
    "odor": odor_table,
    "bearings": bearings_table,
    "sound": sound_table,
    "mission": mission_table,
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("table", choices=_TABLES)
    parser.add_argument("runs", nargs="?", type=int)


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table that is asked for."""
    runs = [] if options.runs is None else [options.runs]
    yield _TABLES[options.table](*runs)
