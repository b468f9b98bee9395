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
    worlds = parser.add_argument(
        "--worlds",
        metavar="PATH",
        nargs="?",
        const="shipped",
        help="compare in the worlds of this folder (docs/worlds.md); without PATH, in "
        "the worlds that come with phonotaxis",
    )
    completed_by(worlds, "directory")
    parser.add_argument(
        "--every",
        metavar="N",
        type=int,
        help="only worlds whose number is divisible by N; 6: the test worlds of BARN",
    )
    parser.add_argument(
        "--names", metavar="WORLD,...", help="only these worlds, with commas"
    )
    take_batch(
        parser, "layouts per scenario (default: 50), or runs per world (default: 1)"
    )
    take_output(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[ComparisonResult]:
    from analysis.batches.comparison_plans import comparison_plans
    from analysis.batches.options import check_options

    check_options(options.out, workers=options.workers, resume=options.resume)
    worlds = _worlds(options)
    plans = comparison_plans(
        options.scenario,
        laws=options.law or None,
        runs=options.runs,
        seed=whole_seed(options, 1),
        settings=settings_of(options),
        grid=options.grid,
        worlds=worlds,
    )
    for plan in plans.values():
        plan.check()
    places = f"{len(worlds)} worlds of {options.worlds}" if worlds else ", ".join(plans)
    say(f"comparing laws in {places}")

    from phonotaxis.batches import prepare_compare

    return prepare_compare(
        plans, options.out, workers=options.workers, resume=options.resume
    )


def _worlds(options: Namespace) -> list[str]:
    from diagrams.scenario.worlds.catalog import chosen_worlds
    from systems.framework.input_error import InputError

    if options.worlds is None:
        for name in ("every", "names"):
            if (value := getattr(options, name)) is not None:
                raise InputError(
                    name, f"selects worlds; write --worlds PATH --{name} {value}"
                )
        return []
    names = [each.strip() for each in (options.names or "").split(",") if each.strip()]
    every = 1 if options.every is None else options.every
    return chosen_worlds(options.worlds, every, names)


COMMAND = Command(
    "compare",
    "compare laws on the same random layouts",
    _add_arguments,
    _prepare,
    where="\nresults in {out}, report in {out}/report.html",
    examples=(
        "compare two_static_obstacles --laws conventional,active --runs 20",
        "compare --set hearing=ideal --velocity-term printed,closing",
        "compare --worlds --laws guarded,dwa --set robot.top_speed_m_s=0.5",
        "compare u_trap clutter --laws guarded,dwa,orca --out results/laws",
    ),
)
