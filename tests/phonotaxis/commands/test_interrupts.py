"""The first interrupt waits for a check, and a second one does not."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

import pytest

from phonotaxis.commands.interrupts import Interrupts


def strike(kind: int = signal.SIGINT) -> None:
    os.kill(os.getpid(), kind)
    time.sleep(0.01)


def steps_until_interrupted(work: Callable[[Interrupts, list[str]], None]) -> list[str]:
    """What a piece of work has noted when an interrupt ends it."""
    steps: list[str] = []
    with Interrupts() as interrupts, pytest.raises(KeyboardInterrupt):
        work(interrupts, steps)
    return steps


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_it_strikes_at_once_and_handlers_come_back(kind):
    def work(interrupts, steps):
        with interrupts.at_once():
            strike(kind)
            steps.append("never")

    before = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    assert steps_until_interrupted(work) == []
    after = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    assert after == before


def test_the_first_waits_for_a_check():
    def work(interrupts, steps):
        strike()
        steps.append("after")
        interrupts.check()
        steps.append("never")

    assert steps_until_interrupted(work) == ["after"]


def test_one_that_waited_strikes_where_it_may():
    def work(interrupts, steps):
        strike()
        steps.append("after")
        with interrupts.at_once():
            steps.append("never")

    assert steps_until_interrupted(work) == ["after"]


def test_the_second_does_not_wait():
    def work(_, steps):
        strike()
        steps.append("after")
        strike(signal.SIGTERM)
        steps.append("never")

    assert steps_until_interrupted(work) == ["after"]


def test_after_a_block_the_next_one_waits():
    def work(interrupts, steps):
        with interrupts.at_once():
            steps.append("in the block")
        strike()
        steps.append("after")
        interrupts.check()
        steps.append("never")

    assert steps_until_interrupted(work) == ["in the block", "after"]


def test_one_that_is_forgotten_counts_no_longer():
    with Interrupts() as interrupts:
        with pytest.raises(KeyboardInterrupt), interrupts.at_once():
            strike()
        assert interrupts.struck
        interrupts.forget()
        interrupts.check()


def test_signals_after_the_last_command_are_ignored():
    before = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    try:
        with Interrupts(last=True):
            pass
        strike()
    finally:
        for kind, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
            signal.signal(kind, handler)
