"""Analysis of control loops: the stability report, and the design of gains."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.run_error import RunError
from analysis.stability import report_parts
from analysis.stability.choice import chosen_laws, chosen_robot
from analysis.stability.design_plots import plot_design
from analysis.stability.design_study import STUDY_RUNS, DesignStudy, study_design
from analysis.stability.design_text import design_document, design_text, write_design
from analysis.stability.law_analysis import LawAnalysis, analyze_law
from analysis.stability.report_files import (
    report_figures,
    stability_document,
    stability_text,
    write_stability,
)
from diagrams.building.laws import make_controller
from diagrams.scenario.loading import changed_scenario
from diagrams.scenario.scenario import Scenario
from diagrams.scenario.scenario_files import check_files
from diagrams.scenario.suggestions import Laws, law_names
from phonotaxis.result import Prepared, Result, ignore
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    import control
    from matplotlib.figure import Figure

__all__ = ["DesignResult", "StabilityResult", "design", "stability"]


@dataclass(frozen=True, repr=False)
class StabilityResult(Result):
    """Stability of a scenario's control loop, under one law or several laws."""

    analyses: list[LawAnalysis]
    """One analysis per law."""
    robots_left_out: str = ""
    """Note that names the robots that are not analyzed; empty if there are none."""

    def __repr__(self) -> str:
        laws = ", ".join(each.law for each in self.analyses)
        return f"<StabilityResult {self.analyses[0].scenario.name}: {laws}>"

    def document(self) -> dict[str, Any]:
        """Returns the JSON document of ``phonotaxis stability``."""
        return stability_document(self.analyses)

    def __str__(self) -> str:
        """Verdicts on the stability, for a terminal."""
        return stability_text(self.analyses)

    @property
    def notes(self) -> tuple[str, ...]:
        """Which robots are left out, and the notes of the analyses."""
        notes = [note for each in self.analyses for note in each.notes]
        return tuple(dict.fromkeys(filter(None, [self.robots_left_out, *notes])))

    def state_space(self, model: str = "", law: str = "") -> control.StateSpace:
        """Returns a linear model of the report as a system of ``control``.

        Args:
            model: Name of the model, or a part of the name that no other model has.
                Empty means the first model: the loop in continuous time.
            law: Name of the law. Empty means the first law of the report.

        Returns:
            The model with named inputs, outputs and states. All values are deviations
            from the operating point, in SI units.

        Raises:
            InputError: There is no such law or no such model. The message lists the
                names.
        """
        analyses = {each.law: each for each in self.analyses}
        chosen = analyses.get(law or self.analyses[0].law)
        if chosen is None:
            raise InputError(
                "law", f"{law!r} is not analyzed; use {', '.join(analyses)}"
            )
        exact = [each for each in chosen.models if each.name == model]
        found = exact or [each for each in chosen.models if model in each.name]
        if not found or (model and len(found) > 1):
            names = ", ".join(repr(each.name) for each in chosen.models) or "none"
            raise InputError("model", f"{model!r} is not a model; there are: {names}")
        return found[0].to_control()

    def failure(self, out: Path | None) -> RunError | None:
        """Returns an error if faults of the program made parts of the report fail."""
        failures = [each for one in self.analyses for each in one.failures.items()]
        if not failures:
            return None
        names, page = ", ".join(key for key, _ in failures), "report.html"
        error = RunError(
            f"parts of the report failed: {names}; {out / page if out else page} "
            "states the errors (--debug prints the traceback)"
        )
        error.__cause__ = failures[0][1]
        return error

    def plot(self) -> dict[str, Figure]:
        """Draws the figures of the report, by caption."""
        return report_figures(self.analyses)

    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes the report, the JSON document, the scenario and the linear models.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
        """
        write_stability(self.analyses, document, directory)


@dataclass(frozen=True, repr=False)
class DesignResult(Result):
    """Gains of the laws for a scenario, and a recommended attraction.

    The attraction is the virtual spring and damper that pull the robot to its target.
    """

    study: DesignStudy

    def __repr__(self) -> str:
        return f"<DesignResult {self.study.today.scenario.name}>"

    def document(self) -> dict[str, Any]:
        """Returns the JSON document of ``phonotaxis design``."""
        return design_document(self.study)

    def __str__(self) -> str:
        """Requirements and gains, for a terminal."""
        return design_text(self.study)

    def plot(self) -> Figure:
        """Draws the trade-offs of the design."""
        return plot_design(self.study)

    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes the JSON document, two scenarios and two pictures.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
        """
        write_design(self.study, document, directory)


