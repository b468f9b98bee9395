"""To list what there is and to refuse bad input loads nothing that simulates."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
from pathlib import Path

import phonotaxis
from tests.refusals import BROKEN, REFUSALS

ROOT = Path(phonotaxis.__file__).parent
HEAVY = {"pydrake", "numba", "scipy", "pandas", "matplotlib", "control", "dask"}
#: It is by these that scenarios are checked.
CHECKING = {"numpy", "pydantic"}
TELLING = """
import contextlib, io, json, sys
import phonotaxis
told = []
for words in json.loads(sys.argv[1]):
    with contextlib.redirect_stdout(io.StringIO()):
        with contextlib.redirect_stderr(io.StringIO()):
            status = phonotaxis.main(words)
    told.append([words, status, [*{name.partition(".")[0] for name in sys.modules}]])
print(json.dumps(told))
"""


def loaded_by(
    tmp_path: Path, *commands: tuple[str, ...]
) -> list[tuple[list[str], int, list[str]]]:
    """Words, exit status and top-level modules after each of some commands."""

    ran = subprocess.run(
        [sys.executable, "-c", TELLING, json.dumps(commands)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    told: list[tuple[list[str], int, list[str]]] = json.loads(ran.stdout)
    return told


def test_lists_load_nothing_that_simulates(tmp_path):
    lists = [("scenarios",), ("fields", "room"), ("laws",), ("completion", "bash")]
    for words, status, modules in loaded_by(tmp_path, *lists):
        assert status == 0, words
        assert not (HEAVY | CHECKING) & set(modules), words


def test_refusals_load_nothing_that_simulates(tmp_path):
    for name, content in BROKEN.items():
        (tmp_path / name).write_bytes(content)
    for words, status, modules in loaded_by(tmp_path, *REFUSALS):
        assert status == 2, words
        assert not HEAVY & set(modules), words
    left = {path.name for path in tmp_path.iterdir()} - {"__pycache__"}
    assert left == BROKEN.keys()


QUICK = ("--no-plots", "--out", "out", "--set", "duration_s=0.1", "--set")


def test_a_terminal_is_told_what_begins_before_it_is_loaded(tmp_path):
    terminal, other_end = pty.openpty()
    simulate = ("-m", "phonotaxis", "simulate", *QUICK, "hearing=ideal")
    with subprocess.Popen(
        [sys.executable, "-X", "importtime", *simulate],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=other_end,
        stdout=subprocess.DEVNULL,
    ) as process:
        os.close(other_end)
        shown = b""
        try:
            while part := os.read(terminal, 65_536):
                shown += part
        except OSError:  # the terminal's other end is closed
            pass
    os.close(terminal)
    assert process.returncode == 0
    assert shown.index(b"phonotaxis: simulating default ...") < shown.index(b"pydrake")


def test_no_plots_and_the_last_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert phonotaxis.main(["simulate", *QUICK, "hearing=ideal"]) == 0
    assert not [*(tmp_path / "out").glob("*.png"), *(tmp_path / "out").glob("*.svg")]
    last = capsys.readouterr().out.splitlines()[-1].split()
    assert last[:3] == ["replay", "out/replay.html,", "to"]
    assert (tmp_path / "out/replay.html").is_file()


def test_help_of_every_command_loads_nothing_else(tmp_path):
    code = """
import contextlib, io, sys
import phonotaxis
from phonotaxis.commands.command_line import COMMANDS
for words in ([], *([name] for name in COMMANDS)):
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
        phonotaxis.main([*words, "--help"])
print(*COMMANDS, *(name.partition(".")[0] for name in sys.modules))
"""
    loaded = printed_by(code)
    assert {"simulate", "laws", "phonotaxis"} <= loaded
    assert (
        not {"analysis", "systems", "diagrams", "numpy", "pydrake", "pydantic"} & loaded
    )


def test_blocks_load_no_plotting():
    """Nor python-control, pydrake.all, and what scipy imports for a second."""
    code = """
import sys, diagrams, systems
for package in (systems, diagrams):
    for name in dir(package):
        getattr(package, name)
print(*sys.modules)
"""
    loaded = printed_by(code)
    assert {"systems.world", "diagrams.building"} <= loaded
    slow = {"matplotlib", "control", "pydrake.all", "scipy.signal", "scipy.stats"}
    assert not slow & loaded


def printed_by(code):
    """Words that a new process prints."""
    ran = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT.parent,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(ran.stdout.split())
