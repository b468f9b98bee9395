"""A worker replaces its child processes before they fill the memory."""

from __future__ import annotations

from multiprocessing import Pipe
from types import SimpleNamespace

from analysis.batches import worker


def test_a_child_that_has_grown_is_replaced(monkeypatch):
    """Each task keeps 30 MB, and a child may grow by 100 MB: it does four tasks."""
    kept = []

    def task_that_keeps_memory(task):
        kept.append(b"x" * 30_000_000)
        return len(kept)

    monkeypatch.setattr(worker, "run_task", task_that_keeps_memory)
    monkeypatch.setattr(worker, "RUNS_PER_CHILD", {"compiled": 8})
    monkeypatch.setattr(worker, "GROWTH_PER_CHILD", 100e6)
    here, there = Pipe()
    for _ in range(10):
        here.send(SimpleNamespace(engine="compiled"))
    assert worker._survives(lambda: worker._serve(there))
    answers = []
    while here.poll():
        answers.append(here.recv())
    assert answers == [1, 2, 3, 4]
