"""The stability report as one HTML page: the summary, then the parts of each law."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

from analysis.reporting.html_page import (
    Cell,
    Judged,
    bullets,
    definitions,
    equation,
    links,
    note,
    number,
    page,
    paragraph,
    section,
    table,
)
from analysis.run_error import failure_text
from analysis.stability.law_analysis import Finding, LawAnalysis
from analysis.stability.model_sheet import ModelSheet, ParameterRow
from analysis.stability.verdicts import VerdictRow, compare_verdicts, shown_value
from systems.laws.catalogue import law_title
from systems.laws.law import Equation


def stability_page(analyses: Sequence[LawAnalysis]) -> str:
    """Returns the complete stability report as one HTML page."""
    first = analyses[0].scenario
    laws = ", ".join(law_title(a.law).lower() for a in analyses)
    contents = [("summary", "Summary"), ("model", "Model sheet")]
    parts = [_summary(analyses), _model(analyses[0].sheet)]
    for k, analysis in enumerate(analyses):
        law = law_title(analysis.law)
        prefix = f"law{k}"
        contents.append((prefix, law))
        parts.append(section(prefix, law, _law_parts(analysis, prefix), fresh=True))
    return page(f"Stability of {first.name}: {laws}", contents, parts)


def _summary(analyses: Sequence[LawAnalysis]) -> str:
    verdicts = {a.law: a.verdicts for a in analyses}
    rows = compare_verdicts(verdicts)
    sheet = analyses[0].sheet
    about = definitions(
        [
            ("Scenario", f"{sheet.scenario}: {sheet.description}"),
            ("Seed", str(sheet.seed)),
            ("Versions", ", ".join(f"{k} {v}" for k, v in sheet.versions.items())),
        ]
    )
    counts = [
        f"{law_title(law)}: {sum(v.verdict == 'pass' for v in found)} of "
        f"{sum(v.verdict != 'not applicable' for v in found)} criteria pass."
        for law, found in verdicts.items()
    ]
    parts = [about, bullets(counts), *_notes(analyses)]
    parts.append(_verdict_table(rows, list(verdicts)))
    parts += [
        paragraph(f"{law_title(a.law)}: {gains.advice}")
        for a in analyses
        if (gains := a.data("recommended_gains"))
    ]
    return section("summary", "Summary", parts)


def _notes(analyses: Sequence[LawAnalysis]) -> list[str]:
    """Returns the notes that readers must know before they use the numbers.

    If the report covers several laws, each note begins with the name of its law.
    """
    found = [
        note_ if len(analyses) == 1 else f"{law_title(analysis.law)}: {note_}"
        for analysis in analyses
        for note_ in analysis.notes
    ]
    return [paragraph("Before you use the numbers:"), bullets(found)] if found else []


def _verdict_table(rows: Sequence[VerdictRow], laws: Sequence[str]) -> str:
    body: list[list[Cell]] = [
        [
            row.name,
            row.threshold,
            *(
                Judged(shown_value(row.values[law], row.unit), row.verdicts[law])
                for law in laws
            ),
            row.text,
        ]
        for row in rows
    ]
    return table(["criterion", "threshold", *laws, "in plain words"], body)


def _law_parts(analysis: LawAnalysis, prefix: str) -> list[str]:
    sheet = analysis.sheet
    parts = [
        links(
            (f"{prefix}-{key}", finding.part.title)
            for key, finding in analysis.findings.items()
        )
    ]
    parts += _equations(sheet.law_equations, prefix)
    parts.append(_parameter_table([row for row in sheet.parameters if row.of_law]))
    parts.append(
        paragraph(f"SHA-256 of the effective scenario: `{sheet.scenario_sha256}`.")
    )
    for key, finding in analysis.findings.items():
        parts.append(
            section(
                f"{prefix}-{key}",
                finding.part.title,
                _finding(analysis, finding, prefix),
                level=3,
                fresh=finding.part.fresh,
            )
        )
    return parts


def _finding(analysis: LawAnalysis, finding: Finding, prefix: str) -> list[str]:
    if finding.failed:
        return [note(f"This part failed: {finding.problem}.")]
    if finding.problem:
        return [note(f"Not computed: {finding.problem}.")]
    key = finding.part.key
    try:
        return finding.part.render(finding.data, f"{prefix}-{key}")
    except Exception as error:  # noqa: BLE001  # the other parts must be shown
        analysis.failures[key] = error
        return [note(f"This part failed: {failure_text(error)}.")]


def _model(sheet: ModelSheet) -> str:
    """Returns the section with the model sheet, which holds for every law."""
    parts = _equations(sheet.motion, "motion")
    parts.append(bullets(sheet.assumptions))
    parts.append(_parameter_table([row for row in sheet.parameters if not row.of_law]))
    parts.append(
        table(
            ["limit", "value", "unit", "remark"],
            [(x.quantity, x.value, x.unit, x.remark) for x in sheet.envelope],
            caption="Operating envelope",
        )
    )
    latencies: list[list[Cell]] = []
    for path in sheet.paths:
        latencies.append([f"From {path} to wheels: {1e3 * sheet.latency_s(path):g} ms"])
        latencies += [
            [x.part, 1e3 * x.mean_s, x.remark]
            for x in sheet.latencies
            if x.path == path
        ]
    parts.append(
        table(["part", "mean (ms)", "remark"], latencies, caption="Latency budget")
    )
    return section("model", "Model sheet", parts, fresh=True)


def _equations(formulas: Sequence[Equation], prefix: str) -> list[str]:
    return [
        part
        for k, formula in enumerate(formulas)
        for part in (
            paragraph(f"{formula.title}:"),
            equation(formula.tex, f"{prefix}-equation{k}", formula.text),
        )
    ]


def _parameter_table(parameters: Sequence[ParameterRow]) -> str:
    rows: list[list[Cell]] = []
    for part, group in groupby(parameters, key=lambda row: row.part):
        rows.append([part])
        rows += [
            [f"`{row.field}`", _shown(row.value, changed=row.changed), row.text]
            for row in group
        ]
    return table(
        ["parameter", "value", "meaning, unit, source"],
        rows,
        caption="Parameters; an asterisk marks a value that is not the default",
    )


def _shown(value: Any, *, changed: bool) -> str:
    text = number(value) if isinstance(value, float) else str(value)
    return f"{text} *" if changed else text
