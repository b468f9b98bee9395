"""Tries to make a guarded robot hit obstacles at rest, by random trials and by search.

Runs last 10 s and use the compiled engine. Random trials draw layouts and drivers of
``driver_trials``. The search is SciPy's differential evolution over the positions of
posts and the commands. The search minimizes the clearance of the disc that encloses the
body.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from analysis.safety.driver_trials import (
    USUAL,
    Trial,
    draw_trial,
    make_trial,
    run_trial,
)
from analysis.safety.job_pool import run_jobs
from systems.safety.parameters import START_BUBBLE_M

# Number of trials per job. A multiple of this has the same setting of the robot.
_CHUNK = 50
# Number of jobs after which a worker process is replaced.
_CHUNKS_A_WORKER = 200
# The search: number of posts, number of commands, and members of a generation per
# searched number.
_POSTS, _COMMANDS, _MEMBERS = 3, 4, 4


class Found(NamedTuple):
    """Result of a run."""

    number: int
    """Number of a random trial, or seed of the search."""
    kinds: tuple[str, str, str]
    """Names of layout, driver and setting."""
    collided: bool
    clearance_m: float
    """Least clearance of the body, m."""
    disc_m: float
    """Least clearance of the disc that encloses the body, m."""


def by_chance(
    seed: int, numbers: Iterable[int], drivers: Sequence[str] = USUAL
) -> list[Found]:
    """Runs random trials.

    Args:
        seed: Seed of all trials.
        numbers: Numbers of the trials to run.
        drivers: Names of drivers, as for ``draw_trial``.

    Returns:
        One result per trial.
    """
    found = []
    for number in numbers:
        trial = draw_trial(seed, number, drivers)
        kinds = trial.layout, trial.driver, trial.variant
        found.append(Found(number, kinds, *run_trial(trial)))
    return found


def searched_trial(x: NDArray[np.float64]) -> Trial:
    """Converts a point of the search space to a trial.

    Args:
        x: Numbers in this order: the heading, rad; for each post, direction, rad, and
            distance, m; for each command, duration, s, forward speed, m/s, and yaw
            rate, rad/s.

    Returns:
        The trial.
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

    The search minimizes the clearance of the disc that encloses the robot's body.

    Args:
        runs: Approximate number of runs.
        seed: Seed of the search.

    Returns:
        One result per run.
    """
    bounds = [(-math.pi, math.pi)]
    bounds += [(-math.pi, math.pi), (START_BUBBLE_M + 0.012, 2.5)] * _POSTS
    bounds += [(0.5, 5.0), (-0.72, 0.72), (-3.0, 3.0)] * _COMMANDS
    found: list[Found] = []

    def clearance(x: NDArray[np.float64]) -> float:
        trial = searched_trial(x)
        kinds = trial.layout, trial.driver, trial.variant
        found.append(Found(seed, kinds, *run_trial(trial)))
        # If no body was near, the clearance is infinite.
        return min(found[-1].disc_m, 10.0)

    generations = max(1, runs // (_MEMBERS * len(bounds)) - 1)
    differential_evolution(
        clearance, bounds, maxiter=generations, popsize=_MEMBERS, rng=seed,
        polish=False, tol=0.0,
    )  # fmt: skip
    return found


def largest_rate(collisions: int, runs: int) -> float:
    """Computes the upper end of the 95 % interval of a collision rate.

    Args:
        collisions: Number of collisions.
        runs: Number of runs.

    Returns:
        The rate. Without collisions, about three divided by ``runs``. With collisions,
        the upper end of Wilson's interval.
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

    Args:
        runs: Number of random trials.
        search: Approximate total number of runs of the searches.
        seed: Seed of all random numbers.
        workers: Number of processes.
        drivers: Names of drivers, as for ``draw_trial``.
        progress: Called with the number of finished runs.

    Returns:
        One result per run.
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
