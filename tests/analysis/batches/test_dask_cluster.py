"""A sweep on a Dask cluster of this machine."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest

from analysis.batches import dask_cluster
from analysis.batches.one_run import Task, results_table, run_task
from analysis.batches.plan import SweepPlan
from analysis.batches.processes import WorkerError
from analysis.batches.store import load_results
from analysis.batches.sweep import prepare_sweep

distributed = pytest.importorskip("distributed")


PLAN = {"set": {"hearing": "ideal", "duration_s": 3.0}, "runs": 60}


class Cluster:
    """A scheduler and workers in processes of their own, which can be killed."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "scheduler.json"
        self._started: list[subprocess.Popen[bytes]] = []
        self.scheduler = self._start("scheduler", "--port", "0", "--no-dashboard")
        while not self._file.exists() or not self._file.stat().st_size:
            time.sleep(0.1)
        self.address = json.loads(self._file.read_text())["address"]
        self.worker = self.start_worker()
        with distributed.Client(self.address) as client:
            client.wait_for_workers(1, timeout=60)

    def start_worker(self) -> subprocess.Popen[bytes]:
        return self._start("worker", "--no-nanny", "--nthreads", "1", "--no-dashboard")

    def _start(self, what: str, *options: str) -> subprocess.Popen[bytes]:
        words = ["-m", f"distributed.cli.dask_{what}", "--host", "127.0.0.1", *options]
        process = subprocess.Popen(
            [sys.executable, *words, "--scheduler-file", str(self._file)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._started.append(process)
        return process

    def close(self) -> None:
        for process in self._started:
            process.kill()
            process.wait()


@pytest.fixture
def mortal(tmp_path) -> Iterator[Cluster]:
    cluster = Cluster(tmp_path)
    try:
        yield cluster
    finally:
        cluster.close()


def killed(
    process: subprocess.Popen[bytes], cluster: Cluster, out: Path
) -> WorkerError:
    """What a sweep says whose cluster loses a process after a few runs."""

    def lose(done: int) -> None:
        if done >= 3 and process.poll() is None:
            process.kill()
            process.wait()

    plan = SweepPlan.model_validate(PLAN)
    with pytest.raises(WorkerError) as caught:
        prepare_sweep(plan, out, scheduler=cluster.address).run(lose)
    assert process.poll() is not None
    return caught.value


@pytest.mark.long
def test_a_cluster_without_workers_is_told_of_and_ends(
    mortal, tmp_path, monkeypatch, caplog, capfd
):
    monkeypatch.setattr(dask_cluster, "WARN_S", 0.5)
    monkeypatch.setattr(dask_cluster, "PATIENCE_S", 3.0)
    # That of a command which ran in this process has a stream that is closed.
    monkeypatch.setattr(logging.getLogger("phonotaxis"), "handlers", [])
    out = tmp_path / "out"
    said = str(killed(mortal.worker, mortal, out))
    kept = len(load_results(out))
    assert 3 <= kept < 60
    assert said == (
        "the Dask cluster has had no workers for 3 s; "
        f"{kept} of 60 runs are kept in {out}: continue with --resume"
    )
    warning = "the Dask cluster has no workers; the sweep waits for new ones, and ends"
    assert [text.startswith(warning) for text in caplog.messages] == [True]
    assert capfd.readouterr().err == ""


@pytest.mark.long
def test_a_scheduler_that_is_killed_is_one_line(mortal, tmp_path, capfd):
    out = tmp_path / "out"
    said = str(killed(mortal.scheduler, mortal, out))
    kept = len(load_results(out))
    assert 3 <= kept < 60
    assert said.startswith(f"the Dask cluster is gone; {kept} of 60 runs are kept in ")
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_a_new_worker_takes_over_and_nothing_changes(
    mortal, tmp_path, monkeypatch, caplog
):
    """The only worker is killed in a run; another one comes after the warning."""
    monkeypatch.setattr(dask_cluster, "WARN_S", 0.5)
    started: list[int] = []

    def replace(done: int) -> None:
        if done >= 3 and mortal.worker.poll() is None:
            mortal.worker.kill()
            mortal.worker.wait()
        if caplog.messages and not started:
            started.append(mortal.start_worker().pid)

    plan = SweepPlan.model_validate(
        PLAN
        | {
            "grid": {"law": ["none", "active"]},
            "draw": {"source.speed_m_s": {"uniform": [0.1, 0.5]}},
            "runs": 6,
        }
    )
    sweep = prepare_sweep(plan, tmp_path / "out", scheduler=mortal.address)
    table = sweep.run(replace)
    assert len(started) == 1
    expected = results_table(
        run_task(Task(point, plan.scenario_of(point), "drake", trajectory=False)).row
        for point in plan.points()
    )
    pd.testing.assert_frame_equal(
        table.drop(columns="wall_s"), expected.drop(columns="wall_s")
    )
