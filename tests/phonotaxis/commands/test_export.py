"""``phonotaxis export``, ``--mcap`` and ``--csv``, and ``phonotaxis columns``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

import phonotaxis
from analysis.runs.columns import COLUMNS

SHORT = ["--set", "hearing=ideal", "--set", "duration_s=0.3"]


def call(capsys, *words: object) -> tuple[int, str, str]:
    status = phonotaxis.main([str(word) for word in words])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of two robots, with both files."""
    out = tmp_path_factory.mktemp("runs") / "run"
    words = ["simulate", "two_followers", *SHORT, "--mcap", "--csv"]
    assert phonotaxis.main([*words, "--out", str(out)]) == 0
    return out


def test_export_writes_what_the_run_would_have(capsys, result, tmp_path):
    again = tmp_path / "again"
    status, out, _ = call(capsys, "export", result, "--mcap", "--csv", "--out", again)
    assert status == 0
    assert out.splitlines() == [str(again / "run.mcap"), str(again / "trajectory.csv")]
    for name in ("run.mcap", "trajectory.csv"):
        assert (again / name).read_bytes() == (result / name).read_bytes()


def test_export_puts_files_beside_the_run(capsys, result, tmp_path):
    (result / "trajectory.csv").rename(tmp_path / "first.csv")
    status, out, _ = call(capsys, "export", result, "--csv", "--json")
    assert status == 0
    assert json.loads(out)["files"] == [str(result / "trajectory.csv")]
    written = (result / "trajectory.csv").read_bytes()
    assert written == (tmp_path / "first.csv").read_bytes()
    assert not list(result.glob(".export*"))


@pytest.mark.parametrize(
    ("words", "field", "hint"),
    [
        ([], "export", "give --mcap, --csv or both"),
        (["--csv"], "out", "remove it, or give --out"),
        (["--csv", "--out", "{result}"], "out", "not empty"),
    ],
)
def test_export_refuses(capsys, result, words, field, hint):
    words = [word.format(result=result) for word in words]
    status, out, complaint = call(capsys, "export", result, *words)
    assert (status, out) == (2, "")
    assert complaint.startswith(f"phonotaxis: {field}: ")
    assert hint in complaint


@pytest.mark.parametrize("name", ["nowhere", "x" * 10_000, "\udcff", ""])
def test_a_directory_that_is_none_is_refused(capsys, name):
    status, _, complaint = call(capsys, "export", name, "--csv")
    assert status == 2
    assert "has no scenario.yaml" in complaint
    assert len(complaint.splitlines()) == 1


@pytest.mark.parametrize("missing", ["scenario.yaml", "trajectory.parquet"])
def test_what_is_no_run_is_refused(capsys, result, tmp_path, missing):
    for name in {"scenario.yaml", "trajectory.parquet"} - {missing}:
        (tmp_path / name).write_bytes((result / name).read_bytes())
    status, _, complaint = call(capsys, "export", tmp_path, "--csv")
    assert status == 2
    assert f"has no {missing}" in complaint


def test_a_table_of_another_scenario_is_refused(capsys, result, tmp_path):
    for name in ("scenario.yaml", "trajectory.parquet"):
        (tmp_path / name).write_bytes((result / name).read_bytes())
    text = "{name: alone}\n"
    (tmp_path / "scenario.yaml").write_text(text)
    status, _, complaint = call(capsys, "export", tmp_path, "--mcap")
    assert status == 2
    assert "has no p_WB_x of robot" in complaint
    (tmp_path / "trajectory.parquet").write_bytes(b"PAR1")
    status, _, complaint = call(capsys, "export", tmp_path, "--mcap")
    assert status == 2
    assert "cannot be read" in complaint
    assert not (tmp_path / "run.mcap").exists()


@pytest.mark.parametrize("package", ["mcap", "mcap_ros2"])
def test_without_its_packages_nothing_runs(capsys, tmp_path, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    out = tmp_path / "out"
    status, printed, complaint = call(capsys, "simulate", "--mcap", "--out", out)
    assert (status, printed) == (2, "")
    assert "mcap: needs the packages" in complaint
    assert "pip install 'phonotaxis[export]'" in complaint
    assert not out.exists()
    assert call(capsys, "export", tmp_path, "--mcap")[0] == 2


def test_columns_lists_names_units_and_meanings(capsys):
    status, out, _ = call(capsys, "columns")
    assert status == 0
    assert len(out.splitlines()) == len(COLUMNS)
    status, out, _ = call(capsys, "columns", "guard_d", "--json")
    assert [each["unit"] for each in json.loads(out)["columns"]] == ["m"]
    status, _, complaint = call(capsys, "columns", "speeed")
    assert status == 2
    assert "no column has 'speeed' in its name" in complaint
