"""The HTML page of a comparison: rates, medians, pairs and example runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from analysis.comparison.cells import LawCell
from analysis.comparison.laws_in_pairs import Comparison, Pair
from analysis.comparison.report_text import (
    PAIRED,
    counts_text,
    difference_text,
    median_columns,
    median_text,
    points_text,
    rate_text,
    warning_texts,
)
from analysis.reporting.html_page import (
    definitions,
    file_links,
    heading,
    note,
    paragraph,
    picture,
    section,
    table,
)
from analysis.reporting.render import page
from analysis.reporting.section import Cell
from analysis.runs.metric_table import METRICS


def comparison_page(
    summary: Mapping[str, Any],
    comparisons: Mapping[str, Comparison],
    pooled: Sequence[Pair],
    directory: Path,
) -> str:
    """Makes the HTML page of a comparison.

    The page shows the pictures and replays that exist in its directory.

    Args:
        summary: JSON document from ``compare_summary``.
        comparisons: Results of each scenario, by the scenario's name.
        pooled: Comparisons of each pair of control laws over all scenarios together.
        directory: Directory that the page will be written to.

    Returns:
        HTML.
    """
    parts = {"Summary": ("summary", _summary(summary))}
    for k, (name, comparison) in enumerate(comparisons.items()):
        parts[name] = (f"scenario{k}", _scenario(name, comparison, summary, directory))
    if len(comparisons) > 1:
        parts["All together"] = ("all-together", [_pairs(pooled)])
    contents = [(anchor, title) for title, (anchor, _) in parts.items()]
    return page(
        f"Comparison of laws: {', '.join(comparisons)}",
        contents,
        [section(anchor, title, inner) for title, (anchor, inner) in parts.items()],
    )


def _summary(summary: Mapping[str, Any]) -> list[str]:
    versions = ", ".join(f"{k} {v}" for k, v in summary["versions"].items())
    rows = [
        (
            "Layouts",
            (f"{summary['layouts']} per scenario, the same layouts for every law"),
        ),
        ("Seed", str(summary["seed"])),
        ("Versions", versions),
    ]
    text = (
        "Brackets are 95 % intervals. docs/metrics.md states of each metric whether "
        "its median includes all runs or successful runs."
    )
    files = [("summary.json", "the numbers of this page, for programs")]
    rates = (
        "Shares of success and collision, and two medians, of every law, with 95 % "
        "intervals."
    )
    return [
        definitions(rows),
        paragraph(text),
        picture("rates.png", rates),
        file_links(files),
    ]


def _scenario(
    name: str, comparison: Comparison, summary: Mapping[str, Any], directory: Path
) -> list[str]:
    parts = [note(text) for text in warning_texts(comparison.cells)]
    parts += [_laws(comparison.cells), _endings(comparison.cells)]
    parts += [_pairs(comparison.pairs)] if comparison.pairs else []
    caption = "Worst, typical and best run of every law, from above, in W."
    parts += [heading(3, "Example runs"), picture(f"{name}.png", caption)]
    for cell in summary["cells"]:
        if cell["scenario"] == name:
            parts += _examples(cell, directory)
    return parts


def _laws(cells: Sequence[LawCell]) -> str:
    columns = median_columns(cells)
    titles = [
        "law",
        "runs",
        "success %",
        "collision %",
        *(metric.label for metric in columns),
    ]
    rows: list[list[Cell]] = [
        [
            cell.label,
            cell.runs,
            rate_text(cell.success),
            rate_text(cell.collision),
            *(median_text(cell, metric) for metric in columns),
        ]
        for cell in cells
    ]
    return table(titles, rows, caption="Every law on the same layouts")


def _endings(cells: Sequence[LawCell]) -> str:
    rows = [
        (cell.label, counts_text(cell.causes), counts_text(cell.mechanisms) or "-")
        for cell in cells
    ]
    return table(["law", "how the runs ended", "why they failed"], rows)


def _pairs(pairs: Sequence[Pair]) -> str:
    titles = ["first less second", "success, points", "p", "collision, points", "p"]
    titles += [METRICS[metric].label for metric in PAIRED]
    rows: list[list[Cell]] = []
    for pair in pairs:
        common = "".join(f", {value}" for value in pair.fields.values())
        rows.append(
            [
                f"{pair.first} less {pair.second}{common}",
                points_text(pair.success),
                pair.success.p_value,
                points_text(pair.collision),
                pair.collision.p_value,
                *(difference_text(pair.metrics.get(metric)) for metric in PAIRED),
            ]
        )
    caption = "Pairs of runs that differ in the law only; medians of differences"
    return table(titles, rows, caption=caption)


def _examples(cell: Mapping[str, Any], directory: Path) -> list[str]:
    """Commands that repeat a cell's example runs, and links to existing replays."""
    lines, replays = [], []
    label = ", ".join([cell["law"], *map(str, cell["fields"].values())])
    for example in cell["examples"]:
        who = f"{label}, {example['kind']}"
        lines.append((who, f"{example['cause']}: `{example['command']}`"))
        replay = str(Path(example["scenario_file"]).with_suffix(".html"))
        if (directory / replay).is_file():
            replays.append((replay, f"{who}, to watch"))
    return [definitions(lines), *([file_links(replays)] if replays else [])]
