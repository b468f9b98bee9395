"""Long runs in which drivers try to make a robot with a guard collide.

A driver is a program that commands the robot. A setting is a set of changes of the
robot's parameters. A run lasts from minutes to an hour. ``jobs`` lists all runs.
``phonotaxis falsify --long`` runs them and prints the results.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from analysis.report.markdown import markdown_table
from analysis.report.provenance import SCHEMA_VERSION, versions
from analysis.safety.driver_trials import (
    DRIVERS,
    LAYOUTS,
    SETTINGS,
    Trial,
    draw_trial,
    least_clearance,
    run_result,
)
from analysis.safety.swinging_drivers import (
    BY_HAND,
    Swing,
    draw_swing,
    four_boxes,
    odometry_error,
    search_contact,
    search_drift,
    swing_at_boxes,
    swing_once,
)
from diagrams import RunResult
from systems.framework.input_error import InputError

#: Boxes in the runs with the swing that was found by hand, at several frequencies, and
#: in the runs with the swing that the search for drift found.
FOUR_BOXES = four_boxes(1.63)
#: Settings that get the most simulated time.
_MAIN = "plain", "encoders not rounded", "cells of 2 cm", "tick of 50 ms"
#: Frequencies with which the swing that was found by hand is repeated, Hz.
_FREQUENCIES_HZ = 0.1, 0.3, 1.0, 2.0, 3.18, 5.0, 10.0
_HOUR_S = 3600.0
#: Number of runs of each search.
_DRIFT_RUNS = _CONTACT_RUNS = 96
#: Number of jobs after which a worker process is replaced.
JOBS_A_WORKER = 30
#: Settings for which a search for a contact runs.
_SEARCHED = "plain", "tick of 50 ms"


class LongRun(NamedTuple):
    """Result of a long run."""

    driver: str
    """Name of the driver."""
    setting: str
    """Name of the robot's setting."""
    simulated_s: float
    """Simulated time, s."""
    contact_s: float
    """Time of the contact, s; infinite if there was none."""
    clearance_m: float
    """Least clearance of the body, m."""
    odometry_m: float
    """Largest position error of the odometry at the axle, m."""
    swing: Swing | None
    """Swing of the driver; None if the driver does not swing."""


Job = partial[list[LongRun]]


class Journal:
    """File that receives the runs of each job as soon as the job is done.

    Each line of the file at ``path`` is a JSON object with the seed, the number of a
    job, and the runs of this job. The file need not exist. ``done`` has the runs that
    are in the file from earlier, by number of the job. It contains only jobs with the
    given ``seed``. Raises ``InputError`` if a line of the file does not describe a job.
    """

    def __init__(self, path: Path, seed: int) -> None:
        self._path, self._seed = path, seed
        self.done: dict[int, list[LongRun]] = {}
        lines = path.read_text("utf-8").splitlines() if path.exists() else []
        for number, line in enumerate(lines, 1):
            try:
                kept = json.loads(line)
                runs = [_run_of(each) for each in kept["runs"]]
                if kept["seed"] == seed:
                    self.done[kept["job"]] = runs
            except (json.JSONDecodeError, KeyError, TypeError):
                raise InputError(
                    "journal", f"line {number} of {path} is no job; remove the line"
                ) from None

    def keeping(self, number: int, job: Job) -> Job:
        """Returns a job that does the given job, and appends its runs to the file.

        The returned job can run in any process.
        """
        return partial(_keep, self._path, self._seed, number, job)


def _keep(path: Path, seed: int, number: int, job: Job) -> list[LongRun]:
    runs = job()
    kept = [_fields(run) for run in runs]
    # Several processes share the file. A single write in append mode is safe.
    line = json.dumps({"seed": seed, "job": number, "runs": kept})
    with path.open("a", encoding="utf-8") as file:
        file.write(f"{line}\n")
    return runs


def _fields(run: LongRun) -> dict[str, Any]:
    return {**run._asdict(), "swing": run.swing and run.swing._asdict()}


def _run_of(kept: dict[str, Any]) -> LongRun:
    swing = kept["swing"] and Swing(**kept["swing"])
    return LongRun(**{**kept, "swing": swing})


def long_run(trial: Trial, swing: Swing | None = None) -> LongRun:
    """Runs a trial. ``swing`` is the swing of its driver, for the result."""
    return _judged(trial.driver, trial.variant, swing, run_result(trial))


def _judged(
    driver: str, setting: str, swing: Swing | None, result: RunResult
) -> LongRun:
    end_s, clearance_m = result.simulated_s, least_clearance(result)
    contact_s = end_s if result.collision else np.inf
    drift_m = float(odometry_error(result).max())
    return LongRun(driver, setting, end_s, contact_s, clearance_m, drift_m, swing)


