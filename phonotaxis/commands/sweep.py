"""``phonotaxis sweep``: runs variants of a scenario, from a grid and random draws."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    say,
    settings_of,
    take_batch,
    take_laws,
    take_output,
    take_seed,
    take_settings,
    whole_seed,
)
from phonotaxis.commands.command import Command, Take

if TYPE_CHECKING:
    from phonotaxis.batches import SweepResult
    from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("sweep", metavar="SWEEP.yaml", help="see docs/compare.md")
    take_laws(
        parser,
        "all: every law for robots of this kind (default: as in the file)",
    )
    take_seed(parser, "seed of all draws (default: as in the file)")
    take_settings(parser, "; with a comma, both are compared")
    take_batch(parser, "runs in each cell of the grid (default: as in the file)")
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address of a Dask cluster, for example tcp://host:8786",
    )
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[SweepResult]:
    from analysis.batches.changed_plan import changed_plan
    from analysis.batches.options import check_options
    from analysis.batches.plan import load_sweep

    check_options(
        options.out,
        workers=options.workers,
        scheduler=options.scheduler,
        resume=options.resume,
    )
    plan = changed_plan(
        load_sweep(options.sweep),
        laws=options.law,
        runs=options.runs,
        seed=whole_seed(options, None),
        settings=settings_of(options),
    )
    plan.check()
    say(f"sweeping {options.sweep}")

    from phonotaxis.batches import prepare_sweep

    return prepare_sweep(
        plan,
        options.out,
        workers=options.workers,
        scheduler=options.scheduler,
        resume=options.resume,
    )


COMMAND = Command(
    "sweep",
    "run many scenarios that are drawn from distributions and grids",
    _add_arguments,
    _prepare,
    where="\nresults in {out}, report in {out}/report.html",
    examples=(
        "sweep docs/examples/crossing.yaml",
        "sweep docs/examples/crossing.yaml --out results/crossing --resume --runs 200",
        "sweep docs/examples/crossing.yaml --law active,guarded --set hearing=ideal",
    ),
)
