"""Writes the result directory of a run: its data, pictures, replay and page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.report.plain_values import write_json
from analysis.report.render import heading, html, page
from analysis.report.section import (
    Content,
    Definitions,
    Files,
    Note,
    Picture,
    Section,
    Table,
)
from analysis.runs.metric_table import METRICS
from analysis.runs.proximity import Proximity
from analysis.runs.run_report import summary_rows
from analysis.views.block_diagram import write_block_diagram
from analysis.views.framing import run_title
from analysis.views.picture import plot_trajectory
from analysis.views.replay import write_replay
from analysis.views.time_series import plot_time_series
from diagrams import RunResult, build_sound_follower, write_scenario

#: Files that the page lists, with descriptions of their contents.
_FILES = {
    "replay.html": "the run in three dimensions, with curves over time",
    "trajectory.parquet": "one row per tick, SI units",
    "scenario.yaml": "all inputs of the run; `phonotaxis simulate` runs it again",
    "own_code/SHA256SUMS": "sums of the copies of your own laws and blocks",
    "summary.json": "the numbers of this page, for programs",
}


def write_run(
    result: RunResult,
    summary: dict[str, Any],
    directory: Path,
    *,
    pictures: bool = True,
) -> None:
    """Writes all files of a run into an existing directory; docs/runs.md lists them.

    ``summary`` is the JSON document of the run. If ``pictures`` is false, the PNG and
    SVG files are left out. With several robots, each robot has its own
    ``time_series_<name>.png`` and ``diagram_<name>.svg``. The file ``diagram.svg`` then
    shows how the robots are connected.
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
        _page(result, rows, summary, directory), "utf-8"
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


def _page(
    result: RunResult,
    rows: Mapping[str, str],
    summary: Mapping[str, Any],
    directory: Path,
) -> str:
    """Returns the HTML page of a run.

    The page shows only files that are already in the directory.
    """

    def there(name: str) -> bool:
        return (directory / name).is_file()

    parts: dict[str, Sequence[Content]] = {
        "Summary": _summary(result, rows, has_replay=there("replay.html"))
    }
    if there("trajectory.png"):
        caption = "The run from above, in W. Times are in seconds."
        parts["From above"] = [Picture("trajectory.png", caption)]
    whose = {f"_{name}": f": {name}" for name in result.several} or {"": ""}
    for title, file, text, owners in (
        ("Over time", "time_series{}.png", "Sensors and commands over time", whose),
        ("Blocks", "diagram{}.svg", "Blocks and their connections", {"": "", **whose}),
    ):
        shown = [
            Picture(file.format(ending), f"{text}{who}.", tall=title == "Over time")
            for ending, who in owners.items()
            if there(file.format(ending))
        ]
        if shown:
            parts[title] = shown
    parts["Figures"] = _figures(result, summary)
    files = [(name, text) for name, text in _FILES.items() if there(name)]
    parts["Files"] = [Files(files)]
    contents = [(_anchor(title), title) for title in parts]
    sections = [
        html(Section(_anchor(title), title, inner), _anchor(title))
        for title, inner in parts.items()
    ]
    return page(run_title(result), contents, sections)


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _summary(
    result: RunResult, rows: Mapping[str, str], *, has_replay: bool
) -> list[Content]:
    """Returns the contents of the section "Summary".

    They are the warnings, a list of the rows of each robot, and links to the replay.
    """
    begin = 0
    parts: list[Content] = [
        Note(f"Warning: `{x.field}`: {x.message}") for x in result.warnings
    ]
    names = list(rows)
    starts = [names.index(name) for name in result.several]
    for end in [*starts, len(names)]:
        own = names[begin:end]
        if begin in starts:
            parts.append(heading(own[0]))
        shown = [
            (
                "Ended" if name in result.several else name.split(".")[-1].capitalize(),
                rows[name],
            )
            for name in own
        ]
        parts.append(Definitions(shown))
        begin = end
    if has_replay:
        watch = [("replay.html", "the whole run as an animation")]
        if result.collision is not None:
            moment = max(result.collision.time - 1.0, 0.0)
            watch.append(
                (f"replay.html#t={moment:.2f}", "one second before the collision")
            )
        parts.append(Files(watch))
    return parts


def _figures(result: RunResult, summary: Mapping[str, Any]) -> list[Content]:
    """Returns the contents of the section "Figures".

    A table has one row per metric and one column per robot.
    """
    metrics: Mapping[str, Any] = summary["metrics"]
    prefixes = [f"{name}." for name in result.several] or [""]
    found = [
        metric
        for metric in METRICS.values()
        if any(f"{prefix}{metric.name}" in metrics for prefix in prefixes)
    ]
    rows = [
        [
            metric.label,
            *(metrics.get(f"{prefix}{metric.name}") for prefix in prefixes),
        ]
        for metric in found
    ]
    text = "`phonotaxis columns --metrics` describes each metric."
    return [text, Table(["", *(result.several or [""])], rows)]
