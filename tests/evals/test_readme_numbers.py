"""The numbers of README's "What to expect" are those of the runs it names."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from analysis.runs.metrics import run_metrics
from diagrams import load_scenario, simulate

pytestmark = pytest.mark.slow

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
#: Another processor rounds exp and dot products otherwise; that much may differ.
TOLERANCE_M = 0.03


def numbers(row: str) -> list[float]:
    """Numbers of the table's row that begins so."""
    line = next(x for x in README.splitlines() if x.startswith(f"| {row}"))
    return [float(x) for x in re.findall(r"\d+(?:\.\d+)?", line.split("|")[2])]


def test_obstacle_free():
    result = simulate(load_scenario("obstacle_free"))
    metrics, time = run_metrics(result), result.time
    source = result.scenario.source
    moving = (time > 2.5) & (time < source.path().length / source.speed_m_s)
    distance = result.columns["source_range_true"]
    assert numbers("frames heard") == [metrics["detections_with_range"], 600.0]
    error_mm = 1e3 * np.array(
        [metrics["source_error_median_m"], metrics["source_error_p95_m"]]
    )
    median, p95, *_ = (x for x in numbers("error of the") if x != 95.0)
    # The 95 % is that of few frames with the source abeam: a fifth, or 1 mm.
    np.testing.assert_allclose([median, p95], error_mm, atol=1.0, rtol=0.2)
    expected = [distance[moving].min(), distance[moving].max(), distance[moving].mean()]
    stated = numbers("distance from the source while")
    np.testing.assert_allclose(stated, expected, atol=TOLERANCE_M)
    np.testing.assert_allclose(numbers("at the end"), distance[-1], atol=TOLERANCE_M)
    least = float(metrics["minimum_clearance_m"] or 0.0)
    np.testing.assert_allclose(numbers("least clearance"), least, atol=TOLERANCE_M)


LAWS = ("none", "conventional", "active", "active2017")


@pytest.mark.parametrize(
    "scenario",
    ["default", "two_static_obstacles", "one_moving_obstacle", "two_moving_obstacles"],
)
def test_how_the_scenarios_end(scenario):
    line = next(x for x in README.splitlines() if x.startswith(f"| {scenario} |"))
    for law, stated in zip(LAWS, line.split("|")[2:6], strict=True):
        result = simulate(load_scenario(scenario, [f"law={law}"]))
        if result.collision is not None:
            by = "hits" if result.collision.fault == "robot" else "is hit by"
            assert stated.strip() == f"{by} {result.collision.object}"
            continue
        verb = {"completed": "follows", "reached": "reaches"}[result.cause]
        assert verb in stated
        least = run_metrics(result)["minimum_clearance_m"]
        clearance = float(re.findall(r"\d+\.\d+", stated)[-1])
        # Other seeds differ by up to 0.07 m (one_moving_obstacle, active).
        assert clearance == pytest.approx(least, abs=0.1)
