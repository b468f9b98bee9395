"""`phonotaxis compare`, as a user meets it."""

from __future__ import annotations

import json

import pytest

import phonotaxis

SHORT = ("--runs", "1", "--workers", "1", "--set", "hearing=ideal")


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.mark.usefixtures("no_workers")
@pytest.mark.slow
def test_compare_prints_one_document(capsys, tmp_path):
    out = tmp_path / "out"
    words = ["compare", "default", *SHORT, "--set", "duration_s=1"]
    words += ["--laws", "none,active", "--json", "--out", str(out)]
    status, printed, complaint = call(capsys, *words)
    assert (status, complaint) == (0, "")
    document = json.loads(printed)
    assert [(c["fields"]["law"], c["runs"]) for c in document["cells"]] == [
        ("none", 1),
        ("active", 1),
    ]
    metrics = document["cells"][0]["metrics"]["minimum_clearance_m"]
    assert metrics["low"] <= metrics["value"] <= metrics["high"]
    assert [(p["first"], p["second"]) for p in document["pairs"]] == [
        ("none", "active")
    ]

    status, _, complaint = call(capsys, *words[:-3], "--out", str(out))
    assert status == 2
    assert "out: " in complaint
    status, printed, _ = call(capsys, *words, "--resume")
    assert status == 0
    assert json.loads(printed)["cells"] == document["cells"]


@pytest.mark.parametrize(
    ("words", "field", "hint"),
    [
        (["no_such"], "scenario", "phonotaxis scenarios"),
        (["--laws", "magic"], "law", "conventional"),
        (["--velocity-term", "half"], "collision_vector.velocity_term", "closing"),
        (["--set", "sourc.speed_m_s=1"], "sourc", "did you mean 'source'"),
        (["--runs", "0"], "runs", "1"),
        (["--runs", "many"], "command line", "--help"),
        (["--workers", "0"], "workers", "between 1 and 256"),
        (["--seed", "-1"], "seed", "whole number"),
        (["--grid", "hearing=audio"], "hearing", "list"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, tmp_path, words, field, hint):
    out = tmp_path / "out"
    words = ["compare", *words, "--out", str(out)]
    status, printed, complaint = call(capsys, *words)
    assert (status, printed) == (2, "")
    assert len(complaint.splitlines()) == 1
    assert f"phonotaxis: {field}" in complaint
    assert hint in complaint
    assert not out.exists()
