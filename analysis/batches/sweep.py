"""Runs a sweep: many variants of a scenario, in several processes."""

from __future__ import annotations

import json
import logging
import os
import shlex
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pandas as pd

from analysis.batches.one_run import Outcome, Task
from analysis.batches.options import check_options
from analysis.batches.plan import SweepPlan, SweepPoint
from analysis.batches.processes import WorkerError, run_locally
from analysis.batches.store import StoreError, SweepStore, load_results
from diagrams import Scenario, build_sound_follower, prepared_loop
from diagrams.scenario.run_parameters import MANY_RUNS, Engine
from systems.framework.input_error import InputError

_LOGGER = logging.getLogger("phonotaxis")

#: Function that runs tasks. It calls its second argument a few times per second.
Runner = Callable[[Iterator[Task], Callable[[], None]], Generator[Outcome]]


@dataclass(frozen=True)
class PreparedSweep:
    """A sweep that is ready to run; see ``prepare_sweep``."""

    plan: SweepPlan
    points: list[SweepPoint]
    """All runs, including the finished ones."""
    store: SweepStore
    """Open directory of the results, which ``run`` closes."""
    runner: Runner
    compiled: bool
    """Whether to use the compiled engine for scenarios that do not choose an engine."""

    def run(self, progress: Callable[[int], None] | None = None) -> pd.DataFrame:
        """Does all runs of a parameter sweep that are not in its directory yet.

        The function ``progress`` is called a few times per second with the number of
        finished runs. If it raises an exception, the sweep ends. Returns the table of
        all runs, see ``load_results``. Raises StoreError if the disk is full or faulty,
        and WorkerError if worker processes cannot be started or reached.
        """

        def pulse() -> None:
            if progress is not None:
                progress(len(self.store.done))

        pulse()
        with closing(self.store):
            try:
                with closing(self.runner(self._tasks(), pulse)) as outcomes:
                    for outcome in outcomes:
                        self.store.add(outcome)
                self.store.write_table(complete=True)
            except BaseException as error:
                with suppress(StoreError):
                    self.store.write_table(complete=False)
                if isinstance(error, WorkerError) and self.store.done:
                    raise WorkerError(
                        f"{error}; {len(self.store.done)} of {len(self.points)} runs "
                        f"are kept in {self.store.out}: continue with --resume"
                    ) from error
                raise
        return load_results(self.store.out)

    def _tasks(self) -> Iterator[Task]:
        done, files = frozenset(self.store.done), self.plan.file_digests
        for point in self.points:
            if point.index not in done:
                scenario = self.plan.scenario_of(point)
                engine = self.engine(scenario)
                yield Task(point, scenario, engine, self.plan.trajectories, files)

    def engine(self, scenario: Scenario) -> Engine:
        """Chooses the engine for a scenario of the sweep."""
        if scenario.engine != "auto":
            return scenario.engine
        return "compiled" if self.compiled else "drake"


def prepare_sweep(
    plan: SweepPlan,
    out: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
) -> PreparedSweep:
    """Draws and checks all runs of a parameter sweep, then opens its directory.

    The directory is locked until ``PreparedSweep.run`` ends. This method can be called
    only once. Raises InputError, which states the fault and the remedy, if an argument
    or the plan is not valid.

    - ``out``: Directory of the results. None means the next number under results/.
    - ``workers``: Number of local processes. None means one process per processor core.
    - ``scheduler``: Address of a Dask scheduler, which then replaces the local
      processes.
    - ``resume``: Whether ``out`` may contain runs of the same plan. These runs are
      kept.
    """
    check_options(out, workers=workers, scheduler=scheduler, resume=resume)
    directory = Path(out).expanduser() if out is not None else None
    points = plan.points()
    compiled = _build_each_kind(plan, points)
    runner: Runner
    if scheduler is None:
        runner = partial(run_locally, workers=workers or _cores())
    else:
        from analysis.batches.dask_cluster import connect, run_on_cluster

        runner = partial(run_on_cluster, client=connect(scheduler))
    store = SweepStore(directory, plan, points)
    return PreparedSweep(plan, points, store, runner, compiled)


def reproducing_command(out: Path, point: SweepPoint, engine: str) -> str:
    """Returns the shell command that repeats one run of a sweep.

    The argument ``out`` is the directory of the sweep, and ``engine`` is the engine of
    the run: ``drake`` or ``compiled``.
    """
    words = ["phonotaxis", "simulate", str(out / "scenario.yaml")]
    for path, value in point.fields.items():
        words += ["--set", f"{path}={json.dumps(value, ensure_ascii=False)}"]
    if engine == "compiled":
        words += ["--set", "engine=compiled"]
    return shlex.join([*words, "--seed", str(point.seed)])


def _build_each_kind(plan: SweepPlan, points: list[SweepPoint]) -> bool:
    """Builds the block diagrams of some runs, to find faults before all runs start.

    Some faults appear only when a diagram is built, for example an unknown control law.
    The function builds the diagram of the first run. It also builds the diagram of
    every run in which a field has a text or a mapping that no earlier run had. A world
    only has other obstacles, and needs no new diagram.

    Returns whether scenarios that do not choose an engine use the compiled engine. They
    do if the sweep has many runs and numba can compile the code of the user.
    """
    compiled = len(points) >= MANY_RUNS
    seen: set[str] = set()
    for point in points:
        kinds = {
            json.dumps([path, value])
            for path, value in point.fields.items()
            if type(value) in (str, dict) and path != "world"
        }
        if point.index == 0 or not kinds <= seen:
            scenario = plan.scenario_of(point)
            auto = scenario.engine == "auto"
            if scenario.engine == "compiled" or (auto and compiled):
                try:
                    prepared_loop(scenario)
                except InputError as error:
                    if error.field != "engine" or not auto:
                        raise
                    _LOGGER.warning("%s", error.message)
                    compiled = False
            else:
                build_sound_follower(scenario)
        seen |= kinds
    return compiled


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
