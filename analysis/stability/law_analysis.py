"""Stability analysis of a scenario's law, part by part.

A part is one analysis with its place in the report: what computes its data
object, and what sets the object as HTML. Parts run in order, and a part may use
what earlier ones found. A part that a law or a scenario cannot have says so in
its place and does not stop the others.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from analysis.models.linear_models import LinearModel
from analysis.run_error import failure_text
from analysis.stability.model_sheet import ModelSheet, model_sheet
from analysis.stability.verdicts import Verdict
from diagrams import Scenario
from systems.framework.input_error import InputError


@dataclass(frozen=True)
class Study:
    """What a part may use."""

    scenario: Scenario
    """With the law to analyse."""
    found: dict[str, Any] = field(default_factory=dict)
    """Data objects of earlier parts, by key; none where there is a problem."""

    def need(self, key: str) -> Any:
        """Data object of an earlier part.

        Raises:
            InputError: It has none.
        """
        if self.found.get(key) is None:
            raise InputError(
                f"{key}",
                "has no result, and this part depends on it; correct the problem "
                "of that part first",
            )
        return self.found[key]


@dataclass(frozen=True)
class Part:
    """One analysis and its place in the report."""

    key: str
    """Name in the JSON document and in links."""
    title: str
    compute: Callable[[Study], Any]
    """Raises InputError where there is nothing to compute, and says why."""
    render: Callable[[Any, str], list[str]]
    """Pieces of HTML from the data and a prefix for names of figures."""
    fresh: bool = False
    """Whether it begins a sheet of paper."""
    document: Callable[[Any], dict[str, Any]] | None = None
    """Entries of the JSON document; none: the data as it is, under the key."""
    models: Callable[[Any], Sequence[LinearModel]] | None = None
    """Linear models that are written as files."""
    notes: Callable[[Any], Sequence[str]] | None = None
    """What the first page must say before the numbers; none: nothing."""


@dataclass(frozen=True)
class Finding:
    """What came of a part."""

    part: Part
    data: Any | None
    problem: str
    """Why there is no data; empty where there is."""
    seconds: float
    """Time that it took, s."""
    failed: bool = False
    """Whether the problem is a fault of the program, none of law or scenario."""


@dataclass(frozen=True)
class LawAnalysis:
    """All about one law."""

    scenario: Scenario
    sheet: ModelSheet
    findings: dict[str, Finding]
    failures: dict[str, Exception] = field(default_factory=dict)
    """What parts raised that is no complaint about law or scenario, by key."""

    @property
    def law(self) -> str:
        """As the scenario names it."""
        return self.scenario.only.law

    @property
    def models(self) -> tuple[LinearModel, ...]:
        """Of all parts, for files."""
        return tuple(
            model
            for finding in self.findings.values()
            if finding.part.models and not finding.problem
            for model in finding.part.models(finding.data)
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Of all parts, for the first page; sentences."""
        return tuple(
            note
            for finding in self.findings.values()
            if finding.part.notes and not finding.problem
            for note in finding.part.notes(finding.data)
        )

    @property
    def verdicts(self) -> Sequence[Verdict]:
        """Of the last part; none where it has no result."""
        return self.data("verdicts") or ()

    def data(self, key: str) -> Any | None:
        """Data object of a part, none if it was left out or failed."""
        finding = self.findings.get(key)
        return finding and finding.data


def analyse_law(
    scenario: Scenario,
    parts: Sequence[Part],
    *,
    step: Callable[[str], None] = lambda title: None,
) -> LawAnalysis:
    """Runs the parts for the scenario's law.

    Args:
        scenario: With any fidelity; parts choose theirs.
        parts: In order.
        step: Called with the title of each part before it runs.

    Returns:
        Findings by key of the part; one that has no result says why.

    Raises:
        InputError: The very first part, without which the others are nothing,
            has no result. What else it raises, it raises too.
    """
    study = Study(scenario)
    analysis = LawAnalysis(scenario, model_sheet(scenario), {})
    for part in parts:
        step(part.title)
        finding = _run(part, study, analysis)
        analysis.findings[part.key] = finding
        study.found[part.key] = finding.data
    return analysis


def _run(part: Part, study: Study, analysis: LawAnalysis) -> Finding:
    start, data, problem, failed = time.perf_counter(), None, "", False
    try:
        data = part.compute(study)
    except InputError as error:
        if not analysis.findings:
            raise
        problem = str(error)
    except Exception as error:  # the other parts must go on
        if not analysis.findings:
            raise
        analysis.failures[part.key] = error
        problem, failed = failure_text(error), True
    return Finding(part, data, problem, time.perf_counter() - start, failed)
