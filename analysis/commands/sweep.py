"""``phonotaxis sweep``: runs variants of a scenario, from a grid and random draws."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

from analysis.commands.arguments import take_output
from analysis.commands.command import Command, Job, Take
from analysis.commands.first_words import say

if TYPE_CHECKING:
    import pandas as pd


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
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Job[pd.DataFrame]:
    from analysis.sweeps.options import check_options
    from analysis.sweeps.plan import load_sweep

    check_options(
        options.out,
        workers=options.workers,
        scheduler=options.scheduler,
        resume=options.resume,
    )
    plan = load_sweep(options.sweep)
    plan.check()
    say(f"sweeping {options.sweep}")

    from analysis.sweeps.one_run import require_runs
    from analysis.sweeps.page import write_sweep
    from analysis.sweeps.summary import sweep_summary, sweep_text
    from analysis.sweeps.sweep import prepare_sweep

    sweep = prepare_sweep(
        plan,
        options.out,
        workers=options.workers,
        scheduler=options.scheduler,
        resume=options.resume,
    )
    points, out = sweep.points, sweep.store.out

    def write(results: pd.DataFrame, summary: dict[str, Any]) -> None:
        write_sweep(plan, points, results, summary)
        require_runs([results], out)

    return Job(
        run=sweep.run,
        summary=lambda results: sweep_summary(plan, points, results, out),
        text=lambda results, _: sweep_text(plan, results),
        out=out,
        write=write,
        where="\nresults in {out}, report in {out}/report.html",
        total=len(points),
        unit="runs",
        kept=lambda: len(sweep.store.done),
    )


COMMAND = Command(
    "sweep",
    "run many scenarios that are drawn from distributions and grids",
    _add_arguments,
    _prepare,
    examples=(
        "sweep docs/examples/crossing.yaml",
        "sweep docs/examples/crossing.yaml --out results/crossing --resume",
    ),
)
