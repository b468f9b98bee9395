"""A sweep on a Dask cluster of this machine."""

from __future__ import annotations

import os
import signal

import pandas as pd
import pytest

from analysis.sweeps.one_run import Task, results_table, run_task
from analysis.sweeps.plan import SweepPlan
from analysis.sweeps.sweep import run_sweep

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as local:
        yield local


@pytest.mark.slow
def test_a_lost_worker_changes_nothing(cluster, tmp_path):
    plan = SweepPlan.model_validate(
        {
            "set": {"hearing": "ideal", "duration_s": 2.0},
            "grid": {"law": ["none", "active"]},
            "draw": {"source.speed_m_s": {"uniform": [0.1, 0.5]}},
            "runs": 15,
        }
    )
    alive = [worker.pid for worker in cluster.workers.values()]
    lost: list[int] = []

    def lose_one(done: int) -> None:
        if done >= 6 and not lost:
            lost.append(alive[0])
            os.kill(alive[0], signal.SIGKILL)

    table = run_sweep(
        plan, tmp_path / "out", scheduler=cluster.scheduler_address, progress=lose_one
    )
    assert lost
    expected = results_table(
        run_task(Task(point, plan.scenario_of(point), "drake", trajectory=False)).row
        for point in plan.points()
    )
    pd.testing.assert_frame_equal(
        table.drop(columns="wall_s"), expected.drop(columns="wall_s")
    )
