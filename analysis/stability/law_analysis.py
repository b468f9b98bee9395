"""Stability analysis of the law of a scenario, part by part.

A part is one analysis and its section in the report. A part has one function that
computes a data object and one function that writes the object as HTML. The parts run in
order, and a part may use the data of earlier parts. If a part does not apply to a law
or to a scenario, its section states the reason. The other parts still run.
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
    """The inputs of a part: the scenario and the data of earlier parts."""

    scenario: Scenario
    """The scenario with the law to analyze."""
    found: dict[str, Any] = field(default_factory=dict)
    """Data objects of earlier parts, by key. None for a part without a result."""

    def need(self, key: str) -> Any:
        """Returns the data object of an earlier part.

        Args:
            key: Key of the earlier part.

        Returns:
            The data object.

        Raises:
            InputError: The earlier part has no result.
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
    """One analysis and its section in the report."""

    key: str
    """Name of the part in the JSON document and in links."""
    title: str
    compute: Callable[[Study], Any]
    """Computes the data object. If the part does not apply, the function raises an
    InputError with the reason."""
    render: Callable[[Any, str], list[str]]
    """Makes pieces of HTML from the data object and from a prefix for the names of
    figures."""
    fresh: bool = False
    """Whether the section begins on a new page of paper."""
    document: Callable[[Any], dict[str, Any]] | None = None
    """Makes the entries of the JSON document from the data object. If this field is
    None, the data object is the only entry, and its key is the key of the part."""
    models: Callable[[Any], Sequence[LinearModel]] | None = None
    """Returns the linear models that are written to files. If this field is None, the
    part has no models."""
    notes: Callable[[Any], Sequence[str]] | None = None
    """Returns notes that readers must know before they use the numbers. If this field
    is None, the part has no notes."""


@dataclass(frozen=True)
class Finding:
    """The result of one part, or the reason why the part has no result."""

    part: Part
    data: Any | None
    problem: str
    """Reason why there is no data object. Empty if there is one."""
    seconds: float
    """Computing time of the part, s."""
    failed: bool = False
    """Whether the part has no result because of a fault of the program. The fault is
    then not in the law or in the scenario."""


@dataclass(frozen=True)
class LawAnalysis:
    """The complete stability analysis of one law."""

    scenario: Scenario
    sheet: ModelSheet
    findings: dict[str, Finding]
    failures: dict[str, Exception] = field(default_factory=dict)
    """Unexpected exceptions, by key of the part that raised them."""

    @property
    def law(self) -> str:
        """Name of the law in the scenario."""
        return self.scenario.only.law

    @property
    def models(self) -> tuple[LinearModel, ...]:
        """Linear models of all parts, which are written to files."""
        return tuple(
            model
            for finding in self.findings.values()
            if finding.part.models and not finding.problem
            for model in finding.part.models(finding.data)
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes of all parts for the first page, each a sentence."""
        return tuple(
            note
            for finding in self.findings.values()
            if finding.part.notes and not finding.problem
            for note in finding.part.notes(finding.data)
        )

    @property
    def verdicts(self) -> Sequence[Verdict]:
        """Verdicts of the last part. Empty if this part has no result."""
        return self.data("verdicts") or ()

    def data(self, key: str) -> Any | None:
        """Returns the data object of a part, or None if the part has no result."""
        finding = self.findings.get(key)
        return finding and finding.data


def analyse_law(
    scenario: Scenario,
    parts: Sequence[Part],
    *,
    step: Callable[[str], None] = lambda title: None,
) -> LawAnalysis:
    """Runs the parts of the stability analysis for the law of a scenario.

    Args:
        scenario: The scenario with the law. The sensors may be exact or realistic,
            because each part chooses its own sensors.
        parts: The parts, in the order in which they run.
        step: Function that is called with the title of each part before the part runs.

    Returns:
        The analysis, with one finding per part. If a part has no result, its finding
        states the reason.

    Raises:
        InputError: The first part has no result. All other parts depend on this part.
            If the first part raises another exception, this exception is also raised.
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
