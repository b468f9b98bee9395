"""Writes the result directory of one scenario under several laws."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from analysis.report.file_names import distinct_names
from analysis.report.plain_values import write_json
from analysis.report.render import html, page
from analysis.report.section import Content, Definitions, Files, Picture, Section, Table
from analysis.runs.metric_table import METRICS
from analysis.views.law_picture import plot_laws
from diagrams import RunResult

#: Files of the whole directory. Each law has a directory of its own beside them.
SUMMARY, REPORT, PICTURE = "summary.json", "report.html", "laws.png"
_FIGURES = "figures"
#: Metrics of the table.
_METRICS = ("minimum_clearance_m", "final_distance_m", "path_length_m")


def law_directories(laws: Iterable[str]) -> dict[str, str]:
    """Returns the name of the directory of each law, by law."""
    names = [*laws]
    taken = (SUMMARY, REPORT, PICTURE, _FIGURES)
    return dict(zip(names, distinct_names(names, taken=taken), strict=True))


def laws_document(documents: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Joins the JSON documents of runs, by law, to one document.

    The key ``out``, the directory of all runs, is None. The caller sets it later. The
    key ``directory`` of each law is the name of a directory in it.
    """
    first = next(iter(documents.values()))
    same = {key: first[key] for key in ("schema_version", "scenario", "seed")}
    laws = {}
    for law, name in law_directories(documents).items():
        own = {key: value for key, value in documents[law].items() if key != "out"}
        laws[law] = {**own, "directory": name}
    return {**same, "laws": laws, "out": None}


def laws_text(results: Mapping[str, RunResult], document: Mapping[str, Any]) -> str:
    """Returns the scenario, and a table with one row per law, for a terminal."""
    heads, rows = _table(results, document)
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    lines = (
        "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True))
        for row in (heads, *rows)
    )
    about = f"{document['scenario']}, seed {document['seed']}"
    return "\n".join([about, "", *map(str.rstrip, lines)])


def write_laws(
    results: Mapping[str, RunResult],
    document: dict[str, Any],
    directory: Path,
    *,
    pictures: bool,
) -> None:
    """Writes the JSON document, the picture of all runs, and the page.

    Args:
        results: Result of each run, by law.
        document: The JSON document, with the key ``out``.
        directory: Directory that contains the directories of ``law_directories``.
        pictures: Whether to write the picture.
    """
    write_json(document, directory / SUMMARY)
    parts: dict[str, Sequence[Content]] = {}
    heads, rows = _table(results, document)
    notes = {str(each) for run in results.values() for each in run.warnings}
    parts["Summary"] = [
        Definitions([("Warning", note) for note in sorted(notes)]),
        Table(heads, rows),
    ]
    if pictures:
        plot_laws(results).savefig(directory / PICTURE, dpi=150)
        text = "All runs from above, in W. Dots mark the same times on all paths."
        parts["From above"] = [Picture(PICTURE, text)]
    pages = law_directories(results).items()
    parts["Runs"] = [Files([(f"{name}/{REPORT}", law) for law, name in pages])]
    sections = {title.lower().replace(" ", "-"): title for title in parts}
    written = page(
        f"{document['scenario']} under the laws {', '.join(results)}",
        [*sections.items()],
        [
            html(Section(anchor, title, parts[title]), anchor)
            for anchor, title in sections.items()
        ],
    )
    (directory / REPORT).write_text(written, "utf-8")


def _table(
    results: Mapping[str, RunResult], document: Mapping[str, Any]
) -> tuple[list[str], list[list[str]]]:
    heads = ["law", "ended", "after", *(METRICS[name].title for name in _METRICS)]
    rows = [
        [
            law,
            result.ending,
            f"{result.simulated_s:.1f} s",
            *(
                METRICS[name].text(document["laws"][law]["metrics"].get(name))
                for name in _METRICS
            ),
        ]
        for law, result in results.items()
    ]
    return heads, rows
