"""What an interrupt leaves, whenever it strikes."""

from __future__ import annotations

import os
import signal
import sys
import time
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from analysis.run_error import RunError
from phonotaxis.commands.carry_out import carry_out
from phonotaxis.commands.command import Command, Job, Take
from phonotaxis.commands.interrupts import Interrupts

OPTIONS = Namespace(json=False)


def strike(*_: Any) -> Any:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(2.0)


def carried_out(make: Callable[[Take], Job[Any]]) -> None:
    command = Command("trial", "", lambda _: None, lambda _, take: make(take))
    with Interrupts() as interrupts:
        carry_out(command, OPTIONS, interrupts)


def in_directory(out: Path, **steps: Any) -> Callable[[Take], Job[Any]]:
    """A job that writes a file, in which one step may be another."""

    def make(take: Take) -> Job[Any]:
        place = take(str(out))
        usual: dict[str, Any] = {
            "run": lambda _: 3,
            "summary": lambda found: {"found": found},
            "text": lambda found, _: f"{found} found",
            "write": lambda *_: (place.directory / "file").write_text("whole"),
        }
        return Job(**usual | steps, out=place.out)

    return make


def test_result_text_and_place(tmp_path, capsys):
    out = tmp_path / "a" / "out"
    carried_out(in_directory(out))
    assert (out / "file").read_text() == "whole"
    assert capsys.readouterr().out == f"3 found\n\nresults in {out}\n"


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_what_is_no_exception_and_no_interrupt_has_failed(tmp_path, kind):
    """As a user's block may raise it while it runs."""

    def leave(_: Any) -> None:
        raise kind

    complaint = f"ended from within, by {kind.__name__} in .*test_carry_out.py"
    with pytest.raises(RunError, match=complaint):
        carried_out(in_directory(tmp_path / "out", run=leave))
    assert list(tmp_path.iterdir()) == []


def test_standard_output_is_for_the_result(tmp_path, capsys):
    def talk(_: Any) -> int:
        sys.stdout.write("a user's block\n")
        return 3

    carried_out(in_directory(tmp_path / "out", run=talk))
    printed = capsys.readouterr()
    assert printed.out == f"3 found\n\nresults in {tmp_path}/out\n"
    assert printed.err == "a user's block\n"


@pytest.mark.parametrize("step", ["run", "summary", "write"])
def test_nothing_is_left_of_what_was_not_done(tmp_path, capsys, step):
    with pytest.raises(KeyboardInterrupt):
        carried_out(in_directory(tmp_path / "a" / "out", **{step: strike}))
    assert list(tmp_path.iterdir()) == []
    assert capsys.readouterr().out == ""


def test_results_are_told_of_where_only_their_text_is_missing(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(RunError, match=f"interrupted; the results are in {out}"):
        carried_out(in_directory(out, text=strike))
    assert (out / "file").read_text() == "whole"


def test_runs_that_are_kept_are_told_of(tmp_path):
    job: Job[None] = Job(
        run=strike,
        summary=lambda _: {},
        text=lambda *_: "",
        out=tmp_path,
        total=7,
        kept=lambda: 2,
    )
    with pytest.raises(RunError, match="interrupted; 2 of 7 runs are kept: continue"):
        carried_out(lambda _: job)
