"""Compiled code has a folder, and is that of the present sources."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import systems
from systems.framework.compiling import OVERLOADS, provide_cache, source_digest

ROOT = Path(systems.__file__).resolve().parents[1]


@pytest.fixture(autouse=True)
def no_cache_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setattr("numba.config.CACHE_DIR", "")


def test_a_folder_that_can_be_made_is_used(tmp_path):
    assert provide_cache(tmp_path / "deep" / "cache") is None
    assert not os.environ["NUMBA_CACHE_DIR"]


def test_a_process_without_such_a_folder_gets_one(tmp_path):
    """Below a device nothing can be made even by root."""
    made = provide_cache(Path("/dev/null/none"))
    assert made is not None
    assert made.is_dir()
    assert os.environ["NUMBA_CACHE_DIR"] == str(made)
    told = vars(numba.config)["CACHE_DIR"]
    assert told == str(made), "numba was loaded before"


def test_a_folder_that_the_user_chose_stays(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert provide_cache(Path("/dev/null/none")) is None
    assert os.environ["NUMBA_CACHE_DIR"] == str(tmp_path)


#: Half a tick after a knot: a compiled function of one file that calls one of another.
SCRIPT = """
import numpy as np
from systems.base.carrier import poses_between
knots = np.zeros((2, 8))
knots[1, 0] = 1.0
print(poses_between(knots, np.array([0.5]))[0, 0], len(poses_between.stats.cache_hits))
"""
CALLED = Path("systems", "base", "source_drive.py")


def clone(folder: Path) -> Path:
    for package in ("systems", "diagrams"):
        shutil.copytree(
            ROOT / package,
            folder / package,
            ignore=shutil.ignore_patterns("__pycache__"),
        )
    return folder


def run(clone: Path, **caches: str) -> list[float]:
    """The value, and how often code was found."""
    told = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        cwd=clone,
        env={**os.environ, "PYTHONPATH": str(clone), **caches},
        capture_output=True,
        text=True,
        check=True,
    )
    return [*map(float, told.stdout.split())]


def test_a_process_never_runs_code_of_a_source_that_has_changed(tmp_path):
    """Halfway the cubic polynomial is 1/2, and a square in its place 1/4."""
    caches = {"XDG_CACHE_HOME": str(tmp_path / "kept")}
    first, second = clone(tmp_path / "first"), clone(tmp_path / "second")
    assert run(first, **caches) == [0.5, 0.0]
    assert run(first, **caches) == [0.5, 1.0], "the same source is compiled once"
    assert run(second, **caches) == [0.5, 1.0], "in any clone"

    text = (first / CALLED).read_text()
    assert "return s * s * (3.0 - 2.0 * s)," in text
    (first / CALLED).write_text(text.replace("s * s * (3.0 - 2.0 * s)", "s * s"))
    assert run(first, **caches) == [0.25, 0.0]
    assert run(second, **caches) == [0.5, 1.0], "neither clone takes the other's"
    (first / CALLED).write_text(text)
    assert run(first, **caches) == [0.5, 1.0]

    with (first / "systems" / "radio" / "codec.py").open("a") as file:
        file.write("\nUNUSED = 1\n")
    assert run(first, **caches) == [0.5, 1.0], "no part of what the function calls"


def test_a_digest_is_of_all_that_a_file_imports(tmp_path):
    """In brackets, within functions, as a module of a package, in a user's file."""
    own = tmp_path / "own.py"
    digests = set()
    for text in (
        "x = 1",
        "from systems.world import plane",
        "from systems.world import (\n    paths,  # a comment\n    plane,\n)",
        "def f():\n    import math, systems.radio.codec as codec",
        "from diagrams.running.compiled.loop import CompiledLoop",
    ):
        own.write_text(text)
        digests.add(source_digest(own))
        own.write_text(text)
        assert source_digest(own) in digests
    assert len(digests) == 5


def test_files_that_overload_functions_of_others_are_part_of_every_digest():
    found = {
        file
        for package in ("systems", "diagrams", "analysis")
        for file in (ROOT / package).rglob("*.py")
        if "@overload(" in file.read_text("utf-8")
    }
    # The tracker overloads functions of its own file alone.
    own = ROOT / "systems" / "hearing" / "tracking" / "tracker_model.py"
    assert found == {*OVERLOADS, own}
