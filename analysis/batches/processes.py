"""Local processes that do the runs of a sweep."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path

from analysis.batches.one_run import Outcome, Task, lost_outcome
from analysis.batches.worker import READY
from analysis.run_error import RunError

#: Greatest number of attempts at a run. Another attempt follows if the worker process
#: ends before it returns a result.
ATTEMPTS = 2
#: Number of tasks that a worker has at a time. While it runs one, the next one waits.
AHEAD = 2
#: Longest time between two calls of ``pulse``, s.
PULSE_S = 0.25
#: Program of a worker. It loads our packages from where this process has them, even if
#: a module of the user with the same name comes first on the path.
_PROGRAM = """
import sys
sys.path.insert(0, sys.argv[2])
import analysis, diagrams, systems
del sys.path[0]
from analysis.batches.worker import main
main(int(sys.argv[1]))
"""
_HOME = str(Path(__file__).resolve().parents[2])


class WorkerError(RunError):
    """A worker process cannot be started, or can no longer be reached."""


class WorkerProcess:
    """A worker in a separate process; see ``analysis/batches/worker.py``."""

    def __init__(self, task: Task) -> None:
        """Starts the process.

        The process loads the code for the task, but does not run the task.
        """
        ours, theirs = socket.socketpair()
        self.connection = Connection(ours.detach())
        self.tasks: deque[Task] = deque()
        self.ready = False
        # Several threads would make a worker slower, and would change rounding errors.
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        # Drake cannot be loaded if the encoding of the locale is ASCII.
        encoding = {"PYTHONUTF8": "1"}
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)  # noqa: PTH109
        with theirs:
            self._process = subprocess.Popen(
                worker_command(theirs.fileno()),
                pass_fds=[theirs.fileno()],
                env={**os.environ, **threads, **encoding, "PYTHONPATH": paths},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                start_new_session=True,
            )
        self._send(task)

    def _send(self, message: Task) -> None:
        # If the process has just ended, ``receive`` detects that.
        with contextlib.suppress(OSError):
            self.connection.send(message)

    def give(self, task: Task) -> None:
        """Sends a task to run. The results arrive in the order of the tasks."""
        self.tasks.append(task)
        self._send(task)

    def receive(self) -> Outcome | None:
        """Waits for the next message of the worker process.

        Returns:
            Result of a task. None if the message says that the process is ready.

        Raises:
            EOFError: The process ended after it was ready.
            WorkerError: The process ended before it was ready.
        """
        try:
            message = self.connection.recv()
        except (EOFError, OSError):
            if self.ready:
                raise EOFError from None
            raise WorkerError(
                "a worker process could not start; see its output for the reason"
            ) from None
        if message == READY:
            self.ready = True
            return None
        self.tasks.popleft()
        outcome: Outcome = message
        return outcome

    def close(self) -> None:
        """Ends the process, and its child that does the runs, at once."""
        self.connection.close()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


def worker_command(file_descriptor: int) -> list[str]:
    """Returns the command that starts a worker, which reads tasks from a socket."""
    return [sys.executable, "-P", "-c", _PROGRAM, str(file_descriptor), _HOME]


def run_locally(
    tasks: Iterator[Task],
    pulse: Callable[[], None],
    *,
    workers: int,
    idle: deque[WorkerProcess] | None = None,
) -> Generator[Outcome]:
    """Runs the tasks of a parameter sweep in local processes.

    A worker process may end during a run, for example if the system is out of memory.
    The run is then tried once more.

    Args:
        tasks: Tasks to run.
        pulse: Function that is called a few times per second. If it raises an
            exception, the work ends.
        workers: Number of processes.
        idle: Queue of processes, which several threads may share. The function uses
            these processes before it starts new ones. At the end, it puts all idle
            processes into the queue. None means that all processes end.

    Yields:
        Results of the runs, in the order in which the runs end.

    Raises:
        WorkerError: A worker process cannot be started.
    """
    pool = _Pool(tasks, deque() if idle is None else idle)
    try:
        for _ in range(workers):
            pool.start()
        while pool.busy:
            yield from pool.step()
            pulse()
    finally:
        close_workers(deque(pool.busy.values()))
        if idle is None:
            close_workers(pool.idle)


def close_workers(workers: deque[WorkerProcess]) -> None:
    """Ends the processes in a queue, and empties the queue."""
    with contextlib.suppress(IndexError):
        while True:
            workers.pop().close()


class _Pool:
    """Worker processes, and the tasks that they still have to run."""

    def __init__(self, tasks: Iterator[Task], idle: deque[WorkerProcess]) -> None:
        self.busy: dict[Connection, WorkerProcess] = {}
        self.idle = idle
        self._tasks = tasks
        self._first: deque[Task] = deque()
        self._again: dict[int, int] = {}

    def _next(self) -> Task | None:
        return self._first.popleft() if self._first else next(self._tasks, None)

    def start(self) -> None:
        """Takes or starts a worker for the next task, if there is one."""
        task = self._next()
        if task is None:
            return
        try:
            worker = self.idle.pop()
        except IndexError:
            worker = WorkerProcess(task)
        worker.give(task)
        self.busy[worker.connection] = worker

    def step(self) -> Iterator[Outcome]:
        for connection in wait(list(self.busy), PULSE_S):
            worker = self.busy[connection]  # type: ignore[index]
            try:
                outcome = worker.receive()
            except EOFError:
                yield from self._replace(worker)
                continue
            while len(worker.tasks) < AHEAD and (task := self._next()) is not None:
                worker.give(task)
            if not worker.tasks:
                self.idle.append(self.busy.pop(worker.connection))
            if outcome is not None:
                yield outcome

    def _replace(self, worker: WorkerProcess) -> Iterator[Outcome]:
        """Starts a new worker in place of a worker that has ended.

        The worker was running the first of its tasks. This task is tried again, at most
        ``ATTEMPTS`` times in all. The other tasks had not started and go to the next
        worker.
        """
        task, *others = worker.tasks
        self.busy.pop(worker.connection).close()
        self._first.extendleft(reversed(others))
        tried = self._again.pop(task.point.index, 1)
        if tried < ATTEMPTS:
            self._again[task.point.index] = tried + 1
            self._first.appendleft(task)
        else:
            yield lost_outcome(task, f"its worker process ended {ATTEMPTS} times")
        self.start()
