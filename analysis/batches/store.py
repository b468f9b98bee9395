"""The directory of a parameter sweep, which saves each run as soon as the run ends.

While a sweep is running, each finished run adds a line to ``runs.jsonl``. When all runs
are finished, ``runs.parquet`` replaces this file. A plan with more runs per cell than
before adds runs to the directory.
"""

from __future__ import annotations

import fcntl
import json
import logging
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pandas as pd
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from analysis.batches.one_run import (
    Outcome,
    is_row,
    parquet_bytes,
    results_table,
    table_rows,
)
from analysis.batches.plan import SweepPlan, SweepPoint, dump_plan
from analysis.report.provenance import SCHEMA_VERSION, versions
from analysis.report.result_directory import whole_directory
from analysis.run_error import RunError
from diagrams import write_scenario
from diagrams.scenario.own_sources import write_own_sources
from diagrams.scenario.scenario import scenario_from_mapping
from systems.framework.input_error import InputError, shortened

_LOGGER = logging.getLogger("phonotaxis")

JOURNAL, TABLE = "runs.jsonl", "runs.parquet"
MANIFEST, PLAN = "sweep.json", "sweep.yaml"


class StoreError(RunError):
    """Results cannot be written. Earlier results are kept."""


class SweepStore:
    """Open directory of a sweep, which no other process can open."""

    def __init__(
        self, out: Path | None, plan: SweepPlan, points: Sequence[SweepPoint]
    ) -> None:
        """Opens the directory of a sweep, or creates the directory.

        If ``out`` is None, the directory is the next number under results/. The
        argument ``points`` contains all runs of the plan, sorted by their number.
        Raises InputError if the directory contains anything but this sweep, or
        is in use. Raises InputError or StoreError if it cannot be written.
        """
        self._journal = -1
        try:
            if out is not None and out.is_dir() and any(out.iterdir()):
                _check_same(out, plan)
                _check_grows(out, plan)
                self.out = out
            else:
                with whole_directory(out) as (self.out, directory):
                    _make(directory, plan)
            self._lock = _locked(self.out / MANIFEST)
        except BlockingIOError:
            raise InputError(
                "out", f"another process uses {out}; wait until it ends"
            ) from None
        except OSError as error:
            raise _unwritable(out, error) from None
        try:
            text = dump_plan(plan)
            if (self.out / PLAN).read_text("utf-8") != text:
                _write_whole(self.out / PLAN, text.encode())
            self._open(points)
        except InputError:
            self.close()
            raise
        except OSError as error:
            self.close()
            raise _unwritable(self.out, error) from None

    def _open(self, points: Sequence[SweepPoint]) -> None:
        """Finds the finished runs; removes lines of the file that are not runs."""
        path = self.out / JOURNAL
        if (self.out / TABLE).exists() and not path.exists():
            known = _known_runs(self.out, points)
            if len(known) == len(points):
                self.done = set(known)
                return
            # The sweep grows: the runs of its table are the first lines again.
            rows = table_rows(load_results(self.out), known)
            _write_whole(path, b"".join(map(_line, rows)))
        lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
        kept, dropped = _runs_of(points, lines)
        if dropped:
            numbers = shortened(", ".join(map(str, dropped)), 60)
            _LOGGER.warning(
                "%s: %d lines do not belong to this sweep, or contradict other lines "
                "(line %s); they are dropped, and missing runs are repeated",
                *(path, len(dropped), numbers),
            )
        self.done = set(kept)
        whole = b"".join(kept.values())
        if whole != b"".join(lines):
            _write_whole(path, whole)
        self._journal = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)

    def add(self, outcome: Outcome) -> None:
        """Writes the results of a run; raises StoreError if this fails."""
        index = outcome.row["index"]
        line = memoryview(_line(outcome.row))
        size = os.fstat(self._journal).st_size
        try:
            if outcome.trajectory is not None:
                _write_whole(trajectory_path(self.out, index), outcome.trajectory)
            while line:
                line = line[os.write(self._journal, line) :]
        except OSError as error:
            os.ftruncate(self._journal, size)
            raise self._stopped(error) from None
        self.done.add(index)

    def write_table(self, *, complete: bool) -> None:
        """Writes the table of all finished runs.

        If ``complete`` is true, all runs are finished, and ``runs.jsonl`` is removed.
        Raises StoreError if the disk is full or faulty.
        """
        if self._journal < 0:
            return
        try:
            table = parquet_bytes(load_results(self.out))
            _write_whole(self.out / TABLE, table)
            if complete:
                (self.out / JOURNAL).unlink()
        except OSError as error:
            raise self._stopped(error) from None

    def _stopped(self, error: OSError) -> StoreError:
        return StoreError(
            f"{self.out} cannot be written ({error.strerror}); the {len(self.done)} "
            "finished runs are kept: free space on the disk and continue with --resume"
        )

    def close(self) -> None:
        """Unlocks the directory for other processes."""
        if self._journal >= 0:
            os.close(self._journal)
        os.close(self._lock)


def load_results(out: str | Path) -> pd.DataFrame:
    """Loads the finished runs of a parameter sweep, even while the sweep is running.

    The table has one row per run, sorted by the run's number; ``results_table``
    describes the columns. Raises InputError if the directory contains no sweep.
    """
    journal, table = Path(out) / JOURNAL, Path(out) / TABLE
    if journal.exists():
        rows = map(_parse, journal.read_bytes().splitlines(keepends=True))
        return results_table({row["index"]: row for row in rows if row}.values())
    if table.exists():
        try:
            return pd.read_parquet(table)
        except ValueError as error:  # pyarrow's complaint about a damaged file
            raise InputError("out", f"{table} cannot be read ({error})") from None
    raise InputError("out", f"{out} holds no results of a sweep; check the path")


