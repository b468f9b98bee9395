"""Runs jobs in worker processes that are replaced from time to time.

Drake never frees blocks that are written in Python. The memory of a process therefore
grows with each scenario that the process builds.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

Result = TypeVar("Result")


def run_jobs(
    jobs: Sequence[Callable[[], Result]], workers: int, *, jobs_a_worker: int
) -> Iterator[Result]:
    """Runs picklable jobs in worker processes. Yields the results in order of the jobs.

    All processes are replaced after ``workers * jobs_a_worker`` jobs, so that each
    process runs ``jobs_a_worker`` jobs on average.
    """
    # The executor's own option max_tasks_per_child can hang in Python 3.11 and in later
    # versions without this fix: https://github.com/python/cpython/issues/115634
    size = workers * jobs_a_worker
    for start in range(0, len(jobs), size):
        with ProcessPoolExecutor(
            workers, mp_context=get_context("spawn"), initializer=_end_at_interrupt
        ) as pool:
            try:
                for each in [pool.submit(job) for job in jobs[start : start + size]]:
                    yield each.result()
            finally:
                pool.shutdown(wait=False, cancel_futures=True)


def _end_at_interrupt() -> None:
    """Makes Ctrl-C end a worker at once, without a traceback."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
