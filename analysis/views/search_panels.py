"""Draws the panels of a search in the picture over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes

from analysis.reporting.palette import COLOURS
from diagrams import RunResult
from diagrams.running.stop_rules import ODOR_WITHIN_M
from diagrams.scenario.participants import OdorSearcher
from systems.search.song_rules import AIRFLOW_THRESHOLD

#: Names of the phases of each kind of search. The index is the number of the phase.
_PHASES = {
    "song2011": ("", "1 initial", "2 upwind", "3 gradient", "4 local"),
    "upwind_gradient": ("", "upwind", "across"),
    "sound": ("", "waits", "holds", "listens", "computes", "moves", "over"),
}


def search_panels(result: RunResult) -> list[Callable[[Axes, RunResult], None]]:
    """Returns the panels that show what a searching robot sensed and did.

    Args:
        result: Result of a run, for one robot that searches.

    Returns:
        Functions that draw one panel each. Their arguments are the axes and the result.
    """
    if result.scenario.only.searches == "odor":
        return [_distance, _gas, _airflow, _heading, _phase]
    return [_distance, _bearing, _level, _heading, _phase]


def call_time(result: RunResult) -> float | None:
    """Returns the time at which the sink first received a call.

    The sink is the computer of the operator. After a robot has found the odor source,
    it calls the other robots. The function uses the radio frame with which a robot
    reports this find to the sink.

    Args:
        result: Result of a run, for one robot or all robots.

    Returns:
        Time, s. The value is None if the sink received no such frame.
    """
    times = [
        float(result.time[np.argmax(values > 0.5)])
        for name, values in result.world.items()
        if name.endswith(".result") and (values > 0.5).any()
    ]
    return min(times, default=None)


def _distance(axes: Axes, result: RunResult) -> None:
    columns, stop = result.columns, result.scenario.stop
    smells = result.scenario.only.searches == "odor"
    away = np.hypot(*(result.vector("p_WB") - result.vector("p_WS")))
    axes.plot(result.time, away, color=COLOURS["source"], label="true")
    if "source_range" in columns:
        heard = columns["source_range"]
        axes.plot(
            result.time, heard, ".", ms=3, color=COLOURS["estimate"], label="heard"
        )
    found = ODOR_WITHIN_M if smells else stop.sound_within_m
    axes.axhline(found, color="black", ls="--", lw=1.0, label="found within")
    axes.set_ylabel("range of\nsource (m)")
    axes.set_ylim(0.0, 1.1 * max(found, float(np.max(away))))


def _curves(
    axes: Axes, result: RunResult, curves: Sequence[tuple[str, str, str]], width: float
) -> None:
    """Draws columns with labels and colors, with gaps where angles wrap."""
    for name, label, colour in curves:
        values = result.columns[name].copy()
        values[1:][np.abs(np.diff(values)) > 180.0] = np.nan
        axes.plot(result.time, values, color=COLOURS[colour], lw=width, label=label)


def _gas(axes: Axes, result: RunResult) -> None:
    sides = (
        ("gas_left", "R3, left", "left"),
        ("gas_right", "R1, right", "right"),
        ("gas_rear", "R2, rear", "empty"),
    )
    _curves(axes, result, sides, 0.9)
    axes.set_ylabel("gas, Rs/R0")


def _airflow(axes: Axes, result: RunResult) -> None:
    sides = (
        ("airflow_left", "F1, left", "left"),
        ("airflow_right", "F2, right", "right"),
    )
    _curves(axes, result, sides, 0.7)
    searcher = result.scenario.searcher
    assert isinstance(searcher, OdorSearcher)
    if searcher.search.rules == "song2011":
        axes.axhline(
            AIRFLOW_THRESHOLD, color="black", ls="--", lw=1.0, label="threshold"
        )
    axes.set_ylabel("airflow")
    axes.set_ylim(bottom=0.0)


def _bearing(axes: Axes, result: RunResult) -> None:
    columns = result.columns
    true = np.degrees(columns["source_bearing_true"])
    true[1:][np.abs(np.diff(true)) > 180.0] = np.nan
    axes.plot(result.time, true, color=COLOURS["source"], label="true")
    heard = np.degrees(columns["source_bearing"])
    axes.plot(result.time, heard, ".", ms=3, color=COLOURS["estimate"], label="heard")
    axes.set_ylabel("bearing of\nsource (deg)")


def _level(axes: Axes, result: RunResult) -> None:
    level = result.columns["rssi_dbm"]
    axes.plot(result.time, level, color=COLOURS["empty"], lw=0.6, label="radio")
    axes.set_ylabel("level (dBm)")


def _heading(axes: Axes, result: RunResult) -> None:
    _curves(axes, result, (("expected_heading_deg", "expected", "source"),), 1.4)
    _curves(axes, result, (("heading_deg", "compass", "robot"),), 0.7)
    axes.set_ylabel("heading\n(deg from north)")


def _phase(axes: Axes, result: RunResult) -> None:
    searcher = result.scenario.searcher
    rules = searcher.search.rules if isinstance(searcher, OdorSearcher) else "sound"
    names = _PHASES[rules]
    phase = result.columns["search_phase"]
    axes.plot(result.time, phase, color=COLOURS["robot"], lw=1.2, label="phase")
    shades = [("moves", result.columns["move"] > 0.5, "seen", 0.2)]
    if "listening" in result.columns:
        shades.append(("listens", result.columns["listening"] > 1.5, "echo", 0.3))
    top = len(names) - 0.5
    for label, where, colour, alpha in shades:
        axes.fill_between(
            result.time,
            0.5,
            top,
            where=where.tolist(),
            color=COLOURS[colour],
            alpha=alpha,
            label=label,
            lw=0.0,
        )
    axes.set_yticks(range(1, len(names)), names[1:])
    axes.set_ylim(0.5, len(names) - 0.5)
