"""What a robot on a route collides with, by how it sees, as a table.

``python -m docs.tables.object_sensing [RUNS [SCENARIOS]]`` prints the table of
docs/trajectory.md, "What beams see"; RUNS layouts of each scenario, 200 unless told.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

from analysis.reporting.markdown import markdown_table
from docs.tables.routes import outcomes, outcomes_cell

__all__ = ["SENSING", "sensing_table"]

_BEAMS = {"obstacle_sensing": "ultrasonic"}
_WORSE = {"noise_m": 0.02, "velocity_noise_m_s": 0.02}
#: Settings of a scenario by what the table calls them.
SENSING: Mapping[str, Mapping[str, Any]] = {
    "exact": {},
    "2 cm and 2 cm/s of noise": {"objects": _WORSE},
    "bodies hide others": {"objects": {"occlusion": True}},
    "0.1 s late": {"objects": {"latency_s": 0.1}},
    "all three": {"objects": {**_WORSE, "occlusion": True, "latency_s": 0.1}},
    "7 beams": {**_BEAMS, "ultrasonic": {"preset": "scan_7"}},
    "72 beams": {
        **_BEAMS,
        "ultrasonic": {"preset": "lidar", "positions_m": [[-0.08, 0.0]]},
    },
}
_SCENARIOS = (
    "unknown_block",
    "crossing_obstacle",
    "unknown_wall",
    "robots_2",
    "robots_4",
)
_LAWS = "trajectory_conventional", "trajectory_filtered"


def sensing_table(runs: int, scenarios: tuple[str, ...] = _SCENARIOS) -> str:
    """Collisions and goals reached by how robots see, in Markdown.

    Args:
        runs: Layouts of each scenario, the same for all columns.
        scenarios: Names in the library.

    Returns:
        A row a scenario and law: collisions, % with 95 % intervals, then goals, %.
    """
    rows = [
        [
            f"`{scenario}`, {law.removeprefix('trajectory_')}",
            *(
                outcomes_cell(outcomes(scenario, law, runs, settings=settings), runs)
                for settings in SENSING.values()
            ),
        ]
        for scenario in scenarios
        for law in _LAWS
    ]
    return markdown_table(["layouts, law", *SENSING], rows)


if __name__ == "__main__":
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    chosen = tuple(sys.argv[2:]) or _SCENARIOS
    sys.stdout.write(sensing_table(runs, chosen) + "\n")
