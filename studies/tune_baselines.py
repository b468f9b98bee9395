"""Looks for the settings with which baselines do best, on layouts of a seed of its own.

    python -m studies tune_baselines [LAW ...] [--points N] [--layouts N] [--seed S]
        [--workers N]

Of each law it tries its defaults and ``--points`` others, of a Sobol sequence over the
ranges below, each on the same layouts of five families. A setting's score is the share
of runs that reach the goal or go on following, less the share of those that end in a
collision, on average over the families. Prints the scores of the defaults and of the
five best.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import NamedTuple

from scipy.stats import qmc

from analysis.batches.comparison_plans import comparison_plan
from diagrams import simulate
from studies.tables import Table

#: Where a baseline has to do well.
FAMILIES = (
    "two_static_obstacles",
    "u_trap",
    "clutter",
    "one_moving_obstacle",
    "two_moving_obstacles",
)
#: Fields of ``laws.<law>``, or of another part of the scenario where they have a
#: dot, and between what they are looked for, by ratio.
RANGES: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "stop_when_near": {"stop_m": (0.15, 1.2)},
    "vfh_plus": {
        "window_m": (0.8, 2.5),
        "low_threshold": (0.1, 20.0),
        "slow_density": (3.0, 300.0),
        "clearance_m": (0.005, 0.2),
        "previous_gain": (0.5, 4.0),
    },
    "mppi": {
        "temperature": (0.003, 0.5),
        "turn_spread_rad_s": (0.3, 1.2),
        "angle_gain": (0.3, 5.0),
        "obstacle_gain": (0.5, 15.0),
        "inflation_m": (0.05, 0.5),
        "clearance_m": (0.01, 0.15),
    },
    "orca": {
        "horizon_s": (0.7, 6.0),
        "offset_m": (0.03, 0.2),
    },
}


class Tried(NamedTuple):
    """A setting, and what it came to."""

    score: float
    shares: tuple[tuple[float, float], ...]
    """Of each family the shares of success and of collisions."""
    settings: Mapping[str, float]


def tried_settings(law: str, points: int, seed: int) -> list[dict[str, float]]:
    """The defaults, as no settings at all, and points of a Sobol sequence.

    Args:
        law: One of ``RANGES``.
        points: How many besides the defaults, a power of 2.
        seed: Of the sequence.

    Returns:
        Values by field.
    """
    ranges = RANGES[law]
    sequence = qmc.Sobol(len(ranges), rng=seed)
    found: list[dict[str, float]] = [{}]
    found += [
        {
            name: float(f"{low * (high / low) ** share:.2g}")
            for (name, (low, high)), share in zip(ranges.items(), point, strict=True)
        }
        for point in sequence.random(points)
    ]
    return found


def try_setting(
    settings: Mapping[str, float], law: str, layouts: int, seed: int
) -> Tried:
    """Runs a law on layouts of all families.

    Args:
        settings: Of the law.
        law: Its name.
        layouts: Of each family.
        seed: Of the layouts.

    Returns:
        Score and shares.
    """
    fields = {
        name if "." in name else f"laws.{law}.{name}": value
        for name, value in settings.items()
    }
    shares = []
    for family in FAMILIES:
        plan = comparison_plan(
            family,
            laws=[law],
            runs=layouts,
            seed=seed,
            settings={"hearing": "ideal", **fields},
        )
        ends = [
            simulate(plan.scenario_of(point), engine="compiled").cause
            for point in plan.points()
        ]
        good = sum(end in {"reached", "completed"} for end in ends) / layouts
        shares.append((good, ends.count("collision") / layouts))
    score = math.fsum(good - bad for good, bad in shares) / len(shares)
    return Tried(score, tuple(shares), settings)


def _row(tried: Tried) -> Sequence[str]:
    shares = (f"{100 * good:.0f} / {100 * bad:.0f}" for good, bad in tried.shares)
    settings = " ".join(f"{name}={value:g}" for name, value in tried.settings.items())
    return f"{tried.score:.3f}", *shares, settings or "defaults"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("laws", nargs="*", metavar="LAW", default=[*RANGES])
    parser.add_argument("--points", type=int, default=32)
    parser.add_argument("--layouts", type=int, default=20)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--workers", type=int, default=1)


def run(options: argparse.Namespace) -> Iterator[Table]:
    """A table for each law: its defaults, then the five best.

    Cells of families are success / collision, %.
    """
    head = ("score", *FAMILIES, "settings")
    with ProcessPoolExecutor(options.workers) as pool:
        for law in options.laws or [*RANGES]:
            settings = tried_settings(law, options.points, options.seed)
            one = partial(
                try_setting, law=law, layouts=options.layouts, seed=options.seed
            )
            tried = list(pool.map(one, settings))
            best = sorted(tried[1:], key=lambda each: -each.score)[:5]
            yield Table(law, head, [_row(each) for each in (tried[0], *best)])
