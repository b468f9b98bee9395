"""Runs of a parameter sweep on a Dask cluster.

Each thread of a Dask worker runs its scenarios in a separate ``WorkerProcess``, as a
local sweep does. This limits the use of memory: Drake never frees blocks that are
written in Python, and a Dask worker lives for a long time.
"""

from __future__ import annotations

import logging
import socket
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from itertools import islice
from time import monotonic
from typing import Any
from urllib.parse import urlsplit
from uuid import uuid4

from analysis.batches.one_run import Outcome, Task, lost_outcome
from analysis.batches.processes import (
    PULSE_S,
    WorkerError,
    WorkerProcess,
    close_workers,
    run_locally,
)
from analysis.report.provenance import versions
from systems.framework.input_error import InputError

#: Number of tasks per thread of the cluster: one task runs, and one waits.
TASKS_A_THREAD = 2
#: Time without any workers after which a warning appears, s.
WARN_S = 5.0
#: Time without any workers after which the sweep ends, s.
PATIENCE_S = 600.0
_CONNECT_S = 10.0

_LOGGER = logging.getLogger("phonotaxis")

#: Idle processes of the Dask worker in which this module is loaded.
_idle: deque[WorkerProcess] = deque()


def connect(scheduler: str) -> Any:
    """Connects to a Dask cluster and checks that its workers can run sweeps.

    Args:
        scheduler: Address of the Dask scheduler, for example tcp://host:8786.

    Returns:
        The Dask client.

    Raises:
        InputError: The cluster cannot be reached or has no workers, or its workers have
            other versions of the packages. The error is about the field ``scheduler``.
    """
    try:
        import distributed
    except ImportError:
        raise InputError(
            "scheduler", "needs the package distributed; install phonotaxis[sweep]"
        ) from None
    try:
        address = urlsplit(scheduler)
        # Dask's own client prints many messages if no scheduler has this address.
        with socket.create_connection((address.hostname, address.port), _CONNECT_S):
            client = distributed.Client(scheduler, timeout=_CONNECT_S)
        trouble = _trouble(client)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            "scheduler",
            f"{scheduler} cannot be reached ({error}); give the address that `dask "
            "scheduler` prints, for example tcp://host:8786",
        ) from None
    if trouble:
        client.close()
        raise InputError("scheduler", f"{scheduler} {trouble}")
    return client


def _trouble(client: Any) -> str:
    """Returns the reason why the workers cannot run a sweep; empty if they can."""
    found = client.run(versions, on_error="return")
    if not found:
        return "has no workers; start some with `dask worker` and that address"
    for worker, theirs in found.items():
        if isinstance(theirs, Exception):
            return f"has a worker {worker} without phonotaxis ({theirs}); install it"
        for name, version in versions().items():
            if theirs.get(name) != version:
                return (
                    f"has a worker {worker} with {name} {theirs.get(name)}, but this "
                    f"process has {version}; install the same version"
                )
    return ""


def run_on_cluster(
    tasks: Iterator[Task], pulse: Callable[[], None], *, client: Any
) -> Generator[Outcome]:
    """Runs the tasks of a parameter sweep on a cluster.

    If a Dask worker is lost, other workers repeat its runs. If several workers are lost
    during the same run, this run counts as failed.

    Args:
        tasks: Tasks to run.
        pulse: Function that is called a few times per second. If it raises an
            exception, the work ends.
        client: Dask client from ``connect``. It is closed at the end.

    Yields:
        Results of the runs, in the order in which the runs end.

    Raises:
        WorkerError: The cluster cannot be reached any more, or has had no workers for
            ``PATIENCE_S``.
    """
    with _silent_dask():
        yield from _outcomes(tasks, pulse, client)


@contextmanager
def _silent_dask() -> Iterator[None]:
    """Disables the log messages of Dask. The errors of this module state each fault."""
    names = [*logging.root.manager.loggerDict, "asyncio"]
    loggers = [
        logging.getLogger(name)
        for name in names
        if name.partition(".")[0] in ("asyncio", "distributed", "tornado")
    ]
    before = [logger.disabled for logger in loggers]
    for logger in loggers:
        logger.disabled = True
    try:
        yield
    finally:
        for logger, disabled in zip(loggers, before, strict=True):
            logger.disabled = disabled


class _Patience:
    """Measures for how long a cluster has had no workers."""

    def __init__(self) -> None:
        self._seen, self._warned = monotonic(), False

    def watch(self, threads: int) -> None:
        """Warns after 5 s without workers, and raises an error after 600 s.

        Args:
            threads: Number of threads that all workers of the cluster have at this
                time.

        Raises:
            WorkerError: There have been no workers for ``PATIENCE_S``, 600 s.
        """
        if threads:
            self._seen, self._warned = monotonic(), False
        alone_s = monotonic() - self._seen
        if alone_s > PATIENCE_S:
            raise WorkerError(
                f"the Dask cluster has had no workers for {PATIENCE_S:g} s"
            )
        if alone_s > WARN_S and not self._warned:
            self._warned = True
            _LOGGER.warning(
                "the Dask cluster has no workers; the sweep waits for new ones, and "
                "ends after %g s without any",
                PATIENCE_S,
            )


def _outcomes(
    tasks: Iterator[Task], pulse: Callable[[], None], client: Any
) -> Generator[Outcome]:
    from distributed import wait

    sweep = uuid4().hex
    futures: dict[Any, Task] = {}
    patience = _Patience()
    try:
        while True:
            threads = sum(client.nthreads().values())
            patience.watch(threads)
            room = TASKS_A_THREAD * max(1, threads) - len(futures)
            for task in islice(tasks, max(0, room)):
                key = f"phonotaxis-{sweep}-{task.point.index}"
                futures[client.submit(_run_remotely, task, key=key)] = task
            if not futures:
                return
            try:
                done = wait(list(futures), PULSE_S, "FIRST_COMPLETED").done
            except TimeoutError:
                done = set()
            for future in done:
                yield _outcome(future, futures.pop(future))
            pulse()
    except (OSError, CancelledError) as error:
        raise WorkerError("the Dask cluster is gone") from error
    finally:
        with suppress(OSError, CancelledError):
            client.cancel(list(futures), force=True)
            client.run(_dismiss_idle, on_error="ignore")
        with suppress(OSError, CancelledError):
            client.close()


def _outcome(future: Any, task: Task) -> Outcome:
    from distributed import KilledWorker

    if future.status == "finished":
        outcome: Outcome = future.result()
        return outcome
    if future.status == "error":
        error = future.exception()
        if isinstance(error, KilledWorker):
            return lost_outcome(task, f"its Dask workers were lost: {error}")
        raise WorkerError(f"a Dask worker failed: {type(error).__name__}: {error}")
    raise WorkerError("the Dask cluster is gone")


def _run_remotely(task: Task) -> Outcome:
    """Runs a task, in a thread of a Dask worker."""
    (outcome,) = run_locally(iter([task]), lambda: None, workers=1, idle=_idle)
    return outcome


def _dismiss_idle() -> None:
    """Ends the idle processes of the Dask worker in which this function runs."""
    close_workers(_idle)