def trajectory_path(out: Path, index: int) -> Path:
    """Returns the file of the trajectory of the run with this number."""
    return out / "trajectories" / f"{index:06d}.parquet"


def _unwritable(out: Path | None, error: OSError) -> StoreError:
    return StoreError(
        f"{out or 'results'} cannot be written ({error.strerror}); free space on the "
        "disk, or name another directory with --out"
    )


def _make(out: Path, plan: SweepPlan) -> None:
    if plan.trajectories:
        (out / "trajectories").mkdir()
    (out / PLAN).write_text(dump_plan(plan), "utf-8")
    base = scenario_from_mapping(plan.base)
    write_scenario(base, out, relative=True)
    write_own_sources(plan.own_names(), out)
    (out / JOURNAL).touch()
    manifest = {
        "schema_version": SCHEMA_VERSION,
        "plan_sha256": plan.digest,
        "files_sha256": plan.named_digests,
        "versions": versions(),
    }
    (out / MANIFEST).write_text(json.dumps(manifest, indent=2) + "\n")


def _locked(path: Path) -> int:
    lock = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        raise
    return lock


def _check_same(out: Path, plan: SweepPlan) -> None:
    """Checks that the directory belongs to a sweep with the same plan and versions."""
    try:
        manifest = json.loads((out / MANIFEST).read_text("utf-8"))
        stored = YAML(typ="safe").load(out / PLAN)
        digest, found = manifest["plan_sha256"], manifest["versions"]
        then = manifest.get("files_sha256", {})
        ours = YAML(typ="safe").load(dump_plan(plan))
        parts = [key for key in ours if stored.get(key) != ours[key]]
    except (OSError, ValueError, YAMLError, TypeError, LookupError, AttributeError):
        raise InputError(
            "out", f"{out} holds no sweep; name the directory of one, or a new one"
        ) from None
    if digest != plan.digest:
        files = plan.named_digests
        names = sorted({*files, *then})
        parts += [name for name in names if files.get(name) != then.get(name)]
        what = ", ".join(parts) or "the scenario's file"
        raise InputError(
            "out",
            f"{out} holds another sweep, which differs in {what}; name another "
            "directory",
        )
    now = versions()
    parts = [
        f"{name} {found.get(name)}" for name in now if found.get(name) != now[name]
    ]
    if parts:
        raise InputError(
            "out",
            f"the runs in {out} were made with {', '.join(parts)}; install these "
            "versions, or name another directory",
        )


def _runs_of(
    points: Sequence[SweepPoint], lines: Sequence[bytes]
) -> tuple[dict[int, bytes], list[int]]:
    """Returns the line of each run, by number of the run, and numbers of wrong lines.

    If two different lines claim to be the same run, both count as wrong. An incomplete
    last line is ignored, because a crash can leave one. Lines are numbered from 1.
    """
    found: dict[int, dict[bytes, int]] = {}
    others = []
    for number, line in enumerate(lines, 1):
        row = _parse(line)
        if row is not None and _is_run_of(points, row):
            found.setdefault(row["index"], {}).setdefault(line, number)
        elif line.endswith(b"\n"):
            others.append(number)
    kept = {index: next(iter(own)) for index, own in found.items() if len(own) == 1}
    doubtful = (own.values() for own in found.values() if len(own) > 1)
    return kept, sorted([*others, *(number for own in doubtful for number in own)])


def _is_run_of(points: Sequence[SweepPoint], row: dict[str, Any]) -> bool:
    """Returns whether a row has the same seed and fields as the point of its index."""
    if not 0 <= row["index"] < len(points):
        return False
    point = vars(points[row["index"]])
    return json.dumps({name: row[name] for name in point}) == json.dumps(point)


def _known_runs(out: Path, points: Sequence[SweepPoint]) -> dict[int, SweepPoint]:
    """Returns the points of a table of finished runs, by number of the run.

    Raises InputError if the runs are not the first runs of the plan.
    """
    table = load_results(out)
    own = [(point.index, point.seed) for point in points[: len(table)]]
    if not {"index", "seed"} <= {*table} or own != [
        *zip(table["index"], table["seed"], strict=True)
    ]:
        raise InputError(
            "out",
            f"{out / TABLE} does not hold the runs of this sweep; remove it to repeat "
            "them, or name another directory",
        )
    return {point.index: point for point in points[: len(table)]}


def _check_grows(out: Path, plan: SweepPlan) -> None:
    """Rejects a plan with fewer runs than the directory already has."""
    stored = YAML(typ="safe").load(out / PLAN).get("runs", 1)
    if stored > plan.runs:
        raise InputError(
            "runs",
            f"is {plan.runs}, but the sweep in {out} has {stored} runs per cell; give "
            f"{stored} or more, or name another directory",
        )


def _line(row: dict[str, Any]) -> bytes:
    return (json.dumps(row, allow_nan=False) + "\n").encode()


def _parse(line: bytes) -> dict[str, Any] | None:
    """Reads a row from a line; None if the line is incomplete or is not a row."""
    if not line.endswith(b"\n"):
        return None
    with suppress(ValueError, RecursionError):
        row: dict[str, Any] = json.loads(line)
        if is_row(row):
            return row
    return None


def _write_whole(path: Path, content: bytes) -> None:
    """Writes a file that appears complete or not at all."""
    partial = path.with_name(f".{path.name}.part")
    try:
        with partial.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
