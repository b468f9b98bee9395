"""``phonotaxis falsify``, as a user meets it."""

from __future__ import annotations

import json
import math
from functools import partial

import pytest

import phonotaxis
from analysis.safety import falsification, job_pool, long_runs
from analysis.safety.driver_trials import draw_trial, run_trial
from analysis.safety.falsification import Found, by_chance, largest_rate
from analysis.safety.long_runs import LongRun
from analysis.safety.swinging_drivers import Swing


@pytest.mark.slow
def test_runs_by_chance_are_those_that_can_be_repeated(capsys):
    words = ["falsify", "--runs", "3", "--seed", "7", "--json"]
    assert phonotaxis.main(words) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["runs"], document["collisions"], document["seed"]) == (3, 0, 7)
    nearest = document["nearest"]
    outcome = run_trial(draw_trial(7, nearest["number"]))
    assert outcome.clearance_m == pytest.approx(nearest["clearance_m"], abs=1e-9)
    assert (
        phonotaxis.main(
            ["falsify", "--seed", "7", "--only", str(nearest["number"]), "--json"]
        )
        == 0
    )
    again = json.loads(capsys.readouterr().out)
    assert [again[kind] for kind in ("layout", "driver", "setting")] == nearest["kinds"]
    assert again["clearance_m"] == pytest.approx(nearest["clearance_m"], abs=1e-9)


def test_a_collision_is_told_and_makes_status_1(capsys, monkeypatch):
    hit = Found(4, ("posts", "random", "plain"), True, -0.01)
    monkeypatch.setattr(falsification, "falsify", lambda *_, **__: [hit])
    assert phonotaxis.main(["falsify", "--runs", "1"]) == 1
    printed = capsys.readouterr()
    assert "collision: run 4" in printed.out
    assert "collided in 1 of 1 runs" in printed.err


def test_a_contact_of_a_long_run_names_its_job(capsys, monkeypatch):
    run = LongRun("swing", "plain", 60.0, 60.0, -0.001, 0.003, None)
    monkeypatch.setattr(job_pool, "run_jobs", lambda *_, **__: iter([[run]]))
    assert phonotaxis.main(["falsify", "--long", "--only", "5"]) == 1
    printed = capsys.readouterr()
    assert "contact in job 5: LongRun(driver='swing'" in printed.out
    assert "job 5 is done" in printed.err
    assert "touched an obstacle in 1 runs" in printed.err


def test_a_journal_keeps_jobs_and_skips_them(capsys, monkeypatch, tmp_path):
    """The second time only the job that is missing runs."""
    ran = []

    def job(number):
        ran.append(number)
        swing = Swing(0.7, 3.5, 3.0, 0.1) if number else None
        return [LongRun("swing", "plain", 60.0, math.inf, 0.03, 0.001, swing)]

    monkeypatch.setattr(long_runs, "jobs", lambda _: [partial(job, n) for n in (0, 1)])
    monkeypatch.setattr(
        job_pool, "run_jobs", lambda todo, *_, **__: (j() for j in todo)
    )
    words = ["falsify", "--long", "--journal", str(tmp_path / "long.jsonl"), "--json"]
    assert phonotaxis.main([*words, "--only", "1"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert phonotaxis.main(words) == 0
    second = json.loads(capsys.readouterr().out)
    assert ran == [1, 0]
    assert [run["job"] for run in second["runs"]] == [0, 1]
    assert second["runs"][1] == first["runs"][0]
    assert phonotaxis.main([*words, "--seed", "2", "--only", "1"]) == 0
    assert ran == [1, 0, 1]


def test_a_file_that_is_no_journal_is_refused(capsys, tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("hello\n")
    assert phonotaxis.main(["falsify", "--long", "--journal", str(path)]) == 2
    assert "line 1" in capsys.readouterr().err
    words = ["falsify", "--long", "--journal", str(tmp_path / "none" / "a.jsonl")]
    assert phonotaxis.main(words) == 2
    assert "does not exist" in capsys.readouterr().err


def test_rate_that_never_happened_is_bounded_by_three_in_so_many():
    assert largest_rate(0, 3000) == pytest.approx(1e-3, rel=2e-3)


def test_drivers_can_be_chosen():
    found = by_chance(1, range(2), ["looking"])
    assert [each.kinds[1] for each in found] == ["looking", "looking"]


@pytest.mark.parametrize(
    ("words", "field", "hint"),
    [
        (["--drivers", "radnom"], "drivers", "random"),
        (["--runs", "0"], "runs", "at least"),
        (["--search", "-1"], "search", "negative"),
        (["--workers", "0"], "workers", "between 1"),
        (["--long", "--only", "1000"], "only", "below"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, words, field, hint):
    assert phonotaxis.main(["falsify", *words]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert len(printed.err.splitlines()) == 1
    assert f"phonotaxis: {field}" in printed.err
    assert hint in printed.err
