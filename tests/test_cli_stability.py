"""``phonotaxis stability``, as a user meets it."""

from __future__ import annotations

import json

import pytest

import phonotaxis
from analysis.report.criterion import Criterion
from analysis.report.section import Figure
from analysis.stability import report_parts
from analysis.stability.law_analysis import Part
from diagrams import load_scenario
from systems.framework.input_error import InputError


def impossible(study):
    raise InputError("law", "has no such thing; choose another one")


MASS = Part[float](
    "mass",
    "Mass",
    lambda study: study.scenario.only.robot.mass_kg,
    lambda data: [f"{data} kg"],
    criteria=(
        Criterion(
            "mass", "kg", "at most", 4.0, "light", "heavy", "a test", lambda data: data
        ),
    ),
)
IMPOSSIBLE = Part("impossible", "Impossible", impossible, lambda data: [])


@pytest.fixture
def quick(monkeypatch):
    """Stand-ins for analyses that take their time."""
    monkeypatch.setattr(report_parts, "SOUND_PARTS", (MASS, IMPOSSIBLE))


def run(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(["stability", *words])
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_a_part_that_fails_is_no_success(capsys, tmp_path, monkeypatch):
    """The rest is written, the page says what failed, and so does the status."""

    def broken(study):
        return study.found["nothing"]

    def draw():
        raise ZeroDivisionError("no figure")

    parts = (
        MASS,
        IMPOSSIBLE,
        Part("broken", "Broken", broken, lambda data: []),
        Part("unshown", "Unshown", lambda study: [1], lambda data: [Figure(draw, "")]),
        Part("after", "After", lambda study: [1, 2], lambda data: ["last"]),
    )
    monkeypatch.setattr(report_parts, "parts_for", lambda _: parts)
    out = tmp_path / "out"
    status, printed, complaint = run(capsys, "--out", str(out))
    assert status == 1
    assert "mass" in printed.lower()
    assert complaint.count("\n") == 1
    assert "broken, unshown" in complaint
    page = (out / "report.html").read_text("utf-8")
    assert "This part failed: KeyError" in page
    assert "This part failed: ZeroDivisionError" in page
    assert "<p>last</p>" in page
    document = json.loads((out / "summary.json").read_text())
    assert document["broken"]["failed"]
    assert "failed" not in document["impossible"]
    again = ["--debug", "--out", str(tmp_path / "again")]
    status, _, complaint = run(capsys, *again)
    assert status == 1
    assert "Traceback" in complaint
    assert "KeyError" in complaint


def test_one_law_json_and_files(quick, capsys, tmp_path):
    out = tmp_path / "out"
    words = ["--json", "--full", "--law", "conventional", "--seed", "4"]
    status, printed, complaint = run(capsys, *words, "--out", str(out))
    assert (status, complaint) == (0, "")
    document = json.loads(printed)
    assert json.loads((out / "summary.json").read_text()) == document
    assert document["law"] == "conventional"
    assert document["seed"] == 4
    assert document["verdicts"][0]["verdict"] == "pass"
    assert document["impossible"]["problem"].startswith("law: has no such thing")
    page = (out / "report.html").read_text()
    assert "Not computed: law: has no such thing" in page
    assert load_scenario(out / "scenario.yaml").seed == 4


def test_several_laws_stand_side_by_side(quick, capsys, tmp_path):
    out = tmp_path / "out"
    status, printed, _ = run(capsys, "--law", "all", "--json", "--out", str(out))
    assert status == 0
    document = json.loads(printed)
    laws = ["conventional", "active", "conventional2017", "active2017"]
    assert [each["law"] for each in document["laws"]] == laws
    assert list(document["comparison"][0]["verdicts"]) == laws


def test_table_on_the_terminal(quick, capsys, tmp_path):
    out = tmp_path / "out"
    words = ["--law", "active", "--law", "none", "--set", "robot.mass_kg=5"]
    status, printed, complaint = run(capsys, *words, "--out", str(out))
    assert (status, complaint) == (0, "")
    (row,) = [line for line in printed.splitlines() if line.startswith("mass")]
    assert row.split() == ["mass", "\u2264", "4", "kg", "5", "fail", "5", "fail"]
    assert str(out / "report.html") in printed


@pytest.mark.parametrize(
    ("words", "field", "hint"),
    [
        (["--law", "magic"], "law", "active2017"),
        (["no_such"], "scenario", "phonotaxis scenarios"),
        (["--set", "plant.motor_lag_s=0.001"], "plant.motor_lag_s", "step_s"),
        (
            ["--set", "attraction.damping_n_s_m=0"],
            "attraction",
            "raise attraction.damp",
        ),
        (["--velocity-term", "half"], "collision_vector.velocity_term", "closing"),
        (["--out", "/dev/null/out"], "out", "name another"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, tmp_path, words, field, hint):
    words = [*words] if "--out" in words else [*words, "--out", str(tmp_path / "out")]
    status, printed, complaint = run(capsys, *words)
    assert (status, printed) == (2, "")
    assert len(complaint.splitlines()) == 1
    assert f"phonotaxis: {field}" in complaint
    assert hint in complaint
    status, printed, complaint = run(capsys, *words, "--json")
    assert (status, complaint) == (2, "")
    assert json.loads(printed)["error"]["field"].startswith(field)
    assert not (tmp_path / "out").exists()


def test_of_several_robots_one_is_analyzed_alone(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(report_parts, "parts_for", lambda _: (MASS,))
    documents = []
    for k, chosen in enumerate(([], ["--robot", "second"])):
        out = tmp_path / str(k)
        words = ["robots_2", *chosen, "--json", "--out", str(out)]
        status, printed, complaint = run(capsys, *words)
        assert status == 0
        assert complaint.count("\n") == 1
        assert f"the report covers robot {['first', 'second'][k]!r} alone" in complaint
        documents.append(json.loads(printed))
        again = load_scenario(out / "scenario.yaml")
        assert [*again.robots] == [["first", "second"][k]]
        assert again.only.start.position_m == [(-3.0, 0.0), (0.0, -3.0)][k]
    assert documents[0]["law"] == "trajectory_filtered"
    status, _, complaint = run(capsys, "robots_2", "--robot", "nobody")
    assert status == 2
    said = "'nobody' is not a robot of the scenario; use first, second"
    assert complaint == f"phonotaxis: robot: {said}\n"


def test_drake_ending_the_analysis_is_one_line(capsys, tmp_path, monkeypatch):
    def demand(study):
        raise SystemExit(1)

    parts = (Part("bad", "Bad", demand, lambda data: []),)
    monkeypatch.setattr(report_parts, "SOUND_PARTS", parts)
    status, printed, complaint = run(capsys, "--out", str(tmp_path / "out"))
    assert (status, printed) == (1, "")
    assert "the command was ended from within" in complaint
    assert not (tmp_path / "out").exists()


def test_what_a_guard_promises_is_in_the_report(quick, capsys, tmp_path):
    words = ["two_static_obstacles", "--law", "active", "--json", "--out"]
    documents = {}
    for guard in ("on", "off"):
        out = tmp_path / guard
        status, printed, _ = run(capsys, *words, str(out), "--guard", guard)
        assert status == 0
        documents[guard] = json.loads(printed)
        page = (out / "report.html").read_text("utf-8")
        assert ("Safety of the guard" in page) == (guard == "on")
    assert documents["on"]["safety"]["promise"].startswith("static safety")
    assert "safety" not in documents["off"]
