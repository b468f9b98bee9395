"""Tries to make a guarded robot hit obstacles at rest, by random trials and by search.

Runs last 10 s and use the compiled engine. A driver is a program that commands the
robot and tries to cause a collision. Random trials draw layouts and drivers from module
``driver_trials``. The search is SciPy's differential evolution over the positions of
posts and the commands of the driver. It minimizes the clearance of the
body. The results are formatted as JSON documents and as text.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from analysis.report.provenance import SCHEMA_VERSION, versions
from analysis.safety.driver_trials import (
    USUAL,
    Outcome,
    Row,
    Trial,
    draw_trial,
    make_trial,
    run_trial,
)
from analysis.safety.job_pool import run_jobs
from systems.framework.signals import TICK_S
from systems.safety.parameters import START_BUBBLE_M

# Number of trials per job. ``draw_trial`` changes the setting of the robot after a
# multiple of this number, so that all trials of a job have the same setting.
_CHUNK = 50
# Number of jobs after which a worker process is replaced.
_CHUNKS_A_WORKER = 200
# For the search: number of posts, number of commands, and size of the population per
# variable of the search.
_POSTS, _COMMANDS, _MEMBERS = 3, 4, 4

_KINDS = ("layout", "driver", "setting")


class Found(NamedTuple):
    """Result of one run."""

    number: int
    """Number of the random trial. For a run of a search: seed of the search."""
    kinds: tuple[str, str, str]
    """Names of layout, driver and setting."""
    collided: bool
    """Whether the robot touched an obstacle."""
    clearance_m: float
    """Least clearance of the body, m."""


def by_chance(
    seed: int, numbers: Iterable[int], drivers: Sequence[str] = USUAL
) -> list[Found]:
    """Runs the random trials with the given numbers."""
    found = []
    for number in numbers:
        trial = draw_trial(seed, number, drivers)
        kinds = trial.layout, trial.driver, trial.variant
        found.append(Found(number, kinds, *run_trial(trial)))
    return found


def searched_trial(x: NDArray[np.float64]) -> Trial:
    """Converts a point ``x`` of the search space to a trial.

    The elements of ``x`` are, in this order:

    - the heading at the start, rad
    - for each post: direction from the start, rad, and distance, m
    - for each command: duration, s, forward speed, m/s, and yaw rate, rad/s
    """
    posts = np.reshape(x[1 : 1 + 2 * _POSTS], (_POSTS, 2)).tolist()
    boxes = [(r * math.cos(a), r * math.sin(a), 0.0, 0.02, 0.02) for a, r in posts]
    rows, end = [], 0.0
    for duration, v, omega in np.reshape(x[1 + 2 * _POSTS :], (_COMMANDS, 3)).tolist():
        end += duration
        rows.append([end, 0.0, v, omega, 0.0, 0.0])
    names = "posts, searched", "commands, searched", "plain"
    return make_trial(names, boxes, rows, x[0], (8.0, 0.0), 1)


def by_search(runs: int, seed: int) -> list[Found]:
    """Searches by differential evolution for a run in which the robot nearly collides.

    The search takes about ``runs`` runs, and returns the results of all of them. It
    minimizes the clearance of the robot's body.
    """
    bounds = [(-math.pi, math.pi)]
    bounds += [(-math.pi, math.pi), (START_BUBBLE_M + 0.012, 2.5)] * _POSTS
    bounds += [(0.5, 5.0), (-0.72, 0.72), (-3.0, 3.0)] * _COMMANDS
    found: list[Found] = []

    def clearance(x: NDArray[np.float64]) -> float:
        trial = searched_trial(x)
        kinds = trial.layout, trial.driver, trial.variant
        found.append(Found(seed, kinds, *run_trial(trial)))
        # If no body was near, the clearance is infinite. The search needs a finite
        # value.
        return min(found[-1].clearance_m, 10.0)

    evolve(clearance, bounds, runs, seed)
    return found


def evolve(
    function: Callable[[NDArray[np.float64]], float],
    bounds: Sequence[tuple[float, float]],
    runs: int,
    seed: int,
) -> Any:
    """Minimizes a function by differential evolution, with about ``runs`` calls.

    ``bounds`` are the lower and upper limit of each variable. Returns SciPy's result.
    """
    generations = max(1, runs // (_MEMBERS * len(bounds)) - 1)
    return differential_evolution(
        function, bounds, maxiter=generations, popsize=_MEMBERS, rng=seed,
        polish=False, tol=0.0,
    )  # fmt: skip


def largest_rate(collisions: int, runs: int) -> float:
    """Computes an upper confidence limit (95 %) of the collisions per run.

    Without collisions, the one-sided limit is about 3 / ``runs``. With collisions, the
    limit is the upper end of Wilson's two-sided interval.
    """
    if collisions == 0:
        return 1.0 - 0.05 ** (1.0 / runs)
    z, p = 1.96, collisions / runs
    spread = z * math.sqrt(p * (1.0 - p) / runs + z * z / (4.0 * runs * runs))
    return (p + z * z / (2.0 * runs) + spread) / (1.0 + z * z / runs)


def falsify(
    runs: int,
    search: int,
    seed: int,
    workers: int,
    drivers: Sequence[str] = USUAL,
    *,
    progress: Callable[[float], None] | None = None,
) -> list[Found]:
    """Runs random trials, followed by one search per worker process.

    All searches together take about ``search`` runs. ``progress`` is called with the
    number of finished runs.
    """
    edges = [*range(0, runs, _CHUNK), runs]
    jobs = [partial(by_chance, seed, range(a, b), drivers) for a, b in pairwise(edges)]
    if search:
        each = search // workers
        jobs += [partial(by_search, each, seed * workers + k) for k in range(workers)]
    found: list[Found] = []
    for part in run_jobs(jobs, workers, jobs_a_worker=_CHUNKS_A_WORKER):
        found += part
        if progress is not None:
            progress(len(found))
    return found


def falsification_summary(found: Sequence[Found], seed: int) -> dict[str, Any]:
    """Builds the JSON document of the runs of ``falsify``. Clearances are in m."""
    groups = {
        kind: {
            name: _counts([each for each in found if each.kinds[place] == name])
            for name in sorted({each.kinds[place] for each in found})
        }
        for place, kind in enumerate(_KINDS)
    }
    return {
        "schema_version": SCHEMA_VERSION,
        "versions": versions(),
        "seed": seed,
        **_counts(found),
        "groups": groups,
        "nearest": min(found, key=lambda each: each.clearance_m)._asdict(),
        "collided": [each._asdict() for each in found if each.collided],
    }


def _counts(found: Sequence[Found]) -> dict[str, Any]:
    hits = sum(each.collided for each in found)
    return {
        "runs": len(found),
        "collisions": hits,
        "largest_rate": largest_rate(hits, len(found)),
        "clearance_m": min(each.clearance_m for each in found),
    }


def falsification_text(summary: dict[str, Any]) -> str:
    """Formats the document of ``falsification_summary`` for a terminal."""
    lines = []
    for kind, groups in summary["groups"].items():
        lines.append(f"by {kind}:")
        lines += [_line(name, counts) for name, counts in groups.items()]
    lines.append(_line("all", summary))
    lines.append(f"least clearance: {_run_text(summary['nearest'])}")
    lines += [f"collision: {_run_text(each)}" for each in summary["collided"]]
    return "\n".join(lines)


def _line(name: str, counts: dict[str, Any]) -> str:
    return (
        f"{name:<24} {counts['runs']:>7} runs, {counts['collisions']} collisions "
        f"(below {100.0 * counts['largest_rate']:.2g} %), least {_clearance(counts)}"
    )


def _run_text(run: dict[str, Any]) -> str:
    return f"run {run['number']} ({', '.join(run['kinds'])}), {_clearance(run)}"


def _clearance(run: dict[str, Any]) -> str:
    return f"clearance of the body {1e3 * run['clearance_m']:.1f} mm"


def trial_summary(trial: Trial, outcome: Outcome, seed: int) -> dict[str, Any]:
    """Builds the JSON document of one trial.

    Commands have the fields of ``Row``, with times in s and angular frequencies in
    rad/s.
    """
    tick_s = trial.fields.get("tick_s", TICK_S)
    rows = [Row(*row) for row in trial.table.reshape(-1, len(Row._fields)).tolist()]
    return {
        "schema_version": SCHEMA_VERSION,
        "versions": versions(),
        "seed": seed,
        "layout": trial.layout,
        "driver": trial.driver,
        "setting": trial.variant,
        "fields": trial.fields,
        "commands": [
            row._replace(end_s=row.end_s * tick_s, rate=row.rate / tick_s)._asdict()
            for row in rows
        ],
        **outcome._asdict(),
    }


def trial_text(summary: dict[str, Any]) -> str:
    """Formats the document of ``trial_summary`` for a terminal."""
    rows = [
        "  " + ", ".join(f"{name} {value:g}" for name, value in row.items())
        for row in summary["commands"]
    ]
    kinds = ", ".join(summary[kind] for kind in _KINDS)
    hit = "collision" if summary["collided"] else "no collision"
    end = f"{hit}, {_clearance(summary)}"
    return "\n".join([kinds, f"fields {summary['fields']}", "commands:", *rows, end])
