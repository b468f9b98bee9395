"""``phonotaxis accuracy``, as a user meets it."""

from __future__ import annotations

import json

import pytest

import phonotaxis
from diagrams import load_scenario


def test_json_and_files(capsys, tmp_path):
    out = tmp_path / "out"
    words = ["accuracy", "--trials", "2", "--tolerances", "--json", "--out"]
    assert phonotaxis.main([*words, str(out)]) == 0
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    assert printed.err == ""
    assert {(c["range_m"], c["bearing_deg"]) for c in document["cells"]} == {
        (r, b) for r in (1.0, 2.0, 3.0, 4.0) for b in (0.0, 30.0, 60.0)
    }
    assert {c["estimator"] for c in document["cells"]} == {"paper", "fast", "ml"}
    assert document["tolerances"]["position_m"] == 2e-4
    assert json.loads((out / "summary.json").read_text()) == document
    assert load_scenario(out / "scenario.yaml").name == "localization"
    assert {path.name for path in out.iterdir()} == {
        "scenario.yaml", "scenario.schema.json", "summary.json", "localization.png"
    }  # fmt: skip


def test_tables_on_the_terminal(capsys, tmp_path):
    out = tmp_path / "out"
    words = ["accuracy", "--trials", "2", "--seed", "5", "--out", str(out)]
    assert phonotaxis.main(words) == 0
    text = capsys.readouterr().out
    assert text.count("  4 m    60 deg") == 4
    assert str(out) in text
    assert json.loads((out / "summary.json").read_text())["seed"] == 5


@pytest.mark.parametrize(
    ("words", "field", "hint"),
    [
        (["--trials", "1"], "trials", "between 2"),
        (["--trials", "many"], "command line", "--trials"),
        (["--seed", "-3"], "seed", "give 0 or more"),
        (["--out", "/dev/null/out"], "out", "name another"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, words, field, hint):
    assert phonotaxis.main(["accuracy", *words]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert len(printed.err.splitlines()) == 1
    assert f"phonotaxis: {field}" in printed.err
    assert hint in printed.err


def test_its_old_name_is_a_synonym(capsys):
    assert phonotaxis.main(["localization", "--trials", "0"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "phonotaxis: localization means the command accuracy"
    assert "trials" in said[1]
