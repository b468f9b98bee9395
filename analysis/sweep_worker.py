"""A process that runs the points of a sweep for another one.

It loads all that a run needs once. Then it forks a child that does the runs,
and a new child every ``RUNS_PER_CHILD`` runs: Drake never frees blocks written
in Python, so that a process grows by about a megabyte a run.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
from multiprocessing.connection import Connection

from analysis.sweep_run import Task, run_task
from diagrams import Scenario, build_sound_follower, make_simulator

__all__ = ["READY", "main"]

READY = "ready"
RUNS_PER_CHILD = 50
#: Exit status of a child whose parent has nothing more to do.
_AT_END = 3
_WARM_S = 0.1


def main(file_descriptor: int) -> None:
    """Serves tasks until the other end of the socket is closed.

    Args:
        file_descriptor: A socket. A ``Scenario`` comes first, to warm up with;
            the answer is READY. Then an ``Outcome`` answers each ``Task``.
    """
    # Keyboards speak to the process that we work for.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with Connection(file_descriptor) as connection:
        try:
            _warm(connection.recv())
            connection.send(READY)
        except (EOFError, OSError):
            return
        gc.freeze()  # else the collector writes to pages that children share
        while True:
            child = os.fork()
            if child == 0:
                _serve(connection)
            _, status = os.waitpid(child, 0)
            if status != 0:
                return


def _warm(scenario: Scenario) -> None:
    """Loads compiled functions. An error here comes again with the run itself."""
    with contextlib.suppress(Exception, SystemExit):
        make_simulator(build_sound_follower(scenario, log=True)).AdvanceTo(_WARM_S)


def _serve(connection: Connection) -> None:
    """The child's life: some runs, then the end, without a word to exit handlers."""
    status = 0
    try:
        for _ in range(RUNS_PER_CHILD):
            task: Task = connection.recv()
            connection.send(run_task(task))
    except (EOFError, OSError):
        status = _AT_END
    finally:
        os._exit(status)
