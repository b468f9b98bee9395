"""The stability analysis as a JSON document, as text, and as files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from analysis.models.model_export import write_models
from analysis.reporting.criterion import compare_verdicts
from analysis.reporting.plain_values import plain
from analysis.reporting.provenance import SCHEMA_VERSION, versions
from analysis.reporting.render import text
from analysis.reporting.section import Table
from analysis.stability.law_analysis import LawAnalysis
from analysis.stability.report_page import stability_page, verdict_table
from diagrams import write_scenario


def stability_document(
    analyses: Sequence[LawAnalysis], out: Path | None
) -> dict[str, Any]:
    """Returns the JSON document of a stability analysis of one or several laws.

    The document of one law has its results as keys at the top level. The document of
    several laws has the key ``laws`` with one document per law, and the key
    ``comparison`` with the verdicts side by side. ``out`` is the result directory,
    whose name is written into the document, or None if no files are written.
    """
    first = analyses[0].scenario
    common = {
        "schema_version": SCHEMA_VERSION,
        "scenario": first.name,
        "seed": first.seed,
    }
    ending = {"versions": versions(), "out": str(out) if out is not None else None}
    laws = [_law_document(analysis) for analysis in analyses]
    if len(laws) == 1:
        return {**common, **laws[0], **ending}
    rows = compare_verdicts({a.law: a.verdicts for a in analyses})
    return {**common, "laws": laws, "comparison": plain(rows), **ending}


def _law_document(analysis: LawAnalysis) -> dict[str, Any]:
    return {
        "law": analysis.law,
        "notes": analysis.notes,
        **{section.key: plain(section.data) for section in analysis.sections},
        "verdicts": plain(analysis.verdicts),
        "model": plain(analysis.sheet),
        "computing_time_s": analysis.computing_time_s,
    }


def stability_text(analyses: Sequence[LawAnalysis]) -> str:
    """Returns the verdicts and the notes of a stability analysis as text."""
    table = verdict_table(analyses)
    # Texts in plain words are too long for a terminal.
    columns, rows = table.columns[:-1], [row[:-1] for row in table.rows]
    lines = [text(Table(["", *columns[1:]], rows))] if rows else []
    for each in analyses:
        before = f"{each.law}: " if len(analyses) > 1 else ""
        lines += [f"note: {before}{note}" for note in each.notes]
    return "\n".join(lines)


def write_stability(
    analyses: Sequence[LawAnalysis], document: dict[str, Any], directory: Path
) -> None:
    """Writes the files of a stability analysis into an existing directory.

    - ``report.html`` is the report.
    - ``summary.json`` is the JSON document from ``stability_document``.
    - ``scenario.yaml`` is the scenario.
    - ``models.mat`` and ``models/*.csv`` are the linear models.
    """
    models = [
        replace(model, name=f"{analysis.law} {model.name}")
        for analysis in analyses
        for model in analysis.models
    ]
    write_models(models, directory)
    scenario = analyses[0].scenario
    write_scenario(scenario, directory)
    (directory / "summary.json").write_text(json.dumps(document) + "\n")
    (directory / "report.html").write_text(stability_page(analyses), "utf-8")
