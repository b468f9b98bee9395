"""The engine: what is run is kept, once, whatever happens on the way."""

from __future__ import annotations

import json
import math
import resource
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis.batches.one_run import Outcome, Task, run_task
from analysis.batches.plan import SweepPlan
from analysis.batches.processes import WorkerError, WorkerProcess
from analysis.batches.store import StoreError, load_results
from analysis.batches.sweep import PreparedSweep, prepare_sweep
from analysis.runs.metric_table import run_metrics
from diagrams import simulate
from systems.framework.input_error import InputError

SPEED = "source.speed_m_s"
QUICK = {"hearing": "ideal", "obstacle_sensing": "ideal", "duration_s": 0.5}
LAWS = """
import os, signal
from pathlib import Path
from typing import Any

# A law is tried before the run: what fails later is another matter.
CALLS = {"nan": 0, "deadly": 0, "mortal": 0}

def tried(law):
    CALLS[law] += 1
    return CALLS[law] > 30

def nan(c, s, laws):
    return c * float("nan") if tried("nan") else 0.0

def deadly(c, s, laws):
    if tried("deadly"):
        os.kill(os.getpid(), signal.SIGKILL)
    return 0.0

def mortal(c, s, laws):
    mark = Path(__file__).with_name("died")
    if tried("mortal") and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 0.0
"""


def plan(**changes) -> SweepPlan:
    return SweepPlan.model_validate(
        {
            "set": QUICK,
            "grid": {"law": ["none", "active"]},
            "draw": {SPEED: {"uniform": [0.1, 0.5]}},
            "runs": 6,
            **changes,
        }
    )


def without_times(table: pd.DataFrame) -> pd.DataFrame:
    return table.drop(columns="wall_s")


def here(tasks: Iterator[Task], pulse: Callable[[], None]) -> Generator[Outcome]:
    """A runner without processes."""
    for task in tasks:
        yield run_task(task)
        pulse()


def prepared(out: Path, *, resume: bool = False, **changes) -> PreparedSweep:
    sweep = prepare_sweep(plan(**changes), out, resume=resume)
    return replace(sweep, runner=here)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> pd.DataFrame:
    return prepared(tmp_path_factory.mktemp("sweep") / "out").run()


@pytest.fixture
def laws(tmp_path, monkeypatch) -> Path:
    (tmp_path / "sweep_laws.py").write_text(LAWS)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_row_is_what_the_scenario_gives(undisturbed):
    sweep = plan()
    point = sweep.points()[7]
    result = simulate(sweep.scenario_of(point))
    row = undisturbed.iloc[7]
    assert row["index"] == 7
    assert (row["law"], row[SPEED], row["seed"]) == (
        point.fields["law"],
        point.fields[SPEED],
        point.seed,
    )
    assert row["cause"] == result.cause
    assert row["simulated_s"] == result.simulated_s
    for name, value in run_metrics(result).items():
        if value is None:
            assert math.isnan(row[name])
        else:
            assert row[name] == value
    assert pd.isna(row["error"])


def test_processes_give_the_same_rows(undisturbed, tmp_path):
    seen: list[int] = []
    table = prepare_sweep(plan(), tmp_path / "out", workers=2).run(seen.append)
    pd.testing.assert_frame_equal(without_times(table), without_times(undisturbed))
    assert seen[0] == 0
    assert seen[-1] == 12
    assert seen == sorted(seen)


def test_directory_holds_the_plan_and_one_table(tmp_path, undisturbed):
    out = tmp_path / "new" / "out"
    prepared(out).run()
    assert {path.name for path in out.iterdir()} == {
        "sweep.yaml",
        "scenario.yaml",
        "scenario.schema.json",
        "sweep.json",
        "runs.parquet",
    }
    pd.testing.assert_frame_equal(
        without_times(pd.read_parquet(out / "runs.parquet")),
        without_times(undisturbed),
    )
    assert "drake" in json.loads((out / "sweep.json").read_text())["versions"]


class StopError(Exception):
    pass


def stopped(out: Path, after: int, **changes) -> None:
    def stop(done: int) -> None:
        if done == after:
            raise StopError

    with pytest.raises(StopError):
        prepared(out, **changes).run(stop)


def test_stopped_sweep_goes_on(tmp_path, undisturbed):
    out = tmp_path / "out"
    stopped(out, after=5)
    assert len(load_results(out)) == 5
    assert len(pd.read_parquet(out / "runs.parquet")) == 5
    counts: list[int] = []
    table = prepared(out, resume=True).run(counts.append)
    assert counts[0] == 5
    pd.testing.assert_frame_equal(without_times(table), without_times(undisturbed))
    again = prepared(out, resume=True).run(counts.append)
    assert counts[-1] == 12
    pd.testing.assert_frame_equal(again, table)


