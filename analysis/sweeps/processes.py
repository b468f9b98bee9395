"""Local processes that run the points of a sweep."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Generator, Iterator
from multiprocessing.connection import Connection, wait

from analysis.run_error import RunError
from analysis.sweeps.one_run import Outcome, Task, lost_outcome
from analysis.sweeps.worker import READY
from diagrams import Scenario

__all__ = ["WorkerError", "WorkerProcess", "run_locally"]

#: How often a run is tried whose worker ends before it answers.
ATTEMPTS = 2
#: The caller is heard at least so often, s.
PULSE_S = 0.25
_MAIN = "import sys; from analysis.sweeps.worker import main; main(int(sys.argv[1]))"


class WorkerError(RunError):
    """Workers that cannot be started, or reached any more."""


class WorkerProcess:
    """A worker in a process of its own; see ``analysis/sweeps/worker.py``."""

    def __init__(self, scenario: Scenario) -> None:
        """Starts the process, which warms up with a scenario."""
        ours, theirs = socket.socketpair()
        self.connection = Connection(ours.detach())
        self.task: Task | None = None
        self.ready = False
        # With several threads a worker would be slower, and its sums different.
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)  # noqa: PTH109
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _MAIN, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                env={**os.environ, **threads, "PYTHONPATH": paths},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                start_new_session=True,
            )
        self._send(scenario)

    def _send(self, message: Task | Scenario) -> None:
        # A process that has just ended is noticed by receive.
        with contextlib.suppress(OSError):
            self.connection.send(message)

    def give(self, task: Task) -> None:
        """Hands over a task; ``receive`` gets its outcome."""
        self.task = task
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
                "a worker process could not start; what it printed says why"
            ) from None
        if message == READY:
            self.ready = True
            return None
        self.task = None
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
        self._again: dict[int, int] = {}

    def start(self) -> None:
        """A worker for the next task, if there is one."""
        task = next(self._tasks, None)
        if task is not None:
            self._employ(task)

    def _employ(self, task: Task) -> None:
        worker = WorkerProcess(task.scenario)
        worker.task = task
        self.busy[worker.connection] = worker

    def step(self) -> Iterator[Outcome]:
        for connection in wait(list(self.busy), PULSE_S):
            worker = self.busy[connection]  # type: ignore[index]
            try:
                outcome = worker.receive()
            except EOFError:
                yield from self._replace(worker)
                continue
            task = worker.task if outcome is None else next(self._tasks, None)
            if task is None:
                self._dismiss(worker)
            else:
                worker.give(task)
            if outcome is not None:
                yield outcome

    def _replace(self, worker: WorkerProcess) -> Iterator[Outcome]:
        """The run of a worker that has ended goes to a new one."""
        task = worker.task
        self._dismiss(worker)
        assert task is not None
        tried = self._again.pop(task.point.index, 1)
        if tried < ATTEMPTS:
            self._again[task.point.index] = tried + 1
            self._employ(task)
        else:
            yield lost_outcome(task, f"its worker process ended {ATTEMPTS} times")
            self.start()

    def _dismiss(self, worker: WorkerProcess) -> None:
        del self.busy[worker.connection]
        worker.close()

    def close(self) -> None:
        for worker in list(self.busy.values()):
            self._dismiss(worker)
