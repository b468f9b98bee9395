"""`phonotaxis sweep`, as a user meets it."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import phonotaxis
from analysis.batches.one_run import Task, results_table, run_task
from analysis.batches.plan import load_sweep
from analysis.batches.store import load_results

ROOT = Path(phonotaxis.__file__).parents[1]
SWEEP = """
scenario: one_moving_obstacle
set: {hearing: ideal, obstacle_sensing: ideal, duration_s: 0.5}
grid: {law: [none, active]}
draw: {source.speed_m_s: {uniform: [0.1, 0.5]}}
"""
#: The same, of the kind that other tests compile.
COMPILED = SWEEP.replace("obstacle_sensing: ideal, ", "").replace(
    "law: [none, active]", "collision_vector.velocity_term: [printed, closing]"
)


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.usefixtures("no_workers")
def test_json_document_page_and_reproduction(capsys, tmp_path):
    file, out = write(tmp_path / "two.yaml", SWEEP + "runs: 2\n"), tmp_path / "out"
    words = ["sweep", str(file), "--workers", "1", "--out", str(out)]
    status, printed, complaint = call(capsys, *words, "--json")
    assert (status, complaint) == (0, "")
    document = json.loads(printed)
    assert document == json.loads((out / "summary.json").read_text())
    assert document["runs"] == 4
    assert [cell["fields"]["law"] for cell in document["cells"]] == ["none", "active"]
    results = pd.read_parquet(out / "runs.parquet")
    for number, cell in enumerate(document["cells"]):
        clearance = results["minimum_clearance_m"][results["cell"] == number]
        assert cell["causes"] == {"completed": 2}
        assert cell["success"] == {
            "value": 1.0,
            "low": pytest.approx(0.3424, abs=1e-4),  # 2 / (2 + 1.96^2)
            "high": pytest.approx(1.0),
            "n": 2,
            "level": 0.95,
        }
        assert cell["metrics"]["minimum_clearance_m"]["value"] == np.median(clearance)
    page = (out / "report.html").read_text("utf-8")
    assert page.count("<svg") == 1
    assert "http" not in page.replace("http://www.w3.org", "")

    status, printed, complaint = call(capsys, *words)
    assert (status, printed) == (2, "")
    assert "not empty" in complaint
    status, printed, complaint = call(capsys, *words, "--resume")
    assert (status, complaint) == (0, "")
    assert "law active" in printed
    assert "report.html" in printed


@pytest.mark.parametrize(
    ("text", "words", "field", "hint"),
    [
        ("draw: {source.spee_m_s: {uniform: [0, 1]}}", [], "source.spee_m_s", "mean"),
        ("draw: {source.speed_m_s: {uniform: [1, 0]}}", [], "draw.source", "low <"),
        (
            "draw: {source.speed_m_s: {normal: [0, 1]}}\nruns: 9",
            [],
            "source.speed_m_s",
            "narrow",
        ),
        ("draw: {start.position_m.0: {uniform: [4, 5]}}", [], "source", "redraws"),
        ("grid: {law: [magic]}", [], "law", "conventional"),
        ("grid: {sound: [{}, {kind: wav, file: no.wav}]}", [], "sound.file", "no.wav"),
        ("run: 5", [], "run", "did you mean 'runs'"),
        ("runs: 5", ["--workers", "0"], "workers", "between 1 and 256"),
        ("runs: 5", ["--workers", "two"], "command line", "--help"),
        ("runs: 5", ["--scheduler", "tcp://127.0.0.1:9"], "scheduler", "reached"),
        ("runs: 5", ["--scheduler", "nonsense"], "scheduler", "tcp://host:8786"),
        (None, [], "sweep", "give the path of a YAML file"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, tmp_path, text, words, field, hint):
    file, out = tmp_path / "sweep.yaml", tmp_path / "out"
    if text is not None:
        base = "set: {source.waypoints_m: [[4.5, 0]]}\n"
        file.write_text(base + text + "\n")
    words = ["sweep", str(file), "--out", str(out), *words]
    status, printed, complaint = call(capsys, *words)
    assert (status, printed) == (2, "")
    assert len(complaint.splitlines()) == 1
    assert f"phonotaxis: {field}" in complaint
    assert hint in complaint
    assert not out.exists()
    status, printed, complaint = call(capsys, *words, "--json")
    assert (status, complaint) == (2, "")
    assert json.loads(printed)["error"]["field"].startswith(field)


def test_directory_of_another_sweep_is_refused(capsys, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    write(out / "mine", "keep")
    file = write(tmp_path / "sweep.yaml", SWEEP)
    status, _, complaint = call(
        capsys, "sweep", str(file), "--out", str(out), "--resume"
    )
    assert status == 2
    assert "out: " in complaint
    assert [path.name for path in out.iterdir()] == ["mine"]


def begin(file: Path, out: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "phonotaxis", "sweep", file, "--out", out, *words]
    return subprocess.Popen(
        list(map(str, command)),
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_runs(out: Path, count: int) -> None:
    journal = out / "runs.jsonl"
    for _ in range(1200):
        if journal.exists() and journal.read_bytes().count(b"\n") >= count:
            return
        time.sleep(0.05)
    pytest.fail(f"no {count} runs in a minute")


def running_in(process: int) -> list[Path]:
    """Processes that a process has started."""
    alive = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
        except (FileNotFoundError, ProcessLookupError):
            continue
        if parent == process:
            alive.append(stat.parent)
    return alive


@pytest.mark.slow
@pytest.mark.parametrize(
    "after",
    [17, *(pytest.param(runs, marks=pytest.mark.long) for runs in (1, 66))],
)
def test_killed_sweep_goes_on_where_it_was(capsys, tmp_path, after):
    file, out = (
        write(tmp_path / "sweep.yaml", COMPILED + "runs: 60\n"),
        tmp_path / "out",
    )
    process = begin(file, out, "--workers", "2")
    wait_for_runs(out, after)
    workers = running_in(process.pid)
    process.kill()
    process.communicate()
    kept = len(load_results(out))
    assert after <= kept < 120
    words = ["sweep", str(file), "--out", str(out), "--workers", "2", "--resume"]
    assert call(capsys, *words)[0] == 0
    assert not [worker for worker in workers if worker.exists()]
    plan, found = load_sweep(file), load_results(out)
    undisturbed = results_table(
        run_task(Task(point, plan.scenario_of(point), "compiled", trajectory=False)).row
        for point in plan.points()
    )
    assert len(found) == 120
    pd.testing.assert_frame_equal(
        found.drop(columns="wall_s"), undisturbed.drop(columns="wall_s")
    )


@pytest.mark.slow
def test_interrupt_keeps_what_is_done(tmp_path):
    file, out = (
        write(tmp_path / "sweep.yaml", COMPILED + "runs: 500\n"),
        tmp_path / "out",
    )
    process = begin(file, out, "--workers", "1")
    wait_for_runs(out, 3)
    workers = running_in(process.pid)
    assert workers
    process.send_signal(signal.SIGINT)
    _, complaint = process.communicate(timeout=30)
    assert process.returncode == 1
    # The first line may be that the loop is compiled first.
    *_, complaint = complaint.splitlines()
    kept = len(pd.read_parquet(out / "runs.parquet"))
    assert kept >= 3
    assert f"interrupted; {kept} of 1000 runs are kept" in complaint
    assert shlex.join(["--out", str(out), "--resume"]) in complaint
    assert not [worker for worker in workers if worker.exists()]
