"""Jobs in worker processes that are replaced."""

from __future__ import annotations

import os
from functools import partial

import pytest

from analysis.safety.job_pool import run_jobs


@pytest.mark.slow
def test_many_jobs_end_in_order_and_processes_are_replaced():
    """Three times as many jobs as one set of processes does."""
    powers = run_jobs([partial(pow, 2, n) for n in range(6)], 1, jobs_a_worker=2)
    assert list(powers) == [1, 2, 4, 8, 16, 32]
    processes = list(run_jobs([os.getpid] * 4, 1, jobs_a_worker=2))
    assert len(set(processes)) == 2
    assert os.getpid() not in processes
