"""An interrupt strikes where it may, and is never lost."""

from __future__ import annotations

import contextlib
import ctypes
import importlib.machinery
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from phonotaxis.commands.interrupts import Interrupts

ROOT = Path(__file__).resolve().parents[3]


def strike() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def wait() -> None:
    """Longer than an interrupt waits before it tries again."""
    time.sleep(2.0)


def steps_until_interrupted(work: Callable[[Interrupts, list[str]], None]) -> list[str]:
    """What a piece of work has noted when an interrupt ends it."""
    steps: list[str] = []
    with Interrupts() as interrupts, pytest.raises(KeyboardInterrupt):
        work(interrupts, steps)
    return steps


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_it_strikes_at_once_and_handlers_come_back(kind):
    def work(_, steps):
        os.kill(os.getpid(), kind)
        wait()
        steps.append("never")

    before = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    assert steps_until_interrupted(work) == []
    after = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    assert after == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_one_that_is_held_waits_for_a_check():
    def work(interrupts, steps):
        with interrupts.held():
            strike()
            steps.append("after")
            interrupts.check()
            steps.append("never")

    assert steps_until_interrupted(work) == ["after"]


def test_one_that_is_held_comes_at_the_end():
    def work(interrupts, steps):
        with interrupts.held():
            strike()
            steps.append("after")
        steps.append("never")

    assert steps_until_interrupted(work) == ["after"]


def test_nothing_stops_what_cleans_up():
    def work(interrupts, steps):
        with contextlib.suppress(ZeroDivisionError), interrupts.watched():
            raise ZeroDivisionError
        strike()
        steps.append("cleaned")
        interrupts.release()
        steps.append("never")

    assert steps_until_interrupted(work) == ["cleaned"]


def test_what_became_another_error_counts():
    def work(interrupts, _):
        with interrupts.watched():
            try:
                strike()
                wait()
            except KeyboardInterrupt:
                raise SystemError from None

    assert steps_until_interrupted(work) == []


def test_one_that_was_swallowed_strikes_again():
    def work(_, steps):
        with contextlib.suppress(KeyboardInterrupt):
            strike()
            wait()
        steps.append("swallowed")
        wait()
        steps.append("never")

    assert steps_until_interrupted(work) == ["swallowed"]


def test_one_that_a_callback_swallowed_is_not_printed(capsys):
    """As numba's, while it compiles."""

    def work(_, steps):
        def callback():
            strike()
            wait()

        ctypes.CFUNCTYPE(None)(callback)()
        steps.append("swallowed")
        wait()
        steps.append("never")

    assert steps_until_interrupted(work) == ["swallowed"]
    assert capsys.readouterr().err == ""


def test_an_extension_that_loads_is_not_disturbed():
    """Its initialisation may run Python, as Drake's and numpy's do."""

    def work(_, steps):
        class Loader(importlib.machinery.ExtensionFileLoader):
            def exec_module(self, module):
                strike()
                steps.append("loaded")

        Loader("module", "nowhere.so").exec_module(None)
        wait()
        steps.append("never")

    assert steps_until_interrupted(work) == ["loaded"]


@pytest.mark.parametrize("name", ["KeyboardInterrupt", "SystemError"])
def test_python_does_not_die_of_what_was_caught(name):
    """It would, of a KeyboardInterrupt that has left a string that is evaluated."""
    code = f"""
import contextlib, os, signal, sys
from phonotaxis.commands.interrupts import Interrupts

with contextlib.suppress(KeyboardInterrupt), Interrupts(last=True) as interrupts:
    with interrupts.watched():
        try:
            exec("os.kill(os.getpid(), signal.SIGINT)")
        except KeyboardInterrupt as error:
            raise {name} from error
os.kill(os.getpid(), signal.SIGINT)
sys.exit(1)
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (1, "")


def test_one_that_is_taken_counts_no_longer():
    with Interrupts() as interrupts:
        with pytest.raises(KeyboardInterrupt):
            strike()
        interrupts.take()
        interrupts.check()
        time.sleep(0.3)  # it would strike again
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
