"""A worker process that does runs of a parameter sweep for another process.

The worker loads all code that a run needs once. Then the worker forks a child process,
which does the runs. Drake never frees blocks that are written in Python, so that the
child grows by about 1 MB per run. The worker therefore replaces the child after 50 runs
of Drake. Compiled runs share their blocks, so that a child does 1000 of them.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection

from analysis.batches.one_run import Task, run_task
from diagrams import build_sound_follower, load_compiled_code, prepared_loop

READY = "ready"
RUNS_PER_CHILD = {"drake": 50, "compiled": 1000}


def main(file_descriptor: int) -> None:
    """Runs tasks until the other process closes the socket.

    The other process first sends a ``Task``. The worker loads the code for this task
    without running it, and answers ``READY``. Each further ``Task`` is run and is
    answered with an ``Outcome``.

    Args:
        file_descriptor: File descriptor of the socket.
    """
    # Ctrl-C is for the process that sends the tasks.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with Connection(file_descriptor) as connection:
        try:
            task = connection.recv()
            # Code of the task may end its process. That must not happen here, so a
            # child process tries the code first.
            if _survives(lambda: _warm(task)):
                _warm(task)
            connection.send(READY)
        except (EOFError, OSError):
            return
        gc.freeze()  # else the collector writes to pages that children share
        while _survives(lambda: _serve(connection)):
            pass


def _survives(work: Callable[[], None]) -> bool:
    """Runs a function in a forked child; returns whether the child ended normally."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            work()
            status = 0
        finally:
            os._exit(status)  # not a word to what waits for the end of Python
    return os.waitpid(child, 0)[1] == 0


def _warm(task: Task) -> None:
    """Loads compiled functions; ignores errors, because the run repeats them."""
    with contextlib.suppress(BaseException):
        if task.engine == "compiled":
            prepared_loop(task.scenario)
        else:
            load_compiled_code(build_sound_follower(task.scenario, log=True))


def _serve(connection: Connection) -> None:
    """Runs tasks until the child is worn out; raises EOFError if the socket closes."""
    worn = 0.0
    while worn < 1.0:
        task: Task = connection.recv()
        connection.send(run_task(task))
        worn += 1.0 / RUNS_PER_CHILD[task.engine]
