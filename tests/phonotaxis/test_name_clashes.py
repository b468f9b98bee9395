"""A user's module with the name of one of our packages is named in one line."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.batches.processes import worker_command

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = Path(sys.executable).with_name("phonotaxis")


def python(
    *words: str, path: list[str], folder: Path
) -> subprocess.CompletedProcess[str]:
    """Runs Python in a folder, with modules from the given places first."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path)}
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    ("file", "named"),
    [
        ("systems/__init__.py", "systems"),
        ("diagrams.py", "diagrams.py"),
        ("analysis/__init__.py", "analysis"),
    ],
)
@pytest.mark.parametrize(
    ("words", "status", "begins"),
    [
        (["-c", "import phonotaxis"], 1, "ImportError: "),
        (["-c", "import systems, diagrams, analysis, phonotaxis"], 1, "ImportError: "),
        (["-m", "phonotaxis", "--version"], 2, "phonotaxis: "),
        ([str(SCRIPT), "--version"], 2, "phonotaxis: "),
    ],
)
def test_a_module_that_hides_ours_is_named(
    tmp_path: Path, file: str, named: str, words: list[str], status: int, begins: str
) -> None:
    path = tmp_path / file
    path.parent.mkdir(exist_ok=True)
    path.touch()
    ended = python(*words, path=[str(tmp_path), str(ROOT)], folder=tmp_path)
    package = named.removesuffix(".py")
    place = tmp_path / named
    assert ended.returncode == status
    assert ended.stderr.splitlines()[-1] == (
        f"{begins}{place} hides the package '{package}' of phonotaxis; rename yours"
    )
    if status == 2:  # a user of the command line sees no traceback
        assert ended.stderr.count("\n") == 1


def test_folders_that_hide_nothing_are_no_fault(tmp_path: Path) -> None:
    """A folder without ``__init__.py``, and one that we do not have."""
    (tmp_path / "analysis").mkdir()
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "__init__.py").touch()
    code = "import phonotaxis; phonotaxis.load_scenario()"
    ended = python("-c", code, path=[str(tmp_path), str(ROOT)], folder=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.parametrize(
    "law", ["from systems.gains import K", "from systems import K"]
)
def test_a_module_that_ours_hide_is_named(tmp_path: Path, law: str) -> None:
    (tmp_path / "systems").mkdir()
    (tmp_path / "systems" / "__init__.py").write_text("K = 2.0\n")
    (tmp_path / "systems" / "gains.py").write_text("K = 2.0\n")
    (tmp_path / "my_laws.py").write_text(f"{law}\ndef soft(c, s, laws): return K\n")
    words = ["simulate", "--law", "my_laws:soft", "--out", "out"]
    ended = python(str(SCRIPT), *words, path=[str(ROOT)], folder=tmp_path)
    line = ended.stderr.splitlines()[-1]
    assert ended.returncode == 2
    assert line.startswith("phonotaxis: law: 'my_laws:soft' cannot be imported: ")
    assert f"its package 'systems' hides {tmp_path / 'systems'}; rename yours" in line
    assert line.endswith(" in line 1 of my_laws.py")


def test_workers_load_our_packages(tmp_path: Path) -> None:
    """Also if a module of the user has come to the front of the path."""
    (tmp_path / "analysis.py").touch()
    ours, theirs = socket.socketpair()
    ours.close()  # no tasks: the worker ends as soon as it has loaded its code
    with theirs:
        subprocess.run(
            worker_command(theirs.fileno()),
            env={**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
            pass_fds=[theirs.fileno()],
            check=True,
        )
