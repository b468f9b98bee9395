"""Writes a stability analysis as a JSON document, as text, and as an HTML page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

from markupsafe import Markup
from matplotlib.figure import Figure

from analysis.loops.model_export import write_models
from analysis.report.criterion import YES_OR_NO, Verdict, compare_verdicts
from analysis.report.plain_values import plain
from analysis.report.provenance import SCHEMA_VERSION, versions
from analysis.report.render import html, page, text
from analysis.report.section import (
    Bullets,
    Cell,
    Column,
    Content,
    Definitions,
    Formula,
    Judged,
    Links,
    Note,
    Section,
    Table,
    figures_of,
    number,
)
from analysis.stability.law_analysis import LawAnalysis
from analysis.stability.model_sheet import ModelSheet, ParameterRow
from diagrams import write_scenario
from diagrams.scenario.own_sources import write_own_sources
from systems.laws.catalog import law_title
from systems.laws.law import Equation


def stability_document(analyses: Sequence[LawAnalysis]) -> dict[str, Any]:
    """Returns the JSON document of a stability analysis of one or several laws.

    For one law, the results are keys at the top level. For several laws, the key
    ``laws`` has one document per law, and the key ``comparison`` has the verdicts of
    all laws side by side. The key ``out`` is for the directory of the report's files.
    It is None in the result; the caller sets it after choosing a directory.
    """
    first = analyses[0].scenario
    common = {
        "schema_version": SCHEMA_VERSION,
        "scenario": first.name,
        "seed": first.seed,
    }
    ending = {"versions": versions(), "out": None}
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
    """Returns the summary of a stability report as text for a terminal."""
    return "\n\n".join(map(text, _summary(analyses, narrow=True).contents))


def report_figures(analyses: Sequence[LawAnalysis]) -> dict[str, Figure]:
    """Draws all figures of a report, by caption."""
    drawn = {}
    for each in analyses:
        before = f"{each.law}: " if len(analyses) > 1 else ""
        for section in each.sections:
            for figure in figures_of(section):
                drawn[before + figure.caption] = figure.draw()
    return drawn


def write_stability(
    analyses: Sequence[LawAnalysis], document: dict[str, Any], directory: Path
) -> None:
    """Writes the files of a stability analysis into an existing directory.

    - ``report.html`` is the report.
    - ``summary.json`` is the JSON document from ``stability_document``.
    - ``scenario.yaml`` is the scenario, and ``own_code`` has the user's own laws.
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
    own = [name for each in analyses for name in each.scenario.only.own_code]
    write_own_sources(own, directory)
    (directory / "summary.json").write_text(json.dumps(document) + "\n")
    (directory / "report.html").write_text(stability_page(analyses), "utf-8")


def stability_page(analyses: Sequence[LawAnalysis]) -> str:
    """Returns the complete stability report as one HTML page."""
    first = analyses[0].scenario
    laws = ", ".join(law_title(a.law).lower() for a in analyses)
    sections = [
        _summary(analyses),
        _model(analyses[0].sheet),
        *(_law(analysis, f"law{k}") for k, analysis in enumerate(analyses)),
    ]
    return page(
        f"Stability of {first.name}: {laws}",
        [(each.key, each.title) for each in sections],
        [html(each, each.key) for each in sections],
    )


def verdict_table(analyses: Sequence[LawAnalysis]) -> Table:
    """Returns the verdicts of all laws side by side."""
    laws = [analysis.law for analysis in analyses]
    rows: list[list[Cell]] = [
        [
            row.name,
            row.threshold,
            *(
                Judged(
                    _shown_value(row.values[law], row.unit, row.proven[law]),
                    row.verdicts[law],
                )
                for law in laws
            ),
            row.text,
        ]
        for row in compare_verdicts({a.law: a.verdicts for a in analyses})
    ]
    return Table(["criterion", "threshold", *laws, "in plain words"], rows)


def _narrow(table: Table) -> Iterator[Content]:
    """Yields a table of verdicts without the column "in plain words".

    This column is too wide for a terminal. Its texts about criteria that fail follow
    below the table.
    """
    columns, rows = ["", *table.columns[1:-1]], list(table.rows)
    if rows:
        yield Table(columns, [row[:-1] for row in rows])
    failed = [
        f"{row[0]}: {row[-1]}"
        for row in rows
        if any(isinstance(cell, Judged) and cell.verdict == "fail" for cell in row)
    ]
    if failed:
        yield "Why criteria fail:"
        yield Bullets(failed)


def _shown_value(
    value: float | None, unit: str, proven: float | None
) -> float | str | None:
    """Returns what a table shows: a number, its bounds, "yes" or "no"."""
    if value is not None and proven is not None:
        return f"{number(value)} to {number(proven)}"
    if value is None or unit != YES_OR_NO:
        return value
    return "yes" if value else "no"


