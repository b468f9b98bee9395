"""What is bad input, what is a failure, and that neither looks like success."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import soundfile

import phonotaxis

ROOT = Path(phonotaxis.__file__).parents[1]
SHORT = ("--set", "duration_s=0.05", "--set", "hearing=ideal")
FIVE_LAWS = """
import functools, math, sys
def one(c): return 1.0
def none(c, s, laws): pass
def nan(c, s, laws): return float("nan")
def text(c, s, laws): return "1"
def imaginary(c, s, laws): return 1j
def listed(c, s, laws): return [1.0]
def raises(c, s, laws): raise KeyError("k" * 1000)
def leaves(c, s, laws): sys.exit(0)
def late(c, s, laws): return math.sqrt(-1.0) if 1.6 < c < 2.9 else 0.0
def stops(c, s, laws): raise KeyboardInterrupt
class Odd(BaseException): pass
def odd(c, s, laws): raise Odd("odd")
def late_odd(c, s, laws): return odd(c, s, 0) if 1.6 < c < 2.9 else 0.0
class Plain: pass
def scaled(k, c, s, laws): return k / c
partial = functools.partial(scaled, 2.0)
"""


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@pytest.fixture
def laws(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "five_laws.py").write_text(FIVE_LAWS)
    return tmp_path


def fail(*_args, **_options):
    raise KeyError("a bug")


@pytest.mark.parametrize(
    ("words", "place"),
    [
        (["design"], "phonotaxis.loops.study_design"),
        (["simulate", *SHORT], "diagrams.simulate"),
        (["stability"], "phonotaxis.loops.analyze_law"),
        (["accuracy"], "analysis.arrays.localization.prepare_localization"),
        (["locate", "heard.wav"], "phonotaxis.recordings.located"),
        (["scenarios"], "diagrams.scenario.loading.library_scenarios"),
        (["compare", "wall"], "phonotaxis.batches.prepare_comparison"),
    ],
)
def test_a_bug_is_no_bad_input(capsys, tmp_path, monkeypatch, words, place):
    """One line with kind and place, status 1; --debug prints the traceback."""
    monkeypatch.chdir(tmp_path)
    noise = np.random.default_rng(1).standard_normal((4_800, 3))
    soundfile.write("heard.wav", 0.1 * noise, 48_000)
    module, _, function = place.rpartition(".")
    monkeypatch.setattr(import_module(module), function, fail)
    status, printed, complaint = call(capsys, *words)
    assert (status, printed) == (1, "")
    assert complaint.count("\n") == 1
    assert complaint.startswith("phonotaxis: KeyError in ")
    assert "--debug" in complaint
    status, _, complaint = call(capsys, *words, "--debug")
    assert status == 1
    assert "Traceback" in complaint
    assert [path.name for path in tmp_path.iterdir()] == ["heard.wav"]


def test_a_value_error_of_the_program_is_a_bug(capsys, tmp_path, monkeypatch):
    """What numpy and scipy raise is no complaint about the user's input."""

    def wrong(*_args, **_options):
        raise ValueError("operands: could not be broadcast together")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("phonotaxis.loops.study_design", wrong)
    assert call(capsys, "design")[0] == 1


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("one", "takes 1 positional argument"),
        ("none", "returns None"),
        ("nan", "returns nan"),
        ("text", "returns '1' (str)"),
        ("imaginary", "returns 1j"),
        ("listed", "returns [1.0]"),
        ("raises", "raises KeyError"),
        ("leaves", "raises SystemExit"),
        ("stops", "raises KeyboardInterrupt"),
        ("odd", "raises Odd: odd"),
        ("Plain", "not a LeafSystem"),
    ],
)
@pytest.mark.parametrize("module", ["five_laws", "./five_laws.py"])
def test_a_law_that_is_none(capsys, laws, module, name, message):
    words = ["simulate", *SHORT, "--law", f"{module}:{name}"]
    status, printed, complaint = call(capsys, *words)
    assert (status, printed) == (2, "")
    assert complaint.count("\n") == 1
    assert len(complaint) <= 300
    assert complaint.startswith("phonotaxis: law: ")
    assert message in complaint


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def f(:", "SyntaxError"),
        ("import sys\nsys.exit(0)", "SystemExit"),
        ("raise RuntimeError('no')", "RuntimeError: no in line 1 of"),
        ("import nothing_of_that_name", "ModuleNotFoundError"),
        ("raise KeyboardInterrupt", "KeyboardInterrupt in line 1 of"),
        ("raise GeneratorExit", "GeneratorExit in line 1 of"),
        ("class Odd(BaseException): pass\nraise Odd('odd')", "Odd: odd in line 2 of"),
    ],
)
def test_a_module_that_cannot_be_imported(capsys, laws, text, message):
    name = f"module_{abs(hash(text))}"
    (laws / f"{name}.py").write_text(text)
    for law in (f"{name}:f", f"{laws}/{name}.py:f"):
        status, printed, complaint = call(capsys, "simulate", "--law", law)
        assert (status, printed) == (2, "")
        assert complaint.count("\n") == 1
        assert message in complaint


