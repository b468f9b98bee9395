"""A worker process that does runs of a parameter sweep for another process.

The worker first loads all code that a run needs. Then it forks a child process, which
does the runs. Drake never frees blocks that are written in Python. The child therefore
grows by about 1 MB per run, and the worker replaces it after 50 runs with Drake. Runs
with the compiled engine share their blocks, so a child does 1000 of these runs. They
cannot share them if each run has another number of obstacles: a child that has grown by
1 GB is therefore replaced, too.
"""

from __future__ import annotations

import contextlib
import gc
import os
import resource
import signal
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection

from analysis.batches.one_run import Task, run_task
from diagrams import build_sound_follower, load_compiled_code, prepared_loop

READY = "ready"
RUNS_PER_CHILD = {"drake": 50, "compiled": 1000}
#: Growth of a child, bytes, after which the worker replaces it.
GROWTH_PER_CHILD = 1e9
#: Unit of ``ru_maxrss``, bytes.
_MEMORY_UNIT = 1 if sys.platform == "darwin" else 1024


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
            # A user's code may end the process that loads it. Therefore a child process
            # loads the code first.
            if _survives(lambda: _warm(task)):
                _warm(task)
            connection.send(READY)
        except (EOFError, OSError):
            return
        gc.freeze()  # otherwise, garbage collection copies memory in every child
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
            os._exit(status)  # skips what Python would do at exit
    return os.waitpid(child, 0)[1] == 0


def _warm(task: Task) -> None:
    """Loads compiled functions; ignores errors, which occur again in the run."""
    with contextlib.suppress(BaseException):
        if task.engine == "compiled":
            prepared_loop(task.scenario)
        else:
            load_compiled_code(build_sound_follower(task.scenario, log=True))


def _serve(connection: Connection) -> None:
    """Runs tasks until the child is to be replaced.

    If the socket closes before, the function raises an EOFError.
    """
    worn, most = 0.0, _most_memory() + GROWTH_PER_CHILD
    while worn < 1.0 and _most_memory() < most:
        task: Task = connection.recv()
        connection.send(run_task(task))
        worn += 1.0 / RUNS_PER_CHILD[task.engine]


def _most_memory() -> float:
    """Returns the largest memory that this process has had so far, bytes."""
    return _MEMORY_UNIT * float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
