"""A run as one page: how it went, its pictures, its figures, its files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from analysis.reporting.fact_tables import fact_table, readable_name
from analysis.reporting.html_page import (
    definitions,
    file_links,
    heading,
    page,
    paragraph,
    picture,
    section,
    table,
)
from analysis.runs.scene import run_title
from diagrams import RunResult

__all__ = ["run_page"]

#: What lies beside the page, and what is in it.
_FILES = {
    "replay.html": "the run in three dimensions, with curves over time",
    "trajectory.parquet": "a row a tick, SI units",
    "scenario.yaml": "all that the run depended on; `phonotaxis simulate` takes it",
    "summary.json": "the figures of this page, for programs",
}


def run_page(
    result: RunResult,
    rows: Mapping[str, str],
    summary: Mapping[str, Any],
    directory: Path,
) -> str:
    """The whole page; it shows what of the run is in its directory.

    Args:
        result: The run.
        rows: From ``summary_rows``.
        summary: From ``run_summary``.
        directory: Where the page will be.

    Returns:
        HTML.
    """

    def there(name: str) -> bool:
        return (directory / name).is_file()

    parts = {"Summary": _summary(result, rows, has_replay=there("replay.html"))}
    if there("trajectory.png"):
        caption = "The run from above, in W. Times are in seconds."
        parts["From above"] = [picture("trajectory.png", caption)]
    whose = {f"_{name}": f": {name}" for name in result.several} or {"": ""}
    for title, file, text, owners in (
        ("Over time", "time_series{}.png", "What was heard, felt and done", whose),
        ("Blocks", "diagram{}.svg", "Blocks, and what joins them", {"": "", **whose}),
    ):
        shown = [
            picture(file.format(ending), f"{text}{who}.")
            for ending, who in owners.items()
            if there(file.format(ending))
        ]
        if shown:
            parts[title] = shown
    parts["Figures"] = _figures(result, summary)
    files = [(name, text) for name, text in _FILES.items() if there(name)]
    parts["Files"] = [file_links(files)]
    contents = [(_anchor(title), title) for title in parts]
    sections = [section(_anchor(title), title, inner) for title, inner in parts.items()]
    return page(run_title(result), contents, sections)


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _summary(
    result: RunResult, rows: Mapping[str, str], *, has_replay: bool
) -> list[str]:
    """Of several robots, a list for each below the list of all."""
    parts, begin = [], 0
    names = list(rows)
    starts = [names.index(name) for name in result.several]
    for end in [*starts, len(names)]:
        own = names[begin:end]
        if begin in starts:
            parts.append(heading(3, own[0]))
        shown = [
            (
                "Ended" if name in result.several else name.split(".")[-1].capitalize(),
                rows[name],
            )
            for name in own
        ]
        parts.append(definitions(shown))
        begin = end
    if has_replay:
        watch = [("replay.html", "the whole run, to watch")]
        if result.collision is not None:
            moment = max(result.collision.time - 1.0, 0.0)
            watch.append(
                (f"replay.html#t={moment:.2f}", "a second before the collision")
            )
        parts.append(file_links(watch))
    return parts


def _figures(result: RunResult, summary: Mapping[str, Any]) -> list[str]:
    metrics: Mapping[str, Any] = summary["metrics"]
    text = paragraph("docs/metrics.md says what each of them is, and where it is from.")
    names = list(result.several)
    if not names:
        return [text, fact_table(metrics)]
    # A row for each metric, in the order of the first robot that has it.
    own = dict.fromkeys(
        key.partition(".")[2] for key in metrics if key.partition(".")[0] in names
    )
    rows = [
        [readable_name(key), *(metrics.get(f"{name}.{key}") for name in names)]
        for key in own
    ]
    shared = {key: value for key, value in metrics.items() if "." not in key}
    together = [fact_table(shared, caption="All together")] if shared else []
    return [text, table(["", *names], rows), *together]