def _summary(analyses: Sequence[LawAnalysis], *, narrow: bool = False) -> Section:
    """Returns the summary of the report; ``narrow`` is the form for a terminal."""
    sheet, table = analyses[0].sheet, verdict_table(analyses)
    notes = [
        note if len(analyses) == 1 else f"{law_title(analysis.law)}: {note}"
        for analysis in analyses
        for note in analysis.notes
    ]
    before: list[Content] = ["Before you use the numbers:", Bullets(notes)]
    origin = [
        ("Seed", str(sheet.seed)),
        ("Versions", ", ".join(f"{k} {v}" for k, v in sheet.versions.items())),
    ]
    contents: list[Content] = [
        Definitions(
            [
                ("Scenario", f"{sheet.scenario}: {sheet.description}"),
                *([] if narrow else origin),
            ]
        ),
        Bullets([_count(analysis) for analysis in analyses]),
        *(before if notes else []),
        *(_narrow(table) if narrow else [table]),
        *(
            f"{law_title(a.law)}: {a.found['recommended_gains'].advice}"
            for a in analyses
            if "recommended_gains" in a.found
        ),
    ]
    return Section("summary", "Summary", contents)


def _count(analysis: LawAnalysis) -> str:
    found = [verdict.verdict for verdict in analysis.verdicts]
    return (
        f"{law_title(analysis.law)}: {found.count('pass')} of "
        f"{len(found) - found.count('not applicable')} criteria pass."
    )


def _law(analysis: LawAnalysis, anchor: str) -> Section:
    sheet = analysis.sheet
    sections = [*analysis.sections, _verdicts(analysis.verdicts)]
    contents: list[Content] = [
        Links((f"{anchor}-{each.key}", each.title) for each in sections),
        *_equations(sheet.law_equations),
        _parameter_table([row for row in sheet.parameters if row.of_law]),
        f"SHA-256 of the effective scenario: `{sheet.scenario_sha256}`.",
        *(_drawn(analysis, each, f"{anchor}-{each.key}") for each in sections),
    ]
    return Section(anchor, law_title(analysis.law), contents)


def _drawn(analysis: LawAnalysis, section: Section, anchor: str) -> Markup:
    """Returns a section as HTML. If a figure fails, the section states the error."""
    try:
        return html(section, anchor, level=3)
    except Exception as error:  # noqa: BLE001  # the other sections must be shown
        failed = Note(f"This part failed: {analysis.fail(section.key, error)}.")
        return html(Section(section.key, section.title, [failed]), anchor, level=3)


def _verdicts(verdicts: Sequence[Verdict]) -> Section:
    table = Table.of(
        verdicts,
        {
            "criterion": "name",
            "value": lambda v: _shown_value(v.value, v.unit, v.proven),
            "where": "where",
            "threshold": "threshold",
            "verdict": "verdict",
            "in plain words": "text",
            "source": "source",
        },
    )
    return Section("verdicts", "Verdicts", [table])


def _model(sheet: ModelSheet) -> Section:
    """Returns the section with the part of the model sheet that all laws share."""
    latencies: list[list[Cell]] = []
    for path in sheet.paths:
        latencies.append([f"From {path} to wheels: {1e3 * sheet.latency_s(path):g} ms"])
        latencies += [
            [x.part, 1e3 * x.mean_s, x.remark]
            for x in sheet.latencies
            if x.path == path
        ]
    contents: list[Content] = [
        *_equations(sheet.motion),
        Bullets(sheet.assumptions),
        _parameter_table([row for row in sheet.parameters if not row.of_law]),
        Table(
            ["limit", "value", "unit", "remark"],
            [(x.quantity, x.value, x.unit, x.remark) for x in sheet.envelope],
            "Operating envelope",
        ),
        Table(["part", Column("mean", "ms"), "remark"], latencies, "Latency budget"),
    ]
    return Section("model", "Model sheet", contents)


def _equations(formulas: Sequence[Equation]) -> list[Content]:
    return [
        content
        for formula in formulas
        for content in (f"{formula.title}:", Formula(formula.tex, formula.text))
    ]


def _parameter_table(parameters: Sequence[ParameterRow]) -> Table:
    rows: list[list[Cell]] = []
    for part, group in groupby(parameters, key=lambda row: row.part):
        rows.append([part])
        rows += [
            [f"`{row.field}`", _shown(row.value, changed=row.changed), row.text]
            for row in group
        ]
    return Table(
        ["parameter", "value", "meaning, unit, source"],
        rows,
        "Parameters; an asterisk marks a value that is not the default",
    )


def _shown(value: Any, *, changed: bool) -> str:
    shown = number(value) if isinstance(value, float) else str(value)
    return f"{shown} *" if changed else shown
