"""Runs of the library, as they were recorded before the house was rebuilt.

``python tests/evals/test_recorded_runs.py`` records them anew, for a change of
behaviour that is meant.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagrams import Scenario, library_scenarios, load_scenario, simulate
from systems.laws.catalogue import FORCE_LAWS

pytestmark = pytest.mark.slow

RECORD = Path(__file__).with_name("recorded_runs.json")
COLUMNS = (
    *("p_WB_x", "p_WB_y", "theta_WB", "v_WB_x", "v_WB_y", "omega_WB"),
    *("p_WS_estimated_x", "p_WS_estimated_y", "repulsion_x", "repulsion_y"),
    *("wheel_speed_left", "wheel_speed_right", "p_WB_estimated_x", "collision_2_B_x"),
)
#: Ticks that are kept of each run.
TICKS = 12
#: Another machine's sine may differ in the last bit; 40 s make little more of it.
TOLERANCE = 1e-9


def builds() -> list[tuple[str, ...]]:
    """Scenario and settings: each by ear and exactly, laws, models of sensors."""
    loaded = {name: load_scenario(name) for name in sorted(library_scenarios())}
    names = [n for n, each in loaded.items() if _follows_alone(each)]
    return [
        *((name,) for name in names),
        *((name, "hearing=ideal") for name in names),
        *(
            ("two_static_obstacles", "hearing=ideal", f"law={law}")
            for law in FORCE_LAWS
        ),
        (
            "default",
            "hearing=ideal",
            "obstacle_sensing=ideal",
            "odometry.rounding=false",
        ),
        ("default", "hearing=ideal", "ultrasonic.firing=sequential"),
        ("default", "hearing=ideal", "plant.friction=0.1", "tracker.hold=world"),
        ("default", "tdoa.method=ml", "sound.kind=band_noise", "duration_s=6"),
        (
            "default",
            "room={size_m: [14, 14, 3], reverberation_time_s: 0.4}",
            "duration_s=4",
        ),
    ]


def _follows_alone(scenario: Scenario) -> bool:
    return not (scenario.robots or scenario.route or scenario.searches)


def record_of(build: tuple[str, ...]) -> dict[str, Any]:
    run = simulate(load_scenario(build[0], build[1:]))
    ticks = np.linspace(0, len(run.columns["t"]) - 1, TICKS).round().astype(int)
    return {
        "cause": run.cause,
        "simulated_s": run.simulated_s,
        "columns": {name: run.columns[name][ticks].tolist() for name in COLUMNS},
    }


def key(build: tuple[str, ...]) -> str:
    return " ".join(build)


@pytest.mark.parametrize("build", builds(), ids=key)
def test_run_is_the_recorded_one(build):
    expected = json.loads(RECORD.read_text("utf-8"))[key(build)]
    found = record_of(build)
    assert found["cause"] == expected["cause"]
    assert found["simulated_s"] == expected["simulated_s"]
    for name in COLUMNS:
        np.testing.assert_allclose(
            found["columns"][name],
            expected["columns"][name],
            rtol=0.0,
            atol=TOLERANCE,
            err_msg=name,
        )


if __name__ == "__main__":
    found = {key(build): record_of(build) for build in builds()}
    RECORD.write_text(json.dumps(found, indent=1) + "\n", "utf-8")
