"""Natural guesses at the prompt: they work, or the message has the line to type."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

import phonotaxis
from diagrams import load_scenario
from diagrams.scenario.warnings.warnings_of import warnings_of
from systems.framework.input_error import InputError
from tests import guesses

SHORT = ("--set", "duration_s=0.05", "--set", "hearing=ideal", "--no-plots")


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    printed = capsys.readouterr()
    return status, printed.out, printed.err


WORDS = guesses.NOTED_WORDS | guesses.OWN_WORDS
FILES = guesses.NOTED_FILES | guesses.OWN_FILES


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder with the files that the guesses name."""
    monkeypatch.chdir(tmp_path)
    sound = 0.1 * np.random.default_rng(1).standard_normal((4_000, 4))
    soundfile.write("four.wav", sound, 48_000)
    Path("used").mkdir()
    for name, text in {
        "text.txt": "no sound",
        "own.yaml": "duration_s: 1",
        "sweep.yaml": "runs: 1",
        "used/scenario.yaml": "duration_s: 1",
        "few.yaml": "microphones: [[0, 0], [0, 0]]",
        "centimeters.yaml": "microphones: [[0, 0], [0, 4000], [4000, 0]]",
    }.items():
        Path(name).write_text(text, "utf-8")
    return tmp_path


@pytest.mark.parametrize("words", WORDS)
def test_a_guess_at_the_prompt(capsys, folder, words):
    """It works, or one line has what to type, and nothing is written."""
    before = {path.name for path in folder.iterdir()}
    status: int | str | None
    try:
        status = phonotaxis.main(words.split())
    except SystemExit as left:
        status = left.code
    printed = capsys.readouterr()
    if status != 0:
        assert (status, printed.out) == (2, "")
        assert printed.err.count("\n") == 1
        assert {path.name for path in folder.iterdir()} == before
    assert (WORDS[words] or "") in printed.err + printed.out


@pytest.mark.parametrize("text", FILES)
def test_a_guess_in_a_file(folder, text):
    Path("guess.yaml").write_text(text, "utf-8")
    try:
        answer = str(*warnings_of(load_scenario("guess.yaml")))
    except InputError as error:
        answer = str(error)
    assert (FILES[text] or "") in answer
    assert answer


def test_nine_of_ten_guesses_help():
    """Of those of the note, of our own, and of each kind; there are over 125."""
    noted = [guesses.NOTED_WORDS, guesses.NOTED_FILES, guesses.NOTED_PYTHON]
    own = [guesses.OWN_WORDS, guesses.OWN_FILES, guesses.OWN_PYTHON]
    for tables in (noted, own, *zip(noted, own, strict=True)):
        answers = [answer for table in tables for answer in table.values()]
        assert sum(answer is not None for answer in answers) >= 0.9 * len(answers)
    every = [answer for table in noted + own for answer in table.values()]
    assert sum(answer is not None for answer in every) >= 0.95 * len(every)
    assert sum(map(len, noted)) >= 85
    assert sum(map(len, own)) >= 40


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
