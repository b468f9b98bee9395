"""Tries to make the guard collide with what rests: by chance, and by a directed search.

    python -m benchmarks.falsify_guard [--runs N] [--search N] [--seed S] [--workers N]
        [--drivers NAME,...]
    python -m benchmarks.falsify_guard --seed S --only K
    python -m benchmarks.falsify_guard --cost

Runs of 10 s by compiled loops: layouts and drivers of ``guard_drivers``, then SciPy's
differential evolution over places of posts and commands, which lessens the clearance
of the disc that holds the body. Prints collisions and the least clearances of each
layout, driver and setting, and the worst run; ``--drivers`` takes others, as laws that
plan, ``--only`` runs one again, ``--cost`` prints what the guard and the guarded law
take of a tick. Exit status 1 where the robot has touched something.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import pairwise
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from benchmarks.guard_drivers import (
    BUBBLE_M,
    USUAL,
    Trial,
    draw_trial,
    make_trial,
    run_trial,
)
from diagrams import load_scenario, simulate
from diagrams.simulation import prepared_loop

__all__ = ["Found", "by_chance", "by_search", "largest_rate", "searched_trial"]

#: Runs that a worker gets at once; a multiple shares one setting of the robot.
_CHUNK = 50
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
        seed: Of all trials.
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
        seed: Of the search.

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


def _all(
    runs: int, search: int, seed: int, workers: int, drivers: Sequence[str]
) -> Iterator[list[Found]]:
    numbers = range(runs)
    edges = [*range(0, runs, _CHUNK), runs]
    chunks = [numbers[a:b] for a, b in pairwise(edges)]
    # Each setting makes blocks, which Drake never frees.
    with ProcessPoolExecutor(workers, max_tasks_per_child=200) as pool:
        yield from pool.map(partial(by_chance, seed, drivers=drivers), chunks)
        if search:
            each = [search // workers] * workers
            seeds = [seed * workers + k for k in range(workers)]
            yield from pool.map(by_search, each, seeds)


def _report(found: Sequence[Found], what: str) -> None:
    hits = sum(each.collided for each in found)
    near = min(each.clearance_m for each in found)
    disc = min(each.disc_m for each in found)
    print(
        f"{what:<24} {len(found):>7} runs, {hits} collisions (below "
        f"{100.0 * largest_rate(hits, len(found)):.2g} %), least clearance "
        f"{1e3 * near:.1f} mm, of the disc {1e3 * disc:.1f} mm"
    )


def _cost() -> None:
    """Prints the time of a tick with and without a guard, and of the guarded law."""
    for engine in ("compiled", "drake"):
        for guard in ("{}", "null"):
            fields = ["hearing=ideal", "duration_s=20", f"guard={guard}"]
            scenario = load_scenario("corridor", fields)
            runs = [simulate(scenario, engine=engine) for _ in range(3)]
            tick_s = min(run.wall_s / len(run.time) for run in runs)
            print(f"{engine}, guard {guard}: {1e6 * tick_s:.0f} us a tick")
    for name in ("clutter", "rooms", "two_moving_obstacles", "crowd"):
        for preset in ("three", "ring_12"):
            each = 1e3 * _tick_times(name, preset)
            most = np.quantile(each, 0.99)
            print(
                f"guarded law, {name}, {preset}: {each.mean():.2f} ms a tick, "
                f"99 % below {most:.1f} ms, worst {each.max():.1f} ms"
            )


def _tick_times(name: str, preset: str) -> NDArray[np.float64]:
    """(ticks,) s of a compiled run of the guarded law; of each the least of three."""
    fields = ["hearing=ideal", "law=guarded", f"ultrasonic.preset={preset}"]
    scenario, times = load_scenario(name, fields), []
    for _ in range(3):
        loop, spent = prepared_loop(scenario), []
        while not loop.over:
            start = perf_counter()
            loop.advance(1)
            spent.append(perf_counter() - start)
        times.append(spent)
    return np.min(times, axis=0)


def main() -> int:
    """Prints what was found."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=2_000)
    parser.add_argument("--search", type=int, default=0, help="runs of the search")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--drivers", default=",".join(USUAL), help="names")
    parser.add_argument("--only", type=int, help="number of one trial to run again")
    parser.add_argument("--cost", action="store_true")
    arguments = parser.parse_args()
    drivers = arguments.drivers.split(",")
    if arguments.cost:
        _cost()
        return 0
    if arguments.only is not None:
        trial = draw_trial(arguments.seed, arguments.only, drivers)
        print(trial._replace(table=trial.table.reshape(-1, 6)))
        print(run_trial(trial))
        return 0
    start, found = perf_counter(), []
    for part in _all(
        arguments.runs, arguments.search, arguments.seed, arguments.workers, drivers
    ):
        found += part
    for place, kind in enumerate(("layout", "driver", "setting")):
        print(f"by {kind}:")
        for name in sorted({each.kinds[place] for each in found}):
            _report([each for each in found if each.kinds[place] == name], name)
    _report(found, "all")
    for what, key in (("body", "clearance_m"), ("disc", "disc_m")):
        worst = min(found, key=lambda each: getattr(each, key))
        print(f"nearest of the {what}: {worst}")
    for each in (each for each in found if each.collided):
        print(f"collision: {each}")
    seconds = perf_counter() - start
    print(f"{len(found) / seconds:.0f} runs of 10 s a second")
    return int(any(each.collided for each in found))


if __name__ == "__main__":
    sys.exit(main())
