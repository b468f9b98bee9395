"""``phonotaxis sweep``: runs variants of a scenario, from a grid and random draws."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    say,
    take_figures,
    take_output,
    write_batch_files,
)
from phonotaxis.commands.command import Command, Take

if TYPE_CHECKING:
    from phonotaxis.batches import SweepResult
    from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("sweep", metavar="SWEEP.yaml", help="see docs/compare.md")
    parser.add_argument(
        "--workers",
        metavar="N",
        type=int,
        help="local processes (default: one per core)",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address of a Dask cluster, for example tcp://host:8786",
    )
    parser.add_argument(
        "--resume", action="store_true", help="continue with the runs in --out"
    )
    take_figures(parser)
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[SweepResult]:
    from analysis.batches.options import check_options
    from analysis.batches.plan import load_sweep

    check_options(
        options.out,
        workers=options.workers,
        scheduler=options.scheduler,
        resume=options.resume,
    )
    plan = load_sweep(options.sweep)
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
    write=write_batch_files,
    examples=(
        "sweep docs/examples/crossing.yaml",
        "sweep docs/examples/crossing.yaml --out results/crossing --resume",
    ),
)
