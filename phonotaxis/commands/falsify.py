"""``phonotaxis falsify``: tries to drive a guarded robot into obstacles at rest."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    say,
    take_json,
    take_runs,
    take_seed,
    take_workers,
    whole_seed,
)
from phonotaxis.commands.command import Command, Printed, Take
from phonotaxis.result import Prepared

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


def _add_arguments(parser: ArgumentParser) -> None:
    take_runs(parser, "random runs (default: 2000)", 2_000)
    parser.add_argument(
        "--search",
        metavar="N",
        type=int,
        default=0,
        help="runs of the search for collisions (0)",
    )
    take_seed(parser, "seed of all random numbers (default: 1)")
    take_workers(parser, "local processes (default: 1)", 1)
    parser.add_argument(
        "--drivers",
        metavar="NAME,...",
        help="random, pressing, looking, or laws; one is drawn for each run",
    )
    parser.add_argument(
        "--only",
        metavar="K",
        type=int,
        help="repeat this run only, or this job of --long only",
    )
    parser.add_argument("--long", action="store_true", help="runs of up to an hour")
    parser.add_argument(
        "--journal",
        metavar="FILE",
        help="keep each finished job of --long in this file, and skip those in it",
    )
    parser.add_argument(
        "--cost",
        action="store_true",
        help="measure the computing time of a tick instead",
    )
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[Printed]:
    from analysis.batches.options import check_options
    from systems.framework.input_error import InputError

    check_options(None, workers=options.workers)
    for name in ("runs", "search", "only"):
        if (getattr(options, name) or 0) < 0:
            raise InputError(name, f"{getattr(options, name)} must not be negative")
    if options.runs + options.search == 0:
        raise InputError("runs", "is 0, and there is no search; give at least one run")
    drivers, options.seed = _drivers(options.drivers), whole_seed(options, 1)
    say("trying to make the guard collide")
    if options.cost:
        return _cost()
    if options.long:
        return _long(options)
    if options.only is not None:
        return _only(options, drivers)
    return _falsify(options, drivers)


def _drivers(names: str | None) -> Sequence[str]:
    from analysis.safety.driver_trials import DRIVERS, USUAL
    from diagrams.scenario.suggestions import did_you_mean
    from systems.framework.input_error import InputError
    from systems.laws.catalog import LAWS

    if names is None:
        return USUAL
    known, found = [*DRIVERS, *LAWS], names.split(",")
    for name in found:
        if name not in known:
            hint = did_you_mean(name, known)
            raise InputError("drivers", f"there is no driver or law {name!r}{hint}")
    return found


def _falsify(options: Namespace, drivers: Sequence[str]) -> Prepared[Printed]:
    from analysis.run_error import RunError
    from analysis.safety.falsification import (
        falsification_summary,
        falsification_text,
        falsify,
    )

    def run(progress: Callable[[float], None]) -> Printed:
        found = falsify(
            options.runs,
            options.search,
            options.seed,
            options.workers,
            drivers,
            progress=progress,
        )
        hits = sum(each.collided for each in found)
        text = f"the robot collided in {hits} of {len(found)} runs"
        document = falsification_summary(found, options.seed)
        error = RunError(text) if hits else None
        return Printed(document, falsification_text(document), error)

    return Prepared(run=run)


def _only(options: Namespace, drivers: Sequence[str]) -> Prepared[Printed]:
    from analysis.safety.driver_trials import draw_trial, run_trial
    from analysis.safety.falsification import trial_summary, trial_text

    trial = draw_trial(options.seed, options.only, drivers)

    def run(_: object) -> Printed:
        document = trial_summary(trial, run_trial(trial), options.seed)
        return Printed(document, trial_text(document))

    return Prepared(run=run)


def _long(options: Namespace) -> Prepared[Printed]:
    from analysis.run_error import RunError
    from analysis.safety.job_pool import run_jobs
    from analysis.safety.long_runs import (
        JOBS_A_WORKER,
        Journal,
        jobs,
        long_summary,
        long_text,
    )
    from systems.framework.input_error import InputError

    todo = dict(enumerate(jobs(options.seed)))
    if options.only is not None:
        if options.only not in todo:
            raise InputError("only", f"{options.only} must lie below {len(todo)}")
        todo = {options.only: todo[options.only]}
    journal = None
    if options.journal is not None:
        path = Path(options.journal)
        if not path.absolute().parent.is_dir():
            raise InputError("journal", f"the directory of {path} does not exist")
        journal = Journal(path, options.seed)

    def run(_: object) -> Printed:
        found = {}
        if journal is not None:
            found = {n: runs for n, runs in journal.done.items() if n in todo}
        left = {n: job for n, job in todo.items() if n not in found}
        if journal is not None:
            left = {n: journal.keeping(n, job) for n, job in left.items()}
        results = run_jobs(
            [*left.values()], options.workers, jobs_a_worker=JOBS_A_WORKER
        )
        for number, runs in zip(left, results, strict=True):
            found[number] = runs
            print(f"phonotaxis: job {number} is done", file=sys.stderr, flush=True)
        found = dict(sorted(found.items()))
        document = long_summary(found, options.seed)
        text = f"the robot touched an obstacle in {document['contacts']} runs"
        error = RunError(text) if document["contacts"] else None
        return Printed(document, long_text(found), error)

    return Prepared(run=run)


def _cost() -> Prepared[Printed]:
    from analysis.safety.guard_cost import cost_summary, cost_text, tick_costs

    def run(_: object) -> Printed:
        costs = tick_costs()
        return Printed(cost_summary(costs), cost_text(costs))

    return Prepared(run=run)


COMMAND = Command(
    "falsify",
    "try to make a guarded robot collide with obstacles at rest",
    _add_arguments,
    _prepare,
    examples=(
        "falsify --runs 2000 --search 400 --workers 2",
        "falsify --long --workers 2 --journal long.jsonl",
        "falsify --seed 1 --only 17",
    ),
)