@pytest.mark.parametrize("after", [2, 4])
def test_more_runs_are_added(tmp_path, undisturbed, after):
    """An unfinished or finished sweep of 2 runs per cell grows to 6 per cell."""
    out = tmp_path / "out"
    if after < 4:
        stopped(out, after, runs=2)
    else:
        prepared(out, runs=2).run()
    few = load_results(out)
    counts: list[int] = []
    table = prepared(out, resume=True).run(counts.append)
    assert counts[0] == after
    pd.testing.assert_frame_equal(without_times(table), without_times(undisturbed))
    # Finished runs were not repeated: their computing times are the former ones.
    kept = table[table["index"].isin(few["index"])]["wall_s"]
    assert kept.tolist() == few["wall_s"].tolist()
    with pytest.raises(InputError, match=r"runs: is 2, but the sweep in .* has 6 runs"):
        prepared(out, resume=True, runs=2)


@pytest.mark.parametrize("torn", [b'{"index": 11, "cel', b"\x00\x00\x00", b"{}"])
def test_half_a_line_is_run_again(tmp_path, undisturbed, torn):
    out = tmp_path / "out"
    stopped(out, after=5)
    with (out / "runs.jsonl").open("ab") as file:
        file.write(torn)
    assert len(load_results(out)) == 5
    table = prepared(out, resume=True).run()
    pd.testing.assert_frame_equal(without_times(table), without_times(undisturbed))


def changed(row: dict[str, Any], **changes: Any) -> bytes:
    return json.dumps({**row, **changes}).encode() + b"\n"


def test_lines_that_are_no_runs_of_the_plan_are_dropped(tmp_path, undisturbed, caplog):
    """Line 6 on: an index outside, a negative one, other draws, another kind of row."""
    out = tmp_path / "out"
    stopped(out, after=5)
    journal = out / "runs.jsonl"
    rows = [json.loads(line) for line in journal.read_bytes().splitlines()]
    left = next(index for index in range(12) if index not in {r["index"] for r in rows})
    foreign = [
        changed(rows[0], index=999),
        changed(rows[0], index=-1),
        changed(rows[0], index=left),
        changed(rows[1], seed=rows[1]["seed"] + 1),
        changed(rows[1], fields=rows[2]["fields"] | {SPEED: 9.0}),
        changed(rows[1], metrics={"path_length_m": "far"}),
        b'{"index": 3}\n',
        b"[" * 100_000 + b"\n",
        changed(rows[2], cause="goal"),
        changed(rows[3]),
    ]
    with journal.open("ab") as file:
        file.write(b"".join(foreign))
    counts: list[int] = []
    table = prepared(out, resume=True).run(counts.append)
    assert counts[0] == 4
    pd.testing.assert_frame_equal(without_times(table), without_times(undisturbed))
    (said,) = caplog.messages
    assert said.startswith(f"{journal}: 10 lines do not belong to this sweep")
    assert "(line 3, 6, 7, 8, 9, 10, 11, 12, 13, 14)" in said


@pytest.mark.parametrize("column", ["index", "seed"])
def test_a_table_of_other_runs_is_refused(tmp_path, column):
    out = tmp_path / "out"
    table = prepared(out).run()
    for other in (table.assign(**{column: table[column] + 1}), table[1:]):
        other.to_parquet(out / "runs.parquet", index=False)
        with pytest.raises(InputError, match="does not hold the runs of this sweep"):
            prepared(out, resume=True)
    (out / "runs.parquet").unlink()
    again = prepared(out, resume=True).run()
    pd.testing.assert_frame_equal(without_times(again), without_times(table))


