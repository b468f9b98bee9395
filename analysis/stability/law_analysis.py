"""Stability analysis of the law of a scenario, part by part.

A part is one analysis. It has a function that computes a data object, and a function
that shows the object as contents of a section of the report. The parts run in order,
and a part may use the data of earlier parts. If a part does not apply to a law or to a
scenario, its section states the reason. The other parts still run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from analysis.loops.linear_models import LinearModel
from analysis.report.criterion import Criterion, Verdict
from analysis.report.section import Content, Note, Section
from analysis.run_error import failure_text
from analysis.stability.model_sheet import ModelSheet, model_sheet
from diagrams import Scenario
from systems.framework.input_error import InputError

Data = TypeVar("Data")


@dataclass(frozen=True)
class Study:
    """The inputs of a part: the scenario and the data of earlier parts."""

    scenario: Scenario
    """The scenario with the law to analyze."""
    full: bool = False
    """Whether the report is full: simulations that check the results are longer, or
    there are more of them."""
    found: dict[str, Any] = field(default_factory=dict)
    """Data objects of earlier parts, by key. A part without a result has no entry."""

    def need(self, key: str) -> Any:
        """Returns the data of an earlier part; InputError if the part has no result."""
        if key not in self.found:
            raise InputError(
                f"{key}",
                "has no result, and this part depends on it; correct the problem "
                "of that part first",
            )
        return self.found[key]


@dataclass(frozen=True)
class Part(Generic[Data]):
    """One analysis, which becomes a section of the report."""

    key: str
    """Name of the section in the JSON document and in links."""
    title: str
    compute: Callable[[Study], Data]
    """Computes the data object. If the part does not apply, the function raises an
    InputError with the reason."""
    show: Callable[[Data], Sequence[Content]]
    """Returns the contents of the section, in the order in which they are read."""
    criteria: tuple[Criterion[Data], ...] = ()
    """Criteria that judge numbers of the data object."""
    document: Callable[[Data], Any] | None = None
    """Returns what the JSON document states. If this field is None, the document states
    the whole data object."""
    models: Callable[[Data], Sequence[LinearModel]] = lambda data: ()
    """Returns the linear models that are written to files."""
    notes: Callable[[Data], Sequence[str]] = lambda data: ()
    """Returns notes that readers must know before they use the numbers."""

    def section(self, data: Data) -> Section:
        """Returns the section of the report about a data object."""
        return Section(
            self.key,
            self.title,
            self.show(data),
            self.document(data) if self.document else data,
            tuple(criterion.judge(data) for criterion in self.criteria),
        )

    def problem(self, text: str, *, failed: bool = False) -> Section:
        """Returns the section of a part that has no result.

        ``text`` is the reason, which the section states. ``failed`` is true if the
        reason is a fault of the program, and false if it lies in the law or scenario.
        """
        words = "This part failed" if failed else "Not computed"
        return Section(
            self.key,
            self.title,
            [Note(f"{words}: {text}.")],
            {"problem": text} | ({"failed": True} if failed else {}),
            tuple(
                criterion.without_number(f"the part '{self.title}' has no result")
                for criterion in self.criteria
            ),
        )


@dataclass(frozen=True)
class LawAnalysis:
    """The complete stability analysis of one law."""

    scenario: Scenario
    sheet: ModelSheet
    sections: list[Section] = field(default_factory=list)
    """Sections of all parts, in the order of the parts."""
    found: dict[str, Any] = field(default_factory=dict)
    """Data objects by key of the part. A part without a result has no entry."""
    models: list[LinearModel] = field(default_factory=list)
    """Linear models of all parts, which are written to files."""
    notes: list[str] = field(default_factory=list)
    """Notes of all parts for the first page, each a sentence."""
    computing_time_s: dict[str, float] = field(default_factory=dict)
    """Computing time by key of the part."""
    failures: dict[str, Exception] = field(default_factory=dict)
    """Unexpected exceptions by key of the part that raised them."""

    @property
    def law(self) -> str:
        """Name of the law in the scenario."""
        return self.scenario.only.law

    @property
    def verdicts(self) -> Sequence[Verdict]:
        """Verdicts of all sections."""
        return [verdict for each in self.sections for verdict in each.verdicts]

    def fail(self, key: str, error: Exception) -> str:
        """Records an unexpected exception of a part. Returns a description in one line.

        ``key`` is the key of the part.
        """
        self.failures[key] = error
        return failure_text(error)


def analyze_law(
    scenario: Scenario,
    parts: Sequence[Part[Any]],
    *,
    full: bool = False,
    step: Callable[[str], None] = lambda title: None,
) -> LawAnalysis:
    """Runs the parts of the stability analysis for the law of a scenario, in order.

    The scenario may have exact or realistic sensors; each part replaces them as it
    needs. ``full`` is that of ``Study``. ``step`` is called with the title of each part
    before the part runs. If a part raises an exception, its section states the reason,
    and the next part runs. An exception of the first part ends the analysis and is
    raised, because the other parts depend on the first part.
    """
    analysis = LawAnalysis(scenario, model_sheet(scenario))
    analysis.notes.extend(_bodies_held_at_rest(scenario))
    study = Study(scenario, full, analysis.found)
    for part in parts:
        step(part.title)
        start = time.perf_counter()
        analysis.sections.append(_run(part, study, analysis))
        analysis.computing_time_s[part.key] = round(time.perf_counter() - start, 3)
    return analysis


def _bodies_held_at_rest(scenario: Scenario) -> Iterator[str]:
    """Yields a note about the bodies that move in the scenario, if there are any."""
    moving = [each for each in scenario.obstacles if each.path().moves]
    if moving:
        places = [
            f"{each.name} at ({each.waypoints_m[0][0]:g}, {each.waypoints_m[0][1]:g}) m"
            for each in moving
        ]
        yield (
            f"{', '.join(each.name for each in moving)} can move; this whole report is "
            f"about bodies at rest where they start: {', '.join(places)}. A run can "
            "end in a collision that no number here excludes."
        )


def _run(part: Part[Any], study: Study, analysis: LawAnalysis) -> Section:
    try:
        data = part.compute(study)
        section = part.section(data)
        analysis.models.extend(part.models(data))
        analysis.notes.extend(part.notes(data))
    except InputError as error:
        if not analysis.sections:
            raise
        return part.problem(str(error))
    except Exception as error:  # the other parts must go on
        if not analysis.sections:
            raise
        return part.problem(analysis.fail(part.key, error), failed=True)
    analysis.found[part.key] = data
    return section
