"""A directory of results belongs to one command, and appears whole."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from analysis.report.result_directory import take_directory, whole_directory
from systems.framework.input_error import InputError

WRITE = """
import sys, time
from analysis.report.result_directory import whole_directory
with whole_directory(None) as (out, directory):
    (directory / "who").write_text(sys.argv[1])
    time.sleep(0.5)
print(out)
"""


def test_concurrent_commands_never_share_a_number(tmp_path):
    def write(name: str) -> str:
        root = str(Path(__file__).resolve().parents[3])
        return subprocess.run(
            [sys.executable, "-c", WRITE, name],
            cwd=tmp_path,
            env={"PYTHONPATH": root},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()

    with ThreadPoolExecutor(4) as pool:
        places = list(pool.map(write, "abcd"))
    assert sorted(places) == [f"results/000{k}" for k in range(1, 5)]
    for place, name in zip(places, "abcd", strict=True):
        assert (tmp_path / place / "who").read_text() == name


def test_one_directory_is_taken_once(tmp_path):
    with whole_directory(tmp_path / "out") as (out, directory):
        (directory / "a").write_text("first")
        with pytest.raises(InputError, match="another process writes"):
            take_directory(tmp_path / "out")
    assert (out / "a").read_text() == "first"
    with pytest.raises(InputError, match="is not empty"):
        take_directory(out)


def test_what_fails_leaves_nothing(tmp_path):
    def fail() -> None:
        with whole_directory(tmp_path / "new" / "out") as (_, directory):
            (directory / "a").write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_an_empty_directory_and_a_link_to_one_are_filled(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to("empty")
    with whole_directory(tmp_path / "link") as (out, directory):
        (directory / "a").write_text("b")
    assert out == tmp_path / "link"
    assert (tmp_path / "empty" / "a").read_text() == "b"


@pytest.mark.parametrize(
    ("out", "message"),
    [
        (".", "cannot be replaced"),
        ("", "cannot be replaced"),
        ("\udcff", "not UTF-8"),
        ("a\0b", "not a usable path"),
        ("~nobody-of-that-name/x", "not a usable path"),
        ("loop/x", "not a usable path|cannot be made"),
        ("a" * 300, "not a usable path|cannot be made"),
        ("/proc/x", "cannot be"),
        ("/dev/null/x", "is a file|not a usable path"),
        ("full", "not empty"),
        ("full/file", "is a file"),
    ],
)
def test_bad_names_are_found_before_the_run(tmp_path, monkeypatch, out, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    with pytest.raises(InputError, match=message) as error:
        take_directory(out)
    assert error.value.field == "out"
    assert {path.name for path in tmp_path.iterdir()} == {"loop", "full"}


def test_a_tilde_is_the_home_directory(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    with whole_directory("~/out") as (out, _):
        pass
    assert out == tmp_path / "out"
    assert out.is_dir()
