"""What a robot on a route collides with, by how it sees.

``python -m studies object_sensing [RUNS [SCENARIOS]]`` prints the table of
docs/results_routes.md, "What beams see"; RUNS layouts of each scenario, 200 by default.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from studies.routes import SEED as SEED, outcomes, outcomes_cell
from studies.tables import Table

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
        "ultrasonic": {"preset": "lidar", "position_m": [-0.08, 0.0]},
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


def sensing_table(runs: int, scenarios: Sequence[str] = _SCENARIOS) -> Table:
    """Collisions and goals reached by how robots see.

    Args:
        runs: Layouts of each scenario, the same for all columns.
        scenarios: Names in the library.

    Returns:
        A row a scenario and law: collisions, % with 95 % intervals, then goals, %.
    """
    rows = (
        [
            f"`{scenario}`, {law.removeprefix('trajectory_')}",
            *(
                outcomes_cell(outcomes(scenario, law, runs, settings=settings), runs)
                for settings in SENSING.values()
            ),
        ]
        for scenario in scenarios
        for law in _LAWS
    )
    return Table("sensing", ["layouts, law", *SENSING], rows)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("runs", nargs="?", type=int, default=200)
    parser.add_argument("scenarios", nargs="*", default=_SCENARIOS)


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    yield sensing_table(options.runs, options.scenarios)
