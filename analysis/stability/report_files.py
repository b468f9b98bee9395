"""The stability analysis as a JSON document, as text, and as files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from analysis.models.model_export import write_models
from analysis.reporting.plain_values import plain
from analysis.reporting.provenance import SCHEMA_VERSION, versions
from analysis.stability.law_analysis import LawAnalysis
from analysis.stability.report_page import stability_page
from analysis.stability.verdicts import compare_verdicts, shown_value
from diagrams import write_scenario


def stability_document(
    analyses: Sequence[LawAnalysis], out: Path | None
) -> dict[str, Any]:
    """Returns the JSON document of a stability analysis of one or several laws.

    The document of one law has its results as keys at the top level. The document of
    several laws has the key ``laws`` with one document per law, and the key
    ``comparison`` with the verdicts side by side.

    Args:
        analyses: One analysis per law, all of the same scenario.
        out: The result directory, whose name is written into the document. None if no
            files are written.

    Returns:
        Plain values that can be written as JSON.
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
    return {**common, "laws": laws, "comparison": plain(comparison(analyses)), **ending}


def comparison(analyses: Sequence[LawAnalysis]) -> tuple[Any, ...]:
    """Returns the verdicts of all laws side by side. One law is also allowed."""
    return compare_verdicts({a.law: a.verdicts for a in analyses})


def _law_document(analysis: LawAnalysis) -> dict[str, Any]:
    findings = analysis.findings.values()
    parts: dict[str, Any] = {}
    for finding in findings:
        part = finding.part
        if finding.problem:
            failed = {"failed": True} if finding.failed else {}
            parts[part.key] = {"problem": finding.problem, **failed}
        elif part.document is None:
            parts[part.key] = plain(finding.data)
        else:
            for key, value in plain(part.document(finding.data)).items():
                # A part may add entries to a list of an earlier part.
                earlier = parts.get(key)
                parts[key] = earlier + value if isinstance(earlier, list) else value
    return {
        "law": analysis.law,
        "notes": list(analysis.notes),
        **parts,
        "model": plain(asdict(analysis.sheet)),
        "seconds": {f.part.key: round(f.seconds, 3) for f in findings},
    }


def stability_text(document: dict[str, Any]) -> str:
    """Returns the verdicts and the notes of a stability analysis as text."""
    rows = document.get("comparison")
    if rows is None:
        verdicts = document["verdicts"]
        known = verdicts if isinstance(verdicts, list) else []
        rows = [_as_comparison(row, document["law"]) for row in known]
    laws = list(rows[0]["values"]) if rows else []
    width = max(22, 2 + max(map(len, laws), default=0))
    heads = "".join(f"{law:>{width}}" for law in laws)
    name = max(34, 2 + max((len(row["name"]) for row in rows), default=0))
    lines = [f"{'':<{name}}{'threshold':>14}{heads}"]
    for row in rows:
        cells = "".join(
            f"{_value(row['values'][law], row['unit']):>{width - 10}}"
            f"{_mark(row['verdicts'][law]):>10}"
            for law in laws
        )
        lines.append(f"{row['name']:<{name}}{row['threshold']:>14}{cells}")
    documents = document.get("laws", [document])
    for each in documents:
        before = f"{each['law']}: " if len(documents) > 1 else ""
        lines += [f"note: {before}{note}" for note in each.get("notes", ())]
    return "\n".join(lines)


def _as_comparison(row: dict[str, Any], law: str) -> dict[str, Any]:
    return {
        **row,
        "values": {law: row["value"]},
        "verdicts": {law: row["verdict"]},
    }


def _value(value: float | None, unit: str) -> str:
    shown = shown_value(value, unit)
    if shown is None:
        return "-"
    return shown if isinstance(shown, str) else f"{shown:.4g}"


def _mark(verdict: str) -> str:
    return {"not applicable": "n/a"}.get(verdict, verdict)


def write_stability(
    analyses: Sequence[LawAnalysis], document: dict[str, Any], directory: Path
) -> None:
    """Writes the files of a stability analysis into a directory.

    - ``report.html`` is the report.
    - ``summary.json`` is the JSON document.
    - ``scenario.yaml`` is the scenario.
    - ``models.mat`` and ``models/*.csv`` are the linear models.

    Args:
        analyses: One analysis per law, all of the same scenario.
        document: The JSON document from ``stability_document``.
        directory: An existing directory.
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
