"""The steps of every subcommand: prepare, run, write the files, print."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from contextlib import AbstractContextManager, ExitStack, nullcontext, redirect_stdout
from functools import partial
from typing import Any

from analysis.commands.command import Command, Job, Place
from analysis.commands.interrupts import Interrupts
from analysis.commands.progress import Progress


def carry_out(command: Command, options: Namespace, interrupts: Interrupts) -> None:
    """Runs a subcommand: prepares and runs its job, writes files, and prints results.

    Args:
        command: The subcommand.
        options: Parsed options of the command line.
        interrupts: Handler of Ctrl-C and SIGTERM in this process.

    Raises:
        InputError: The input is not valid.
        RunError: The run failed. Or an interrupt stopped the run, and some results
            remain on the disk.
        KeyboardInterrupt: An interrupt stopped the run, and no results remain.
    """
    job: Job[Any] | None = None
    try:
        with ExitStack() as stack, interrupts.watched():
            # This import loads most of the libraries, so an interrupt may hit it.
            from analysis.run_error import RunError, no_exit

            # Output of a user's code goes to standard error, so that standard output
            # contains the result only.
            with no_exit(), _output_of(command):
                job = command.prepare(options, partial(_take, stack, interrupts))
                found, summary = _run(job, interrupts)
    except KeyboardInterrupt:
        left = _left(job) if job is not None else ""
        if not left:
            raise
        raise RunError(f"interrupted; {left}") from None
    try:
        interrupts.release()
        _print(job, found, summary, as_json=options.json)
        interrupts.hold()
    except KeyboardInterrupt:
        interrupts.hold()
        if job.out is None:
            raise
        raise RunError(f"interrupted; the results are in {job.out}") from None
    job.demand(found)


def _output_of(command: Command) -> AbstractContextManager[Any]:
    return nullcontext() if command.prints else redirect_stdout(sys.stderr)


def _left(job: Job[Any]) -> str:
    """Describes the results that remain on the disk after an interrupt."""
    if job.kept is None:
        return job.left()
    return (
        f"{job.kept()} of {job.total} runs are kept: continue with --out {job.out} "
        "--resume"
    )


def _take(stack: ExitStack, interrupts: Interrupts, out: str | None) -> Place:
    from analysis.reporting.result_directory import whole_directory

    with interrupts.held():
        return Place(*stack.enter_context(whole_directory(out)))


def _run(job: Job[Any], interrupts: Interrupts) -> tuple[Any, dict[str, Any]]:
    done = job.kept() if job.kept is not None else 0.0
    with Progress(interrupts, job.total, job.unit, done) as progress:
        # An interrupt inside a compiled callback would become a SystemError.
        with interrupts.held() if job.total else nullcontext():
            found = job.run(progress)
        summary = job.summary(found)
        job.write(found, summary)
    return found, summary


def _print(job: Job[Any], found: Any, summary: Any, *, as_json: bool) -> None:
    for remark in job.remarks(found):
        print(f"phonotaxis: {remark}", file=sys.stderr)
    if as_json:
        text = json.dumps(summary, allow_nan=False)
    else:
        text = job.text(found, summary)
        if job.out is not None:
            text += f"\n{job.where.format(out=job.out)}"
    try:
        print(text, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        from analysis.run_error import RunError

        where = f"; the results are in {job.out}" if job.out is not None else ""
        raise RunError(
            f"standard output cannot be written ({error.strerror}){where}"
        ) from error