def stability(
    scenario: Scenario | str | Path = "default",
    *,
    laws: Laws = (),
    robot: str | None = None,
    full: bool = False,
    settings: Iterable[str] | Mapping[str, Any] = (),
    progress: Callable[[str], None] | None = None,
    **fields: Any,
) -> StabilityResult:
    """Analyzes the stability of a scenario's control loop.

    If the scenario has several robots, only one robot is analyzed. The logger
    ``phonotaxis`` then warns with the names of the other robots. The attribute
    ``notes`` of the result also names them.

    Args:
        scenario: Scenario from ``load_scenario``, name of a scenario in the library, or
            path of a YAML file.
        laws: Names of the control laws to compare, as a list or as one text with
            commas. Functions and classes may replace names. ``all`` means all laws that
            avoid obstacles, or all laws for routes. An empty list means the law of the
            scenario.
        robot: Name of the robot to analyze. None means the first robot.
        full: Whether to check the analysis by more and longer simulations.
        settings: Fields of the scenario to change, as for ``load_scenario``.
        progress: Function that is called before the computation of each part of the
            report, with the name of this part.
        **fields: Further fields of the scenario to change. They override ``settings``.
            ``law`` has the meaning of ``laws``.

    Returns:
        Data of all parts of the report, and the verdicts on the stability.

    Raises:
        InputError: The law or the robot does not exist, or the robot has no linear
            model.
    """
    names = [*law_names(laws), *law_names(fields.pop("law", ()))]
    scenario = changed_scenario(scenario, settings, fields)
    alone, note = chosen_robot(scenario, robot)
    prepared = prepare_stability(chosen_laws(alone, names), note, full=full)
    return prepared.run(progress or ignore)


def prepare_stability(
    scenarios: Sequence[Scenario], note: str, *, full: bool = False
) -> Prepared[StabilityResult]:
    """Checks the laws of a stability report; see ``stability``.

    Args:
        scenarios: The same scenario of one robot with each of the laws.
        note: Note that names the robots that are not analyzed; empty if there are none.
        full: Whether to check the analysis by more and longer simulations.

    Returns:
        The work, which returns the result of ``stability``.
    """
    if note:
        logging.getLogger("phonotaxis").warning("%s", note)
    for each in scenarios:
        check_files(each)
        make_controller(each)
    work = report_parts.parts_for(scenarios)

    def run(step: Callable[[str], None]) -> StabilityResult:
        analyses = [analyze_law(each, work, full=full, step=step) for each in scenarios]
        return StabilityResult(analyses, note)

    return Prepared(run=run, total=len(work) * len(scenarios), unit="parts")


def design(
    scenario: Scenario | str | Path = "default",
    settings: Iterable[str] | Mapping[str, Any] = (),
    *,
    progress: Callable[[float], None] | None = None,
    **fields: Any,
) -> DesignResult:
    """Derives gains of the laws from stated requirements.

    The attraction is the virtual spring and damper that pull the robot to its target.
    The function computes gains for the attraction of the scenario. It also recommends
    another attraction, and computes gains for this one.

    Args:
        scenario: Scenario from ``load_scenario``, name of a scenario in the library, or
            path of a YAML file.
        settings: Fields of the scenario to change, as for ``load_scenario``.
        progress: Function that is called with the number of finished test runs.
        **fields: Further fields of the scenario to change. They override ``settings``.

    Returns:
        For both attractions, the gains and the resulting performance.

    Raises:
        InputError: The scenario is not valid or has several robots, or no gains meet a
            requirement that must be met.
    """
    scenario = changed_scenario(scenario, settings, fields)
    return prepare_design(scenario).run(progress or ignore)


def prepare_design(scenario: Scenario) -> Prepared[DesignResult]:
    """Checks the files of a scenario; see ``design``."""
    check_files(scenario)
    return Prepared(
        run=lambda progress: DesignResult(study_design(scenario, progress=progress)),
        total=STUDY_RUNS,
        unit="runs",
    )