def jobs(seed: int) -> list[Job]:
    """Lists the jobs of ``phonotaxis falsify --long``, roughly the longest first.

    Each job returns the results of one or more runs.
    """
    found: list[Job] = []
    slow_first = sorted(SETTINGS, key="cells of 2 cm".__ne__)
    found += [partial(_by_search_for_contact, each, seed) for each in _SEARCHED]
    for setting in slow_first:
        if setting in _MAIN:
            found += [partial(_by_hand, setting, hz) for hz in _FREQUENCIES_HZ]
        found.append(partial(_by_search_for_drift, setting, seed))
        found.append(partial(_drawn_swings, setting, seed))
        found.append(partial(_drawn_commands, setting, seed))
    found += [partial(_once, each) for each in _MAIN]
    return found


def _once(setting: str) -> list[LongRun]:
    return [long_run(swing_once(setting), BY_HAND)]


def _by_hand(setting: str, hz: float) -> list[LongRun]:
    swing = BY_HAND._replace(hz=hz)
    names = "four boxes", "swing, by hand, 0.1 to 10 Hz", setting
    return [long_run(swing_at_boxes(names, FOUR_BOXES, swing, _HOUR_S), swing)]


def _by_search_for_drift(setting: str, seed: int) -> list[LongRun]:
    swing, _ = search_drift(setting, _DRIFT_RUNS, seed)
    names, swing_s = ("four boxes", "swing, searched for drift", setting), 40.0
    trial = swing_at_boxes(names, FOUR_BOXES, swing, _HOUR_S, swings=2, swing_s=swing_s)
    return [long_run(trial, swing)]


def _by_search_for_contact(setting: str, seed: int) -> list[LongRun]:
    found: list[LongRun] = []

    def note(swing: Swing, result: RunResult) -> float:
        found.append(_judged("swing, searched for contact", setting, swing, result))
        return found[-1].clearance_m

    search_contact(setting, _CONTACT_RUNS, seed, note)
    return found


def _drawn_swings(setting: str, seed: int) -> list[LongRun]:
    found = []
    for number in range(3):
        place = [*SETTINGS].index(setting)
        draw = np.random.default_rng([seed, place, number])
        layout, swing = str(draw.choice([*LAYOUTS])), draw_swing(draw)
        names = layout, "swing, drawn", setting
        boxes, heading = LAYOUTS[layout](draw), draw.uniform(-np.pi, np.pi)
        trial = swing_at_boxes(names, boxes, swing, 600.0, heading=heading)
        found.append(long_run(trial, swing))
    return found


def _drawn_commands(setting: str, seed: int) -> list[LongRun]:
    number = [*SETTINGS].index(setting)
    trial = draw_trial(seed, number, [*DRIVERS], setting, 0.5 * _HOUR_S)
    return [long_run(trial._replace(driver="random, pressing or looking"))]


def summary_table(runs: Sequence[LongRun], by: Sequence[str]) -> str:
    """Summarizes runs in a Markdown table, with one row per group and one for all runs.

    The runs of a group have the same values of the fields ``by`` of ``LongRun``.
    """
    groups: dict[tuple[str, ...], list[LongRun]] = {}
    for run in runs:
        groups.setdefault(tuple(getattr(run, name) for name in by), []).append(run)
    everything = ("all", *[""] * (len(by) - 1))
    rows = [
        [*names, *_summed(group)]
        for names, group in chain(groups.items(), [(everything, [*runs])])
    ]
    head = ["runs", "simulated h", "contacts", "first contact, s"]
    head += ["clearance of body, mm", "odometry error, mm"]
    return markdown_table([*by, *head], rows)


def _summed(runs: Sequence[LongRun]) -> list[str]:
    times = [run.contact_s for run in runs]
    first, hits = min(times), np.isfinite(times).sum()
    return [
        str(len(runs)),
        f"{sum(run.simulated_s for run in runs) / 3600.0:.1f}",
        str(hits),
        f"{first:.0f}" if hits else "",
        f"{1e3 * min(run.clearance_m for run in runs):.1f}",
        f"{1e3 * max(run.odometry_m for run in runs):.1f}",
    ]


def long_summary(found: Mapping[int, Sequence[LongRun]], seed: int) -> dict[str, Any]:
    """Builds the JSON document of long runs.

    ``found`` has the runs of each job, by number of the job.
    """

    def told(job: int, run: LongRun) -> dict[str, Any]:
        contact_s = run.contact_s if math.isfinite(run.contact_s) else None
        return {"job": job, **_fields(run), "contact_s": contact_s}

    runs = [told(job, run) for job, own in found.items() for run in own]
    contacts = sum(run["contact_s"] is not None for run in runs)
    return {
        "schema_version": SCHEMA_VERSION,
        "versions": versions(),
        "seed": seed,
        "contacts": contacts,
        "runs": runs,
    }


def long_text(found: Mapping[int, Sequence[LongRun]]) -> str:
    """Formats tables of the runs by driver and by setting, and a line per contact.

    ``found`` has the runs of each job, by number of the job.
    """
    runs = [run for own in found.values() for run in own]
    by = (("driver", "setting"), ("driver",), ("setting",))
    tables = [f"{summary_table(runs, names)}\n" for names in by]
    contacts = [
        f"contact in job {job}: {run}"
        for job, own in found.items()
        for run in own
        if math.isfinite(run.contact_s)
    ]
    return "\n".join([*tables, *contacts]).rstrip()
