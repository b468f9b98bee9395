"""Runs of one scenario under several laws, and the picture that shows all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from diagrams.scenario.laws_of_kind import chosen_names
from diagrams.scenario.loading import changed_scenario
from diagrams.scenario.run_parameters import Engine
from diagrams.scenario.scenario import Scenario
from phonotaxis.result import Prepared, Result, ignore
from phonotaxis.runs import RunResult, prepare_simulation
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["LawsResult", "simulate_laws"]


@dataclass(frozen=True, repr=False)
class LawsResult(Result):
    """Results of one scenario under several laws, with the same seed."""

    runs: dict[str, RunResult]
    """Result of each run, by law."""
    where: ClassVar[str] = "\nresults in {out}, report in {out}/report.html"

    def __repr__(self) -> str:
        ends = ", ".join(f"{law} {run.cause}" for law, run in self.runs.items())
        return f"<LawsResult {self.scenario.name}: {ends}>"

    def __getitem__(self, law: str) -> RunResult:
        return self.runs[law]

    @property
    def scenario(self) -> Scenario:
        """The scenario with the first law."""
        return next(iter(self.runs.values())).full_scenario

    def document(self) -> dict[str, Any]:
        """Returns the JSON document of ``phonotaxis simulate`` with several laws."""
        from analysis.views.laws_directory import laws_document

        return laws_document({law: run.document() for law, run in self.runs.items()})

    def __str__(self) -> str:
        """One row per law, for a terminal."""
        from analysis.views.laws_directory import laws_text

        return laws_text(self.runs, self.document())

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the scenario, each in one line and once."""
        notes = (note for run in self.runs.values() for note in run.notes)
        return tuple(dict.fromkeys(notes))

    def plot(self) -> Figure:
        """Draws the paths under all laws from above, in one picture."""
        from analysis.views.law_picture import plot_laws

        return plot_laws(self.runs)

    def figures(self) -> dict[str, Figure]:
        """Draws the figure of ``plot``, which is called ``laws``."""
        return {"laws": self.plot()}

    def write(
        self,
        document: dict[str, Any],
        directory: Path,
        *,
        pictures: bool = True,
        mcap: bool = False,
        csv: bool = False,
    ) -> None:
        """Writes the page, the picture, and one directory per law.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
            pictures: Whether to write the PNG and SVG files.
            mcap: Whether to write ``run.mcap`` of each run.
            csv: Whether to write ``trajectory.csv`` of each run.
        """
        from analysis.views.laws_directory import law_directories, write_laws

        for law, name in law_directories(self.runs).items():
            (directory / name).mkdir()
            run = self.runs[law]
            own = {**run.document(), "out": f"{document['out']}/{name}"}
            run.write(own, directory / name, pictures=pictures, mcap=mcap, csv=csv)
        write_laws(self.runs, document, directory, pictures=pictures)


def simulate_laws(
    scenario: Scenario | str | Path = "default",
    laws: str | Iterable[str] = "all",
    settings: Iterable[str] | Mapping[str, Any] = (),
    *,
    engine: Engine | None = None,
    progress: Callable[[float], None] | None = None,
    **fields: Any,
) -> LawsResult:
    """Runs a scenario once under each law, with the same seed.

    Example: ``simulate_laws("default", ["active", "guarded"]).plot()``.

    Args:
        scenario: Scenario from ``load_scenario``, name of a scenario in the library, or
            path of a YAML file.
        laws: Names of the laws, as a list or as one text with commas. ``all`` means
            every law for robots of this kind.
        settings: Fields of the scenario to change, as for ``load_scenario``.
        engine: Engine of the runs, as for ``simulate``.
        progress: Function that is called with the simulated time of all runs so far, s.
        **fields: Further fields of the scenario to change. They override ``settings``.

    Returns:
        Result with the run of each law.

    Raises:
        InputError: The scenario, a law or a file is not valid. The message names the
            field and the remedy.
    """
    whole = changed_scenario(scenario, settings, fields)
    return prepare_laws(with_laws(whole, laws), engine=engine).run(progress or ignore)


def with_laws(scenario: Scenario, laws: str | Iterable[str]) -> dict[str, Scenario]:
    """Returns a copy of a scenario for each law, by law; see ``simulate_laws``."""
    names = chosen_names(laws, scenario)
    if not names:
        raise InputError("laws", "has no names; give one or more, for example active")
    return {law: scenario.with_(law=law) for law in names}


def prepare_laws(
    scenarios: Mapping[str, Scenario], *, engine: Engine | None = None
) -> Prepared[LawsResult]:
    """Checks the scenarios of all laws, and builds what the runs need."""
    prepared = {
        law: prepare_simulation(scenario, engine=engine)
        for law, scenario in scenarios.items()
    }

    def run(progress: Callable[[float], None]) -> LawsResult:
        found: dict[str, RunResult] = {}
        for number, (law, each) in enumerate(prepared.items()):
            found[law] = each.run(_after(progress, number * each.total))
        return LawsResult(found)

    total = sum(each.total for each in prepared.values())
    return Prepared(run=run, total=total, unit="s simulated")


def _after(progress: Callable[[float], None], before: float) -> Callable[[float], None]:
    """Returns a progress function for work that follows earlier work."""
    return lambda done: progress(before + done)
