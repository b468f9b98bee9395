"""Local processes that run the points of a sweep."""

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

from analysis.run_error import RunError
from analysis.sweeps.one_run import Outcome, Task, lost_outcome
from analysis.sweeps.worker import READY

#: How often a run is tried whose worker ends before it answers.
ATTEMPTS = 2
#: Tasks that a worker has at once, so that it never waits for the next one.
AHEAD = 2
#: The caller is heard at least so often, s.
PULSE_S = 0.25
_MAIN = "import sys; from analysis.sweeps.worker import main; main(int(sys.argv[1]))"


class WorkerError(RunError):
    """Workers that cannot be started, or reached any more."""


class WorkerProcess:
    """A worker in a process of its own; see ``analysis/sweeps/worker.py``."""

    def __init__(self, task: Task) -> None:
        """Starts the process, which warms up with a task; it is not yet given that."""
        ours, theirs = socket.socketpair()
        self.connection = Connection(ours.detach())
        self.tasks: deque[Task] = deque()
        self.ready = False
        # With several threads a worker would be slower, and its sums different.
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        # Drake cannot be loaded where the locale's encoding is ASCII.
        encoding = {"PYTHONUTF8": "1"}
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)  # noqa: PTH109
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _MAIN, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                env={**os.environ, **threads, **encoding, "PYTHONPATH": paths},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                start_new_session=True,
            )
        self._send(task)

    def _send(self, message: Task) -> None:
        # A process that has just ended is noticed by receive.
        with contextlib.suppress(OSError):
            self.connection.send(message)

    def give(self, task: Task) -> None:
        """Hands over a task; ``receive`` gets its outcome, in the order of tasks."""
        self.tasks.append(task)
        self._send(task)

    def receive(self) -> Outcome | None:
        """Waits for the next message; none: that it is ready.

        Raises:
            EOFError: The process has ended.
            WorkerError: It has ended before it was ready.
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

    def run(self, task: Task) -> Outcome:
        """Runs a task to its end; errors as of ``receive``."""
        if not self.ready:
            self.receive()
        self.give(task)
        outcome = self.receive()
        assert outcome is not None
        return outcome

    def close(self) -> None:
        """Ends the process at once, with its child."""
        self.connection.close()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


def run_locally(
    tasks: Iterator[Task], pulse: Callable[[], None], *, workers: int
) -> Generator[Outcome]:
    """Runs tasks in local processes.

    Args:
        tasks: What to run.
        pulse: Called a few times a second; what it raises ends the work.
        workers: Number of processes.

    Yields:
        Outcomes as they come. A run whose worker ends, as when the system is
        out of memory, is tried once more.

    Raises:
        WorkerError: A worker cannot be started.
    """
    pool = _Pool(tasks)
    try:
        for _ in range(workers):
            pool.start()
        while pool.busy:
            yield from pool.step()
            pulse()
    finally:
        pool.close()


class _Pool:
    def __init__(self, tasks: Iterator[Task]) -> None:
        self.busy: dict[Connection, WorkerProcess] = {}
        self._tasks = tasks
        self._first: deque[Task] = deque()
        self._again: dict[int, int] = {}

    def _next(self) -> Task | None:
        return self._first.popleft() if self._first else next(self._tasks, None)

    def start(self) -> None:
        """A worker for the next task, if there is one."""
        task = self._next()
        if task is not None:
            self._first.appendleft(task)
            worker = WorkerProcess(task)
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
                self._dismiss(worker)
            if outcome is not None:
                yield outcome

    def _replace(self, worker: WorkerProcess) -> Iterator[Outcome]:
        """The runs of a worker that has ended go to a new one.

        It was at the first; the others waited.
        """
        task, *others = worker.tasks
        self._dismiss(worker)
        self._first.extendleft(reversed(others))
        tried = self._again.pop(task.point.index, 1)
        if tried < ATTEMPTS:
            self._again[task.point.index] = tried + 1
            self._first.appendleft(task)
        else:
            yield lost_outcome(task, f"its worker process ended {ATTEMPTS} times")
        self.start()

    def _dismiss(self, worker: WorkerProcess) -> None:
        del self.busy[worker.connection]
        worker.close()

    def close(self) -> None:
        for worker in list(self.busy.values()):
            self._dismiss(worker)
