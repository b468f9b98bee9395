"""``phonotaxis accuracy``: localization errors of the papers and of this package."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from analysis.commands.arguments import take_output
from analysis.commands.command import Command, Job, Take
from analysis.commands.first_words import say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.hearing.localization import LocalizationCell


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "--trials",
        metavar="N",
        type=int,
        default=100,
        help="measurements per cell (100)",
    )
    parser.add_argument("--seed", metavar="N", help="seed of all random numbers")
    parser.add_argument(
        "--tolerances",
        action="store_true",
        help="redraw errors of the array for every measurement, within 0.2 mm, "
        "0.2 us and 0.2 %% of the speed of sound",
    )
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Job[Sequence[LocalizationCell]]:
    from analysis.hearing.trial_counts import check_trials
    from diagrams.scenario.loading import load_scenario

    place = take(options.out)
    overrides = [] if options.seed is None else [f"seed={options.seed}"]
    load_scenario("default", overrides)
    check_trials(options.trials)
    say("measuring how well the robot locates sounds")

    from analysis.hearing.localization import prepare_localization
    from analysis.hearing.localization_report import (
        localization_summary,
        localization_text,
        write_localization,
    )

    experiment = prepare_localization(
        overrides,
        trials=options.trials,
        tolerances=options.tolerances,
    )
    return Job(
        run=experiment.run,
        summary=lambda cells: localization_summary(experiment, cells, place.out),
        text=lambda _, summary: localization_text(summary),
        out=place.out,
        write=lambda cells, summary: write_localization(
            experiment, cells, summary, place.directory
        ),
        total=experiment.measurements,
        unit="measurements",
    )


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
    was="localization",
)
