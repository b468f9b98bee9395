"""Tries to make a guarded robot hit obstacles at rest, at random and by a search.

Runs of 10 s by compiled loops: layouts and drivers of ``driver_trials``, then SciPy's
differential evolution over places of posts and commands, which lessens the clearance
of the disc that holds the body.
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
    BUBBLE_M,
    USUAL,
    Trial,
    draw_trial,
    make_trial,
    run_trial,
)
from analysis.safety.job_pool import run_jobs

#: Runs that a worker gets at once; a multiple shares one setting of the robot.
_CHUNK = 50
#: Chunks that a worker does.
_CHUNKS_A_WORKER = 200
#: Of the search: posts, commands held, and members of a generation for each number.
_POSTS, _COMMANDS, _MEMBERS = 3, 4, 4


class Found(NamedTuple):
    """What a run came to."""

    number: int
    """Of the trial; of a search that of its seed."""
    kinds: tuple[str, str, str]
    """Names of layout, driver and setting."""
    collided: bool
    clearance_m: float
    """Least one of the body."""
    disc_m: float
    """Least one of the disc that holds the body."""


def by_chance(
    seed: int, numbers: Iterable[int], drivers: Sequence[str] = USUAL
) -> list[Found]:
    """Runs trials drawn by chance.

    Args:
        seed: Seed of all trials.
        numbers: Of these.
        drivers: As of ``draw_trial``.

    Returns:
        What each came to.
    """
    found = []
    for number in numbers:
        trial = draw_trial(seed, number, drivers)
        kinds = trial.layout, trial.driver, trial.variant
        found.append(Found(number, kinds, *run_trial(trial)))
    return found


def searched_trial(x: NDArray[np.float64]) -> Trial:
    """The trial that a point of the search stands for.

    Args:
        x: Heading, rad; of each post its direction, rad, and distance, m; of each
            command its duration, s, forward speed, m/s, and yaw rate, rad/s.

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
    """Differential evolution towards the least clearance of the disc.

    Args:
        runs: About how many runs it may take.
        seed: Seed of the search.

    Returns:
        What each run came to.
    """
    bounds = [(-math.pi, math.pi)]
    bounds += [(-math.pi, math.pi), (BUBBLE_M + 0.012, 2.5)] * _POSTS
    bounds += [(0.5, 5.0), (-0.72, 0.72), (-3.0, 3.0)] * _COMMANDS
    found: list[Found] = []

    def clearance(x: NDArray[np.float64]) -> float:
        trial = searched_trial(x)
        kinds = trial.layout, trial.driver, trial.variant
        found.append(Found(seed, kinds, *run_trial(trial)))
        # Where nothing was near, anything is better.
        return min(found[-1].disc_m, 10.0)

    generations = max(1, runs // (_MEMBERS * len(bounds)) - 1)
    differential_evolution(
        clearance, bounds, maxiter=generations, popsize=_MEMBERS, rng=seed,
        polish=False, tol=0.0,
    )  # fmt: skip
    return found


def largest_rate(collisions: int, runs: int) -> float:
    """Upper end of the 95 % interval of a rate.

    Args:
        collisions: How often it happened.
        runs: Of how many.

    Returns:
        Three in so many runs where it never did, else Wilson's.
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
    """Trials by chance, then a search in each worker process.

    Args:
        runs: Trials by chance.
        search: About how many runs the searches may take together.
        seed: Seed of all random numbers.
        workers: Number of processes.
        drivers: As of ``draw_trial``.
        progress: Called with the number of runs that are done.

    Returns:
        What each run came to.
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
