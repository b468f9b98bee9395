"""Natural guesses at the prompt: they work, or the message has the line to type."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import phonotaxis
from diagrams import load_scenario

SHORT = ("--set", "duration_s=0.05", "--set", "hearing=ideal", "--no-plots")


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("plot", "phonotaxis results"),
        ("view", "phonotaxis results"),
        ("open", "phonotaxis results"),
        ("replay", "phonotaxis results"),
        ("report", "phonotaxis results"),
        ("movie", "phonotaxis simulate --movie FILE.mp4"),
        ("init", "phonotaxis scenarios default --copy my_scenario.yaml"),
        ("new", "phonotaxis scenarios default --copy my_scenario.yaml"),
        ("validate", "phonotaxis scenarios"),
        ("check", "phonotaxis scenarios"),
        ("docs", "phonotaxis COMMAND --help"),
        ("config", "phonotaxis fields"),
        ("linearize", "phonotaxis stability"),
        ("record", "phonotaxis listen"),
        ("simulat", "'simulate'"),
        ("swep", "'sweep'"),
        ("simulate --duration 20", "--set duration_s=20"),
        ("simulate --duration_s 20", "--set duration_s=20"),
        ("simulate --duration=20", "--set duration_s=20"),
        ("simulate --hearing ideal", "--set hearing=ideal"),
        ("simulate --speed 0.5", "--set source.speed_m_s=0.5"),
        ("simulate --tick-s 0.05", "--set tick_s=0.05"),
        ("simulate --name mine", "--set name=mine"),
        ("simulate --follow-distance 1", "--set attraction.follow_distance_m=1"),
        ("simulate --noise 0", "phonotaxis fields noise"),
        ("simulate --obstacles 3", "phonotaxis fields obstacles"),
        ("simulate --room", "phonotaxis fields room"),
        ("simulate --scenario u_trap", "phonotaxis simulate u_trap"),
        ("simulate --gui", "replay.html"),
        ("simulate --realtime", "replay.html"),
        ("simulate --plot", "--no-plots"),
        ("simulate --verbose", "--debug"),
        ("simulate -v", "--debug"),
        ("simulate --no-audio", "--save-audio"),
        ("simulate --output x", "--out"),
        ("simulate --wav x.wav", "--sound"),
        ("simulate --runs 10", "compare"),
        ("simulate source.speed_m_s=0.5", "--set source.speed_m_s=0.5"),
        ("simulate --set speed=0.5", "source.speed_m_s"),
        ("simulate --set source.speed=0.5", "speed_m_s"),
        ("simulate --set robot.width=0.5", "width_m"),
        ("simulate --set obstacles.cart.speed_m_s=1", "use 'box'"),
        ("compare --laws active dwa", "--law a,b"),
        ("design --law active,dwa", "one law at a time"),
        ("locate a.wav --array x", "--geometry"),
        ("listen --list-devices", "phonotaxis doctor"),
        ("laws activ", "'active'"),
        ("scenarios corider", "'corridor'"),
        ("scenarios --copy mine.yaml", "phonotaxis scenarios default --copy mine.yaml"),
    ],
)
def test_a_wrong_guess_is_answered_by_the_line_to_type(
    capsys, tmp_path, monkeypatch, words, line
):
    monkeypatch.chdir(tmp_path)
    status, out, complaint = call(capsys, *words.split())
    assert (status, out) == (2, "")
    assert complaint.count("\n") == 1
    assert line in complaint
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "printed"),
    [
        ("list", "two_moving_obstacles"),
        ("show corridor", "1.6 m wide"),
        ("scenarios corridor", "waypoints_m"),
        ("laws active", "laws.active.reach_m"),
        ("results", "phonotaxis simulate"),
    ],
)
def test_a_guess_that_works(capsys, tmp_path, monkeypatch, words, printed):
    monkeypatch.chdir(tmp_path)
    status, out, _ = call(capsys, *words.split())
    assert status == 0
    assert printed in out


@pytest.mark.parametrize(
    ("words", "end"),
    [("help", "COMMAND"), ("help sweep", "SWEEP.yaml"), ("version", ".")],
)
def test_help_and_version_are_words_too(capsys, words, end):
    with pytest.raises(SystemExit) as left:
        phonotaxis.main(words.split())
    assert left.value.code == 0
    assert end in capsys.readouterr().out


def test_a_copied_scenario_is_the_scenario(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call(capsys, "scenarios", "u_trap", "--copy", "mine.yaml")[0] == 0
    assert load_scenario("mine.yaml").with_(name="u_trap") == load_scenario("u_trap")
    status, _, complaint = call(capsys, "scenarios", "u_trap", "--copy", "mine.yaml")
    assert status == 2
    assert "copy: mine.yaml cannot be written" in complaint


def test_a_result_runs_again_and_is_listed(capsys, tmp_path, monkeypatch):
    """``results/latest`` is the last result; its scenario gives the same run."""
    monkeypatch.chdir(tmp_path)
    assert call(capsys, "run", *SHORT, "--seed", "7")[0] == 0
    assert call(capsys, "simulate", "results/latest", "--no-plots")[0] == 0
    documents = [
        json.loads(Path(f"results/{name}/summary.json").read_text("utf-8"))
        for name in ("0001", "0002")
    ]
    assert documents[1]["seed"] == 7
    assert documents[0]["metrics"] == documents[1]["metrics"]
    assert Path("results/latest").readlink() == Path("0002")
    listed = json.loads(call(capsys, "results", "--json")[1])["results"]
    assert [each["out"] for each in listed] == ["results/0001", "results/0002"]
    assert all("default" in each["title"] for each in listed)


def test_laws_are_named_in_any_way():
    from diagrams.scenario.suggestions import law_names

    assert law_names("a,b") == law_names(["a", "b"]) == law_names(["a,b", "a"])
    assert law_names(()) == []
