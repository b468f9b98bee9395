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
from phonotaxis.commands.command import Command, Take
from phonotaxis.commands.interrupts import Interrupts
from phonotaxis.result import Prepared, Result

OPTIONS = Namespace(json=False)


def strike(*_: Any) -> Any:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(2.0)


class Count(Result):
    """A result of which one method may be another."""

    def __init__(self, **methods: Callable[..., Any]) -> None:
        self.methods = methods

    def document(self) -> dict[str, Any]:
        return self.methods.get("document", lambda: {"found": 3})()

    def __str__(self) -> str:
        return self.methods.get("text", lambda: "3 found")()

    def plot(self) -> Any:
        raise NotImplementedError

    def write(self, document: dict[str, Any], directory: Path) -> None:
        assert document["found"] == 3
        self.methods.get("write", lambda: None)()
        (directory / "file").write_text("whole")

    def failure(self, out: Path | None) -> Exception | None:
        return self.methods.get("failure", lambda: None)()


def carried_out(make: Callable[[Take], Prepared[Any]]) -> None:
    command = Command("trial", "", lambda _: None, lambda _, take: make(take))
    with Interrupts() as interrupts:
        carry_out(command, OPTIONS, interrupts)


def in_directory(
    out: Path,
    run: Callable[[Any], Any] = lambda _: None,
    total: float = 0.0,
    **methods: Callable[..., Any],
) -> Callable[[Take], Prepared[Any]]:
    """Work that writes a file."""

    def work(progress: Any) -> Count:
        run(progress)
        return Count(**methods)

    def make(take: Take) -> Prepared[Any]:
        take(str(out))
        return Prepared(run=work, total=total)

    return make


def test_result_text_and_place(tmp_path, capsys):
    out = tmp_path / "a" / "out"
    carried_out(in_directory(out))
    assert (out / "file").read_text() == "whole"
    assert capsys.readouterr().out == f"3 found\n\nresults in {out}\n"


def test_a_failure_is_raised_after_the_result(tmp_path, capsys):
    out = tmp_path / "out"
    with pytest.raises(RunError, match="no success"):
        carried_out(in_directory(out, failure=lambda: RunError("no success")))
    assert (out / "file").read_text() == "whole"
    assert capsys.readouterr().out.startswith("3 found")


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
    def talk(_: Any) -> None:
        sys.stdout.write("a user's block\n")

    carried_out(in_directory(tmp_path / "out", run=talk))
    printed = capsys.readouterr()
    assert printed.out == f"3 found\n\nresults in {tmp_path}/out\n"
    assert printed.err == "a user's block\n"


@pytest.mark.parametrize("step", ["run", "document", "write"])
def test_nothing_is_left_of_what_was_not_done(tmp_path, capsys, step):
    steps: dict[str, Any] = {step: strike}
    with pytest.raises(KeyboardInterrupt):
        carried_out(in_directory(tmp_path / "a" / "out", **steps))
    assert list(tmp_path.iterdir()) == []
    assert capsys.readouterr().out == ""


def test_work_that_reports_progress_ends_at_the_next_report(tmp_path):
    steps = []

    def run(progress: Any) -> None:
        strike()
        steps.append("not torn")
        progress(1.0)
        steps.append("never")

    with pytest.raises(KeyboardInterrupt):
        carried_out(in_directory(tmp_path / "out", run=run, total=2.0))
    assert steps == ["not torn"]
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_that_became_another_error_counts(tmp_path):
    """As in a callback of compiled code."""

    def run(_: Any) -> None:
        try:
            strike()
        except KeyboardInterrupt:
            raise SystemError from None

    with pytest.raises(KeyboardInterrupt):
        carried_out(in_directory(tmp_path / "out", run=run))


def test_results_are_told_of_where_only_their_text_is_missing(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(RunError, match=f"interrupted; the results are in {out}"):
        carried_out(in_directory(out, text=strike))
    assert (out / "file").read_text() == "whole"


def test_files_that_are_left_are_told_of():
    work: Prepared[Any] = Prepared(
        run=strike, total=7, left=lambda: "2 of 7 runs are kept"
    )
    with pytest.raises(RunError, match="interrupted; 2 of 7 runs are kept"):
        carried_out(lambda _: work)
