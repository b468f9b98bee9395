"""``phonotaxis accuracy``: localization errors, beside those in the papers."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from phonotaxis.commands.arguments import (
    say,
    take_output,
    take_seed,
    whole_seed,
)
from phonotaxis.commands.command import Command, Take
from phonotaxis.result import Prepared, Result

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.figure import Figure

    from analysis.arrays.localization import LocalizationCell, LocalizationExperiment


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "--trials",
        metavar="N",
        type=int,
        default=100,
        help="measurements per cell (100)",
    )
    take_seed(parser)
    parser.add_argument(
        "--tolerances",
        action="store_true",
        help="redraw errors of the array for every measurement, within 0.2 mm, "
        "0.2 us and 0.2 %% of the speed of sound",
    )
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[AccuracyResult]:
    from analysis.arrays.trial_counts import check_trials
    from diagrams.scenario.loading import load_scenario

    take(options.out)
    seed = whole_seed(options, None)
    overrides = [] if seed is None else [f"seed={seed}"]
    load_scenario("default", overrides)
    check_trials(options.trials)
    say("measuring how well the robot locates sounds")

    from analysis.arrays.localization import prepare_localization

    experiment = prepare_localization(
        overrides,
        trials=options.trials,
        tolerances=options.tolerances,
    )
    return Prepared(
        run=lambda progress: AccuracyResult(experiment, experiment.run(progress)),
        total=experiment.measurements,
        unit="measurements",
    )


@dataclass(frozen=True)
class AccuracyResult(Result):
    """Errors of the localization, over ranges and bearings of the source."""

    experiment: LocalizationExperiment
    cells: Sequence[LocalizationCell]

    @cached_property
    def _document(self) -> dict[str, Any]:
        from analysis.arrays.localization_report import localization_document

        return localization_document(self.experiment, self.cells)

    def document(self) -> dict[str, Any]:
        """Returns the JSON document of ``phonotaxis accuracy``."""
        return self._document

    def __str__(self) -> str:
        """Tables for a terminal."""
        from analysis.arrays.localization_report import localization_text

        return localization_text(self._document)

    def plot(self) -> Figure:
        """Draws the errors beside those of the papers."""
        from analysis.arrays.localization_plots import plot_localization

        return plot_localization(self.cells)

    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes ``scenario.yaml``, ``summary.json`` and ``localization.png``.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
        """
        from analysis.arrays.localization_report import write_localization

        write_localization(self.experiment, self.cells, document, directory)


COMMAND = Command(
    "accuracy",
    "measure how well the robot locates sounds, against the papers' tables and the "
    "bound",
    _add_arguments,
    _prepare,
    examples=(
        "accuracy",
        "accuracy --trials 20 --tolerances",
    ),
    synonyms=("localization",),
)
