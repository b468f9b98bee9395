"""Writes the result directory of a run: its data, pictures, replay and page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.reporting.plain_values import write_json
from analysis.runs.proximity import Proximity
from analysis.runs.run_report import summary_rows
from analysis.views.block_diagram import write_block_diagram
from analysis.views.picture import plot_trajectory
from analysis.views.replay import write_replay
from analysis.views.run_page import run_page
from analysis.views.time_series import plot_time_series
from diagrams import RunResult, build_sound_follower, write_scenario


def write_run(
    result: RunResult,
    summary: dict[str, Any],
    directory: Path,
    *,
    pictures: bool = True,
) -> None:
    """Writes all files of a run into an existing directory.

    The files are:

    - ``scenario.yaml``: the complete scenario, which can be run again
    - ``scenario.schema.json``: the schema of this scenario file
    - ``summary.json``: the summary from ``run_summary``
    - ``trajectory.parquet``: the table with one row per tick (control period)
    - ``replay.html``: the replay in three dimensions
    - ``trajectory.png``, ``time_series.png`` and ``diagram.svg``: the pictures
    - ``report.html``: a page with the pictures, and with links to other files

    With several robots, each robot has its own ``time_series_<name>.png`` and
    ``diagram_<name>.svg``. The file ``diagram.svg`` then shows how the robots are
    connected.
    """
    write_scenario(result.full_scenario, directory)
    write_json(summary, directory / "summary.json")
    result.trajectory.to_parquet(directory / "trajectory.parquet", index=False)
    clearance = {name: Proximity(o).clearance for name, o in result.robots.items()}
    if pictures:
        _write_pictures(result, clearance, directory)
    write_replay(result, directory / "replay.html", clearance)
    rows = summary_rows(result, summary)
    (directory / "report.html").write_text(
        run_page(result, rows, summary, directory), "utf-8"
    )


def _write_pictures(
    result: RunResult, clearance: dict[str, NDArray[np.float64]], directory: Path
) -> None:

    plot_trajectory(result).savefig(directory / "trajectory.png", dpi=150)
    for name, own in result.robots.items():
        ending = f"_{name}" if result.several else ""
        figure = plot_time_series(own, clearance[name])
        figure.savefig(directory / f"time_series{ending}.png", dpi=150)
    follower = build_sound_follower(result.full_scenario)
    write_block_diagram(
        follower.diagram, directory / "diagram.svg", flat=not result.several
    )
    if result.several:
        for name, parts in follower.robots.items():
            write_block_diagram(parts.diagram, directory / f"diagram_{name}.svg")