@pytest.mark.parametrize(
    ("law", "kind"), [("late", "ValueError"), ("late_odd", "Odd: odd")]
)
def test_a_law_that_fails_in_the_run(capsys, laws, law, kind):
    """The trial before the run does not meet every distance."""
    obstacle = 'obstacles=[{"waypoints_m": [[2.3, 0.0]]}]'
    words = ["simulate", *SHORT, "--set", "source.waypoints_m=[[4, 0]]"]
    words += ["--set", "obstacle_sensing=ideal", "--set", obstacle]
    status, printed, complaint = call(capsys, *words, "--law", f"five_laws.py:{law}")
    assert (status, printed) == (1, "")
    assert complaint.count("\n") == 1
    assert f"'five_laws.py:{law}' raises {kind}" in complaint
    assert " m, s = 0 m/s" in complaint
    assert not (laws / "results").exists()


TALKING = """
import atexit
print("imported")
atexit.register(print, "at exit")
def soft(c, s, laws):
    print("called")
    return 1.0 / c
"""


@pytest.mark.slow
def test_what_a_law_prints_goes_to_standard_error(laws):
    (laws / "talking.py").write_text(TALKING)
    obstacle = ("--set", 'obstacles=[{"waypoints_m": [[2.4, 0.6]]}]')
    words = ["simulate", *SHORT, *obstacle, "--no-plots", "--out", "out", "--json"]
    ended = subprocess.run(
        [sys.executable, "-m", "phonotaxis", *words, "--law", "talking.py:soft"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(ended.stdout)["law"] == "talking.py:soft"
    lines = ended.stderr.splitlines()
    assert lines[0] == "imported"
    assert lines[-1] == "at exit"
    assert set(lines[1:-1]) == {"called"}


def test_a_partial_is_a_law(capsys, laws):
    assert call(capsys, "simulate", *SHORT, "--law", "five_laws.py:partial")[0] == 0


@pytest.mark.parametrize(
    ("command", "written"),
    [
        (["simulate", *SHORT], "analysis.views.run_directory.write_scenario"),
        (["design", "--json"], "phonotaxis.loops.write_design"),
    ],
)
def test_a_full_disk_is_one_line_and_leaves_nothing(
    capsys, tmp_path, monkeypatch, command, written
):
    def no_space(*_args, **_options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "summary.json")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(written, no_space)
    monkeypatch.setattr("phonotaxis.loops.study_design", lambda *_a, **_k: None)
    monkeypatch.setattr("phonotaxis.loops.design_document", lambda *_: {})
    status, printed, complaint = call(capsys, *command)
    said = complaint or json.loads(printed)["error"]["message"]
    assert status == 1
    assert "No space left on device" in said
    assert "free space on the disk" in said
    assert list(tmp_path.iterdir()) == []


def test_json_has_no_infinity(capsys, tmp_path, monkeypatch):
    from analysis.runs.metric_table import run_metrics

    def with_infinity(result):
        return run_metrics(result) | {"least_time_to_contact_s": float("inf")}

    monkeypatch.setattr("analysis.runs.run_report.run_metrics", with_infinity)
    out = tmp_path / "out"
    status, printed, _ = call(capsys, "simulate", *SHORT, "--json", "--out", str(out))
    assert status == 0
    assert "Infinity" not in printed
    assert "Infinity" not in (out / "summary.json").read_text()
    assert json.loads(printed)["metrics"]["least_time_to_contact_s"] is None


def test_messages_are_short_whatever_was_in_the_file(capsys, tmp_path):
    file = tmp_path / "scene.yaml"
    file.write_text(f"robot: {{mass_kg: {'x' * 90_000}}}\n")
    status, _, complaint = call(capsys, "simulate", str(file))
    assert status == 2
    assert complaint.count("\n") == 1
    assert len(complaint) <= 300
    assert complaint.startswith("phonotaxis: robot.mass_kg: is 'xxx")
    assert complaint.rstrip().endswith("valid number")


#: A locale whose encoding is ASCII, and no way round it.
ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
QUICK = f"simulate {' '.join(SHORT)} --no-plots --out out"


def shell(
    folder: Path, words: str, environment: dict[str, str]
) -> subprocess.CompletedProcess[str]:
    """What a command does in a shell; ``{}`` in the words stands for the program."""
    program = f"'{sys.executable}' -m phonotaxis"
    if "{}" not in words:
        words = f"{{}} {words}"
    return subprocess.run(
        ["/bin/sh", "-c", words.replace("{}", program)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "status", "complaint"),
    [
        ("--help >/dev/full", 1, "cannot write (No space left on device)"),
        ("--version >/dev/full", 1, "cannot write (No space left on device)"),
        ("scenarios >/dev/full", 1, "standard output cannot be written (No space"),
        ("columns --json >/dev/full", 1, "standard output cannot be written (No sp"),
        (f"{QUICK} >/dev/full", 1, "on device); the results are in out"),
        ("simulat --json >/dev/full", 2, "'simulat' is not a command"),
        ("simulat >/dev/full 2>/dev/full", 2, ""),
        ("( sleep 0.5; {} scenarios; echo $? >status ) | true", 1, ""),
        ("( sleep 0.5; {} --help; echo $? >status ) | true", 1, ""),
        (f"( {{}} {QUICK} --json; echo $? >status ) | true", 1, ""),
    ],
)
def test_standard_output_that_cannot_be_written(tmp_path, words, status, complaint):
    """A line at most, and the status of what has happened."""
    ended = shell(tmp_path, words, {})
    left = tmp_path / "status"
    found = int(left.read_text()) if "status" in words else ended.returncode
    assert (found, ended.stdout) == (status, "")
    assert complaint in ended.stderr
    assert ended.stderr.count("\n") == bool(complaint), ended.stderr


@pytest.mark.slow
def test_a_locale_of_ascii(tmp_path):
    """Drake is loaded, and workers load it, too; what is not ASCII names the remedy."""
    (tmp_path / "sweep.yaml").write_text(
        "set: {hearing: ideal, duration_s: 0.05}\nruns: 2\n"
    )
    (tmp_path / "sound.yaml").write_text(
        "sound: {kind: wav, file: \u03bb.wav}\n", encoding="utf-8"
    )
    for words in (f"{QUICK} --json", "sweep sweep.yaml --workers 1 --json"):
        ended = shell(tmp_path, words, ASCII)
        assert (ended.returncode, ended.stderr) == (0, "")
        assert json.loads(ended.stdout)["schema_version"] == 2
    for words in ("simulate \u03bb.yaml", "simulate sound.yaml"):
        ended = shell(tmp_path, words, ASCII)
        assert (ended.returncode, ended.stdout) == (2, "")
        assert ended.stderr.startswith("phonotaxis: locale: ")
        assert ended.stderr.endswith(
            "; set PYTHONUTF8=1, or a locale with UTF-8, for example LC_ALL=C.UTF-8\n"
        )
        assert ended.stderr.count("\n") == 1


def test_a_system_without_utf_8(capsys, monkeypatch):
    """The remedy is named before anything is loaded."""
    monkeypatch.setattr(
        "locale.getpreferredencoding", lambda do_setlocale=True: "ANSI_X3.4-1968"
    )
    status, printed, complaint = call(capsys, "simulate", *SHORT)
    assert (status, printed) == (2, "")
    assert complaint.startswith("phonotaxis: locale: Drake needs UTF-8, and the encod")
    assert "PYTHONUTF8=1" in complaint


def test_a_working_directory_that_is_not_utf_8(tmp_path, monkeypatch, capsys):
    """It would stand in the results, in which text is UTF-8."""
    folder = tmp_path / "\udcff"
    folder.mkdir()
    monkeypatch.chdir(folder)
    status, _, complaint = call(capsys, "simulate", *SHORT)
    assert status == 2
    assert complaint.startswith("phonotaxis: out: ")
    assert list(folder.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "environment", "status"),
    [
        ("simulate nothing 2>&-", {}, 2),
        ("scenarios >&-", {}, 0),
        (
            "scenarios",
            {"LC_ALL": "C", "PYTHONIOENCODING": "ascii"},
            0,
        ),
        (
            f"simulate {' '.join(SHORT)} --set description=\u03bb",
            {"PYTHONIOENCODING": "ascii", "MPLBACKEND": "module://matplotlib_inline.x"},
            0,
        ),
    ],
)
def test_terminals_and_notebooks(tmp_path, words, environment, status):
    process = shell(tmp_path, words, environment)
    assert process.returncode == status, process.stderr
    assert "Traceback" not in process.stderr
    assert process.stderr.count("\n") <= 1
