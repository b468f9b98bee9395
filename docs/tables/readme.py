"""The tables of README's "What to expect", from the runs that they name.

``python -m docs.tables.readme`` prints both as Markdown.
"""

from __future__ import annotations

import sys

import numpy as np

from analysis.reporting.markdown import markdown_head, markdown_row
from analysis.runs.metrics import run_metrics
from diagrams import RunResult, load_scenario, simulate
from systems.laws.catalogue import FORCE_LAWS

__all__ = ["SCENARIOS", "ending_row", "following_rows", "laws_heading"]

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


def following_rows() -> list[str]:
    """Rows of the table of ``obstacle_free``."""
    result = simulate(load_scenario("obstacle_free"))
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
            f"{_millimetres(metrics['source_error_median_m'])} median, "
            f"{_millimetres(metrics['source_error_p95_m'])} at 95 %"
        ),
        "distance from the source while it moves, after the second burst": (
            f"{least:.2f} m to {most:.2f} m, {mean:.2f} m on average"
        ),
        "at the end, the source at rest": f"{distance[-1]:.2f} m",
        "least clearance": f"{metrics['minimum_clearance_m']:.2f} m",
    }
    return [markdown_row(row) for row in figures.items()]


def laws_heading() -> str:
    """Heading of the table of endings, with its rule."""
    names = ("no avoidance" if law == "none" else law for law in FORCE_LAWS)
    return markdown_head(["scenario", *names])


def ending_row(scenario: str) -> str:
    """How a scenario ends with each law."""
    runs = (simulate(load_scenario(scenario, [f"law={law}"])) for law in FORCE_LAWS)
    return markdown_row([scenario, *map(_ending, runs)])


def _ending(result: RunResult) -> str:
    hit = result.collision
    if hit is not None:
        return f"{'hits' if hit.fault == 'robot' else 'is hit by'} {hit.object}"
    clearance = run_metrics(result)["minimum_clearance_m"]
    return f"{_VERBS.get(result.cause, result.cause)}, {clearance:.2f} m"


def _millimetres(value: float | None) -> str:
    return "-" if value is None else f"{1e3 * value:.0f} mm"


if __name__ == "__main__":
    rows = [markdown_head(["", ""]), *following_rows(), "", laws_heading()]
    rows += [ending_row(scenario) for scenario in SCENARIOS]
    sys.stdout.write("\n".join(rows) + "\n")
