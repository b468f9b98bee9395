"""``simulate --movie``, as a user meets it."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
from pathlib import Path

import imageio_ffmpeg
import pytest

import phonotaxis


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def _facts(film: Path) -> str:
    """What ffmpeg tells of a file."""
    words = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(film)]
    return subprocess.run(words, capture_output=True, text=True, check=False).stderr


@pytest.mark.parametrize("hearing", ["audio", "ideal"])
def test_a_film_of_a_run_has_sound_where_something_is_heard(tmp_path, capsys, hearing):
    film, out = tmp_path / "film.mp4", tmp_path / "out"
    words = ["--set", "duration_s=1", "--set", f"hearing={hearing}", "--json"]
    words += ["--movie", str(film), "--out", str(out)]
    status, printed, _ = call(capsys, "simulate", *words)
    assert status == 0
    assert json.loads(printed)["movie"] == str(film)
    facts = _facts(film)
    assert "Duration: 00:00:01.0" in facts
    assert "Video: h264" in facts
    assert ("Audio: aac" in facts) == (hearing == "audio")
    assert {p.name for p in tmp_path.iterdir()} == {"film.mp4", "out"}
    assert not (out / "heard").exists()


def test_the_sound_that_is_saved_is_that_of_the_film(tmp_path, capsys):
    film, ears = tmp_path / "film.mp4", tmp_path / "ears"
    words = ("--set", "duration_s=1", "--save-audio", str(ears), "--movie", str(film))
    status, printed, _ = call(
        capsys, "simulate", *words, "--out", str(tmp_path / "out")
    )
    assert status == 0
    assert str(film) in printed
    assert "Audio: aac" in _facts(film)
    assert (ears / "heard.wav").is_file()


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("film.avi", "neither .gif nor .mp4"),
        ("there.gif", "already exists"),
        ("nowhere/film.gif", "not a directory that can be written"),
        ("out/film.gif", "is in the directory of the results"),
        (f"{'x' * 300}.gif", "not a usable path (File name too long)"),
    ],
)
def test_bad_names_are_refused_before_the_run(tmp_path, capsys, name, complaint):
    (tmp_path / "there.gif").touch()
    words = ("--movie", str(tmp_path / name), "--out", str(tmp_path / "out"))
    status, printed, said = call(capsys, "simulate", "--set", "duration_s=3000", *words)
    assert (status, printed) == (2, "")
    assert len(said.splitlines()) == 1
    assert complaint in said
    assert {p.name for p in tmp_path.iterdir()} == {"there.gif"}


def test_without_an_encoder_it_says_what_to_install(tmp_path, capsys, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name, *rest: None if name == "imageio_ffmpeg" else find(name, *rest),
    )
    monkeypatch.setattr(shutil, "which", lambda name: None)
    words = ("--movie", str(tmp_path / "film.mp4"), "--out", str(tmp_path / "out"))
    status, printed, said = call(capsys, "simulate", "--set", "duration_s=3000", *words)
    assert (status, printed) == (2, "")
    assert "pip install 'phonotaxis[movie]'" in said
    assert len(said.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
