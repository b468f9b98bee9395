"""``phonotaxis compare``: compares control laws on the same random layouts."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    SCENARIO_WORDS,
    completed_by,
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
    take_seed(parser, "seed of layouts and noise (default: 1)")
    take_settings(parser, "; with a comma, both are compared")
    parser.add_argument(
        "--grid",
        metavar="KEY=[VALUE,...]",
        action="append",
        default=[],
        help="compare values of a further field, for example hearing=[audio,ideal]",
    )
    take_batch(parser, "layouts per scenario (default: 50)")
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[ComparisonResult]:
    from analysis.batches.comparison_plans import comparison_plans
    from analysis.batches.options import check_options

    check_options(options.out, workers=options.workers, resume=options.resume)
    plans = comparison_plans(
        options.scenario,
        laws=options.law or None,
        runs=50 if options.runs is None else options.runs,
        seed=whole_seed(options, 1),
        settings=settings_of(options),
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
    examples=(
        "compare two_static_obstacles --laws conventional,active --runs 20",
        "compare --set hearing=ideal --velocity-term printed,closing",
        "compare u_trap clutter --laws guarded,dwa,orca --out results/laws",
    ),
)
