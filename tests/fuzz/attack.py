"""Attacks the command line with bad inputs: ``make attack``.

Each case runs in a forked process and a directory of its own. It must end in time
with status 0, 1 or 2, say at most one line of at most 300 characters on standard
error, print JSON that is JSON, and leave what was there before as it was.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from pathlib import Path

from phonotaxis.commands.command_line import BAD_INPUT, MOST_FAULTS
from tests.fuzz.attack_cases import KINDS, Case, cases

LONGEST_LINE = 300
#: More than a case may take beside what the process has already.
MEMORY_BYTES = 4 * 1024**3
_KEPT = "an earlier result"


def attack(case: Case, *, seconds: float = 60.0) -> str:
    """Runs a case.

    Args:
        case: Words and files.
        seconds: Longest time that it may take.

    Returns:
        What is wrong with how it ended; empty if nothing is.
    """
    _load()
    folder = Path(tempfile.mkdtemp(prefix="attack-"))
    try:
        _prepare(folder, case)
        status = _run(folder, case, seconds)
        return _fault(folder, case, status)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@cache
def _load() -> None:
    """Imports once what commands import: the cases run in forked processes."""
    for name in (
        "analysis.stability.design_text",
        "analysis.arrays.localization_report",
        "analysis.arrays.locate_text",
        "analysis.runs.run_report",
        "analysis.stability.report_parts",
        "analysis.batches.dask_cluster",
        "analysis.batches.page",
        "control",
        "matplotlib.figure",
        "scipy.signal",
        "scipy.stats",
        "soundfile",
    ):
        import_module(name)


def _prepare(folder: Path, case: Case) -> None:
    work = folder / "work"
    (work / "full").mkdir(parents=True)
    (work / "full" / "kept.txt").write_text(_KEPT)
    (work / "results" / "0001").mkdir(parents=True)
    (work / "results" / "0001" / "kept.txt").write_text(_KEPT)
    (work / "empty").mkdir()
    (work / "link").symlink_to("full")
    (work / "dangling").symlink_to("nowhere")
    (work / "loop").symlink_to("loop")
    os.mkfifo(work / "fifo.yaml")
    for name, content in case.files.items():
        path = work / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)


def _run(folder: Path, case: Case, seconds: float) -> int | None:
    """Exit status; none where the time ran out."""
    child = os.fork()
    if child == 0:
        _be_child(folder, case)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def _be_child(folder: Path, case: Case) -> None:
    """Runs the command, and ends the process."""
    status = 99
    try:
        os.setsid()
        os.chdir(folder / "work")
        (folder / "out").touch()
        for descriptor, name in ((1, case.output or "out"), (2, "err")):
            file = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            os.dup2(file, descriptor)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        used = int(Path("/proc/self/statm").read_text().split()[0]) * 4096
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_BYTES,) * 2)
        status = _command(case.words)
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except BaseException:  # noqa: BLE001  # as Python would
        import traceback

        traceback.print_exc()
        sys.stderr.flush()
        status = 1
    finally:
        os._exit(status)


def _command(words: Sequence[str]) -> int:
    import phonotaxis

    try:
        return phonotaxis.main(words)
    except SystemExit as error:  # of --help alone
        return (
            error.code if isinstance(error.code, int) else int(error.code is not None)
        )


def _fault(folder: Path, case: Case, status: int | None) -> str:
    """The first thing that is wrong with how a case ended."""
    complaint = (folder / "err").read_bytes().decode("utf-8", "replace")
    lines, silent = complaint.splitlines(), "--json" in case.words
    most = MOST_FAULTS + 1 if status == BAD_INPUT else 1
    kept = [folder / "work" / name / "kept.txt" for name in ("full", "results/0001")]
    lost = [path for path in kept if not path.is_file() or path.read_text() != _KEPT]
    hidden = (folder / "work").glob(".*.*")
    left = [path for path in hidden if path.name not in case.files]
    faults = {
        "does not end": status is None,
        f"ends with status {status}": status not in (None, 0, 1, 2),
        f"traceback: {lines[-1:]}": "Traceback" in complaint,
        f"too many lines: {lines}": len(lines) > most,
        "a line that is too long": any(len(line) > LONGEST_LINE for line in lines),
        f"status {status} without a word": bool(status) and not lines and not silent,
        "success without its output": status == 0 and bool(case.output),
        f"lost: {lost}": bool(lost),
        f"left behind: {left}": bool(left),
    }
    for fault, found in faults.items():
        if found:
            return fault[:300]
    if status == 0 and silent and "--help" not in case.words:
        return _json_fault((folder / "out").read_text("utf-8"))
    return ""


def _json_fault(printed: str) -> str:
    def refuse(word: str) -> None:
        raise ValueError(f"prints {word}")

    try:
        json.loads(printed, parse_constant=refuse)
    except ValueError as error:
        return f"no JSON: {error}"
    return ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs many cases and prints those that fell short."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=4_000, help="cases (4000)")
    parser.add_argument("--seed", type=int, default=1, help="of all cases (1)")
    parser.add_argument("--kind", choices=KINDS, help="one kind alone")
    options = parser.parse_args(arguments)
    faults: Counter[str] = Counter()
    numbers: Counter[str] = Counter()
    seconds: defaultdict[str, float] = defaultdict(float)
    for case in cases(options.seed, options.count):
        if options.kind in (None, case.kind):
            numbers[case.kind] += 1
            start = time.monotonic()
            fault = attack(case)
            seconds[case.kind] += time.monotonic() - start
            if fault:
                faults[case.kind] += 1
                words = " ".join(word[:60] for word in case.words)
                _say(f"{case.kind}: {words!a}: {fault!a}")
    for kind, number in numbers.items():
        each = seconds[kind] / number
        _say(
            f"{kind:<14} {number:>6} cases {faults[kind]:>5} fell short, "
            f"{each:.2f} s each"
        )
    _say(f"{'all':<14} {numbers.total():>6} cases {faults.total():>5} fell short")
    return int(faults.total() > 0)


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
