"""How scenarios of the library end, and what the robot hears on the way.

``python -m studies library_runs --out docs/results/library_runs.json``
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from analysis.runs.metric_table import run_metrics
from analysis.runs.run_report import run_document, run_text
from diagrams import RunResult, load_scenario, simulate
from studies.tables import Table
from systems.laws.catalog import FORCE_LAWS

SEED = 1
#: Rows of the table of endings.
SCENARIOS = (
    "default",
    "two_static_obstacles",
    "one_moving_obstacle",
    "two_moving_obstacles",
)
#: Later than the second burst, s.
_SETTLED_S = 2.5
_VERBS = {
    "reached": "reaches the source",
    "unsettled": "swings at the source",
    "completed": "follows",
}


def add_options(parser: argparse.ArgumentParser) -> None:
    """The study has none."""


def run(options: argparse.Namespace) -> Iterator[Table]:
    """What README and the tutorial show."""
    del options
    yield following()
    yield endings()
    yield summary_of_the_default_run()


def following() -> Table:
    """What the robot hears and where it drives in ``obstacle_free``."""
    result = simulate(load_scenario("obstacle_free"), engine="compiled")
    metrics, source = run_metrics(result), result.scenario.source
    moving = result.time > _SETTLED_S
    moving &= result.time < source.path().length / source.speed_m_s
    distance = result.columns["source_range_true"]
    least, most, mean = (f(distance[moving]) for f in (np.min, np.max, np.mean))
    figures = {
        "frames heard, of those with sound": f"{metrics['frames_with_sound_heard']} "
        f"of {metrics['frames_with_sound']}",
        "with a range, of those heard": f"{metrics['detections_with_range']} "
        f"of {metrics['detections']}",
        "error of the estimated position": (
            f"{_millimeters(metrics['source_error_median_m'])} median, "
            f"{_millimeters(metrics['source_error_p95_m'])} at 95 %"
        ),
        "distance from the source while it moves, after the second burst": (
            f"{least:.2f} m to {most:.2f} m, {mean:.2f} m on average"
        ),
        "at the end, the source at rest": f"{distance[-1]:.2f} m",
        "least clearance": f"{metrics['minimum_clearance_m']:.2f} m",
    }
    return Table("following", ("figure", "value"), [*figures.items()])


def endings(scenarios: tuple[str, ...] = SCENARIOS) -> Table:
    """How scenarios end with each law."""

    def rows() -> Iterator[list[str]]:
        for scenario in scenarios:
            runs = (
                simulate(load_scenario(scenario, [f"law={x}"]), engine="compiled")
                for x in FORCE_LAWS
            )
            yield [scenario, *map(_ending, runs)]

    names = ("no avoidance" if law == "none" else law for law in FORCE_LAWS)
    return Table("endings", ("scenario", *names), rows())


def summary_of_the_default_run() -> Table:
    """What ``phonotaxis simulate`` prints, but for the speed and names of files."""
    result = simulate(load_scenario("default"), engine="compiled")
    printed = run_text(result, run_document(result)).splitlines()
    lines = [[line] for line in printed if not line.startswith("speed")]
    return Table("summary of the default run", ("line",), lines)


def _ending(result: RunResult) -> str:
    hit = result.collision
    if hit is not None:
        return f"{'hits' if hit.fault == 'robot' else 'is hit by'} {hit.object}"
    clearance = run_metrics(result)["minimum_clearance_m"]
    return f"{_VERBS.get(result.cause, result.cause)}, {clearance:.2f} m"


def _millimeters(value: float | None) -> str:
    return "-" if value is None else f"{1e3 * value:.0f} mm"
