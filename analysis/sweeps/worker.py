"""A process that runs the points of a sweep for another one.

It loads all that a run needs once. Then it forks a child that does the runs,
and a new child every ``RUNS_PER_CHILD`` runs: Drake never frees blocks written
in Python, so that a process grows by about a megabyte a run. Compiled runs share
blocks.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection

from analysis.sweeps.one_run import Task, run_task
from diagrams import build_sound_follower, load_compiled_code, prepared_loop

READY = "ready"
RUNS_PER_CHILD = {"drake": 50, "compiled": 1000}


def main(file_descriptor: int) -> None:
    """Serves tasks until the other end of the socket is closed.

    Args:
        file_descriptor: A socket. A ``Task`` comes first, to warm up with;
            the answer is READY. Then an ``Outcome`` answers each ``Task``.
    """
    # Keyboards speak to the process that we work for.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with Connection(file_descriptor) as connection:
        try:
            task = connection.recv()
            # A run may end its process: that must happen when it is its turn.
            if _survives(lambda: _warm(task)):
                _warm(task)
            connection.send(READY)
        except (EOFError, OSError):
            return
        gc.freeze()  # else the collector writes to pages that children share
        while _survives(lambda: _serve(connection)):
            pass


def _survives(work: Callable[[], None]) -> bool:
    """Works in a forked child, and tells whether it got to the end."""
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
    """Loads compiled functions. An error here comes again with the run itself."""
    with contextlib.suppress(BaseException):
        if task.engine == "compiled":
            prepared_loop(task.scenario)
        else:
            load_compiled_code(build_sound_follower(task.scenario, log=True))


def _serve(connection: Connection) -> None:
    """Some runs. At the end of all, EOFError."""
    worn = 0.0
    while worn < 1.0:
        task: Task = connection.recv()
        connection.send(run_task(task))
        worn += 1.0 / RUNS_PER_CHILD[task.engine]