def test_a_sweep_can_be_resumed_from_nothing(tmp_path, undisturbed):
    table = prepared(tmp_path / "out", resume=True).run()
    pd.testing.assert_frame_equal(without_times(table), without_times(undisturbed))


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """A limit on the size of files is a full disk to those who write."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_full_disk_keeps_what_is_done(tmp_path, undisturbed):
    out = tmp_path / "out"
    sweep = prepared(out)
    with (
        files_of_at_most(6000),
        pytest.raises(StoreError, match="finished runs are kept"),
    ):
        sweep.run()
    kept = load_results(out)
    assert 1 <= len(kept) < 12
    table = prepared(out, resume=True).run()
    pd.testing.assert_frame_equal(without_times(table), without_times(undisturbed))


def test_full_disk_is_noticed_before_anything_runs(tmp_path):
    with (
        files_of_at_most(100),
        pytest.raises(StoreError, match=r"out cannot be written"),
    ):
        prepared(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_trajectories_are_those_of_the_runs(tmp_path):
    out = tmp_path / "out"
    table = prepared(out, trajectories=True, runs=1).run()
    names = sorted(path.name for path in (out / "trajectories").iterdir())
    assert names == ["000000.parquet", "000001.parquet"]
    sweep = plan()
    expected = simulate(sweep.scenario_of(sweep.points()[1])).trajectory
    found = pd.read_parquet(out / "trajectories" / "000001.parquet")
    pd.testing.assert_frame_equal(found, expected)
    assert len(table) == 2


def test_a_run_that_fails_is_recorded_and_the_rest_goes_on(tmp_path, laws):
    table = prepared(
        tmp_path / "out", grid={"law": ["sweep_laws:nan", "active"]}, runs=2
    ).run()
    assert list(table["cause"]) == ["failed", "completed"] * 2
    assert "'sweep_laws:nan' returns nan at c = " in table["error"][0]
    assert pd.isna(table["minimum_clearance_m"][0])
    assert table["seed"][0] == table["seed"][1]


@pytest.mark.slow
def test_a_run_that_kills_its_process_is_recorded(tmp_path, laws):
    laws_used = ["sweep_laws:deadly", "sweep_laws:mortal", "active"]
    sweep = prepare_sweep(
        plan(grid={"law": laws_used}, runs=1), tmp_path / "out", workers=1
    )
    table = sweep.run()
    assert list(table["cause"]) == ["failed", "completed", "completed"]
    assert "ended 2 times" in table["error"][0]
    assert (laws / "died").exists()


def test_worker_that_cannot_start_says_so(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    sweep = plan()
    point = sweep.points()[0]
    scenario = sweep.scenario_of(point)
    worker = WorkerProcess(Task(point, scenario, "drake", trajectory=False))
    with pytest.raises(WorkerError, match="could not start"):
        worker.receive()
    worker.close()


@pytest.mark.parametrize(
    ("changes", "hint"),
    [
        ({"seed": 2}, "differs in seed"),
        ({"runs": 7, "draw": {}}, "differs in draw"),
    ],
)
def test_another_sweep_is_refused(tmp_path, changes, hint):
    out = tmp_path / "out"
    stopped(out, after=1)
    with pytest.raises(ValueError, match=f"out: .*{hint}"):
        prepared(out, resume=True, **changes)
    assert len(load_results(out)) == 1


def test_changed_scenario_file_is_another_sweep(tmp_path):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text("arena_m: [5, 5]\n")
    prepared(tmp_path / "out", scenario=str(scenario)).run()
    scenario.write_text("arena_m: [5, 6]\n")
    with pytest.raises(ValueError, match="differs in the scenario's file"):
        prepared(tmp_path / "out", resume=True, scenario=str(scenario))


def test_other_versions_are_refused(tmp_path):
    out = tmp_path / "out"
    stopped(out, after=1)
    manifest = json.loads((out / "sweep.json").read_text())
    manifest["versions"]["drake"] = "1.0"
    (out / "sweep.json").write_text(json.dumps(manifest))
    with pytest.raises(ValueError, match=r"made with drake 1\.0; install these"):
        prepared(out, resume=True)


def test_used_directories_are_refused(tmp_path):
    out = tmp_path / "out"
    first = prepared(out)
    with pytest.raises(ValueError, match="out: another process uses"):
        prepared(out, resume=True)
    first.store.close()
    with pytest.raises(ValueError, match="not empty"):
        prepared(out)
    other = tmp_path / "other"
    other.mkdir()
    (other / "mine").write_text("keep")
    with pytest.raises(ValueError, match="holds no sweep"):
        prepared(other, resume=True)
    assert [path.name for path in other.iterdir()] == ["mine"]
    with pytest.raises(ValueError, match="is a file"):
        prepared(other / "mine", resume=True)
    with pytest.raises(ValueError, match="holds no results"):
        load_results(other)


@pytest.mark.parametrize(
    ("options", "hint"),
    [
        ({"workers": 0}, "workers: 0 must lie between 1 and 256"),
        ({"resume": True}, "out: --resume needs the directory"),
        ({"scheduler": "tcp://h:1", "workers": 2}, "leave out --workers"),
    ],
)
def test_bad_options_are_refused(options, hint):
    with pytest.raises(ValueError, match=hint):
        prepare_sweep(plan(), **options)


def test_unknown_law_in_the_grid_is_refused_before_anything_runs(tmp_path):
    with pytest.raises(ValueError, match="law: 'magic' is not known"):
        prepare_sweep(plan(grid={"law": ["active", "magic"]}), tmp_path / "out")
    assert not (tmp_path / "out").exists()
