"""``phonotaxis compare``: compares control laws on the same random layouts."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    SCENARIO_WORDS,
    completed_by,
    say,
    take_figures,
    take_laws,
    take_output,
    write_batch_files,
)
from phonotaxis.commands.command import Command, Take

if TYPE_CHECKING:
    from phonotaxis.batches import ComparisonResult
    from phonotaxis.result import Prepared


def _add_arguments(parser: ArgumentParser) -> None:
    scenario = parser.add_argument(
        "scenario",
        nargs="*",
        help="library name, or YAML file of layouts or of a scenario (default: the "
        "papers' four experiments)",
    )
    completed_by(scenario, SCENARIO_WORDS)
    take_laws(
        parser,
        "all: every law for robots of this kind (default: the papers' laws and none; "
        "for routes the laws of routes)",
    )
    parser.add_argument(
        "--velocity-term",
        metavar="TERM,...",
        help="printed, closing, or both (default: as in the scenario)",
    )
    parser.add_argument(
        "--runs", metavar="N", type=int, default=50, help="layouts per scenario (50)"
    )
    parser.add_argument("--seed", metavar="N", help="seed of layouts and noise (1)")
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="set any field, for example hearing=ideal; may be repeated",
    )
    parser.add_argument(
        "--grid",
        metavar="KEY=[VALUE,...]",
        action="append",
        default=[],
        help="compare values of a further field, for example hearing=[audio,ideal]",
    )
    parser.add_argument(
        "--workers", metavar="N", type=int, help="processes (default: one per core)"
    )
    parser.add_argument(
        "--resume", action="store_true", help="continue with the runs in --out"
    )
    take_figures(parser)
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[ComparisonResult]:
    from analysis.batches.comparison_plans import comparison_plans
    from analysis.batches.options import check_options

    check_options(options.out, workers=options.workers, resume=options.resume)
    plans = comparison_plans(
        options.scenario,
        laws=options.law or None,
        velocity_terms=options.velocity_term,
        runs=options.runs,
        seed=options.seed,
        settings=options.set,
        grid=options.grid,
    )
    for plan in plans.values():
        plan.check()
    say(f"comparing laws in {', '.join(plans)}")

    from phonotaxis.batches import prepare_compare

    return prepare_compare(
        plans, options.out, workers=options.workers, resume=options.resume
    )


COMMAND = Command(
    "compare",
    "compare laws on the same random layouts",
    _add_arguments,
    _prepare,
    where="\nresults in {out}, report in {out}/report.html",
    write=write_batch_files,
    examples=(
        "compare two_static_obstacles --laws conventional,active --runs 20",
        "compare --set hearing=ideal --velocity-term printed,closing",
        "compare u_trap clutter --laws guarded,dwa,orca --out results/laws",
    ),
)
