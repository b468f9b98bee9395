"""The command line, as a user meets it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

import phonotaxis

#: A run of a tick or so, for errors that must come before it.
SHORT = ("--set", "duration_s=0.1", "--set", "hearing=ideal")


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def write_wav(path: Path, *, seconds: float = 0.5, channels: int = 1) -> Path:
    samples = np.random.default_rng(0).standard_normal((int(8000 * seconds), channels))
    soundfile.write(path, 0.1 * samples, 8000)
    return path


def truncated_wav(path: Path) -> Path:
    whole = write_wav(path).read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    return path


def text_file(path: Path) -> Path:
    path.write_text("this is no sound\n")
    return path


def empty_wav(path: Path) -> Path:
    soundfile.write(path, np.zeros((0, 1)), 8000)
    return path


def occupied(path: Path) -> Path:
    path.mkdir()
    (path / "mine").write_text("keep")
    return path


def test_scenarios_lists_the_papers_experiments(capsys):
    status, out, _ = call(capsys, "scenarios")
    assert status == 0
    listed = [line.split()[0] for line in out.splitlines()]
    assert {
        "default",
        "obstacle_free",
        "two_static_obstacles",
        "one_moving_obstacle",
        "two_moving_obstacles",
        "corridor",
        "u_trap",
        "wall",
        "clutter",
        "crowd",
        "rooms",
        "two_moving_obstacles_resting_source",
    } <= set(listed)


def test_laws_lists_names_and_titles(capsys):
    status, out, _ = call(capsys, "laws")
    assert status == 0
    listed = json.loads(call(capsys, "laws", "--json")[1])
    assert listed["schema_version"] == 2
    assert [line.split(maxsplit=1) for line in out.splitlines()] == [
        [law["name"], law["title"]] for law in listed["laws"]
    ]


@pytest.mark.parametrize(
    ("words", "field", "hint"),
    [
        (["no_such"], "scenario", "phonotaxis scenarios"),
        (["missing.yaml"], "scenario", "check the path"),
        (["--law", "magic"], "law", "conventional"),
        (["--law", "no_such_module:law"], "law", "cannot be imported"),
        (["--velocity-term", "half"], "collision_vector.velocity_term", "closing"),
        (["--set", "sourc.speed_m_s=1"], "sourc", "did you mean 'source'"),
        (["--set", "source.spee_m_s=1"], "source.spee_m_s", "did you mean"),
        (["--set", "duration_s=soon"], "duration_s", "number"),
        (["--set", "robot.wheel_radius_m=-0.06"], "robot.wheel_radius_m", "greater"),
        (["--set", "microphones.snr_db_at_1m=.nan"], "microphones.snr_db_at_1m", "fin"),
        (["--set", "seed"], "seed", "key=value"),
        (["--seed", "1.5"], "seed", "whole number"),
        (["--set", "sound.high_hz=60000"], "sound.high_hz", "lower it"),
        (["--set", "tdoa.band_hz=[300, 60000]"], "tdoa.band_hz.1", "50000"),
        (["--set", "tdoa.band_hz=wide"], "tdoa.band_hz", "found"),
        (
            ["--set", "obstacles=[{name: a, waypoints_m: [[0.1, 0.2]]}]"],
            "obstacles.0",
            "move",
        ),
        (["--set", "source.waypoints_m=[[0.1, 0.0]]"], "source", "move"),
        (["--no-such-option"], "command line", "--help"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, tmp_path, words, field, hint):
    out = tmp_path / "out"
    words = ["simulate", *words, "--out", str(out)]
    status, printed, complaint = call(capsys, *words)
    assert status == 2
    assert printed == ""
    assert len(complaint.splitlines()) == 1
    assert f"phonotaxis: {field}" in complaint
    assert hint in complaint
    assert not out.exists()

    status, printed, complaint = call(capsys, *words, "--json")
    assert status == 2
    assert complaint == ""
    document = json.loads(printed)
    assert document["error"]["field"].startswith(field)
    assert hint in document["error"]["message"]


@pytest.mark.parametrize(
    ("make", "hint"),
    [
        (lambda path: path, "no"),
        (text_file, "WAV"),
        (empty_wav, "no samples"),
        (truncated_wav, "again"),
        (lambda path: write_wav(path, channels=2), "mix it down"),
    ],
)
def test_bad_sound_file_is_one_line_and_status_2(capsys, tmp_path, make, hint):
    sound = make(tmp_path / "sound.wav")
    out = tmp_path / "out"
    words = ["simulate", "--sound", str(sound), "--out", str(out)]
    status, printed, complaint = call(capsys, *words)
    assert (status, printed) == (2, "")
    assert len(complaint.splitlines()) == 1
    assert "sound.file" in complaint
    assert "sound.wav" in complaint
    assert hint in complaint
    assert not out.exists()


def test_used_output_directory_is_refused_and_kept(capsys, tmp_path):
    out = occupied(tmp_path / "out")
    status, _, complaint = call(capsys, "simulate", *SHORT, "--out", str(out))
    assert status == 2
    assert "out: " in complaint
    assert [p.name for p in out.iterdir()] == ["mine"]


def test_output_below_a_file_is_refused(capsys, tmp_path):
    file = text_file(tmp_path / "file")
    status, _, complaint = call(capsys, "simulate", *SHORT, "--out", str(file / "out"))
    assert status == 2
    assert "out: " in complaint


def test_bad_recording_is_one_line_and_status_2(capsys, tmp_path):
    mono = write_wav(tmp_path / "mono.wav")
    status, printed, complaint = call(capsys, "locate", str(mono))
    assert (status, printed) == (2, "")
    assert len(complaint.splitlines()) == 1
    assert "mono.wav" in complaint


def row_recording(path):
    """Noise that three microphones 0.4 m apart hear at once: from ahead."""
    noise = np.random.default_rng(1).standard_normal(16_000)
    microphones = 0.1 * np.stack([noise] * 3, axis=1)
    microphones += 1e-3 * np.random.default_rng(2).standard_normal(microphones.shape)
    soundfile.write(path, microphones, 16_000)
    return path


def test_locate_writes_a_directory(capsys, tmp_path):
    sound, out = row_recording(tmp_path / "row.wav"), tmp_path / "out"
    status, printed, complaint = call(
        capsys, "locate", str(sound), "--out", str(out), "--json"
    )
    assert status == 0
    assert "straight ahead of it" in complaint  # what it says of delays of nothing
    document = json.loads(printed)
    assert document["summary"]["bearing_deg"] == pytest.approx(0.0, abs=1.0)
    assert document == json.loads((out / "locate.json").read_text())
    assert {p.name for p in out.iterdir()} == {"locate.json", "locate.png"}
    status, _, complaint = call(capsys, "locate", str(sound), "--out", str(out))
    assert status == 2
    assert "out: " in complaint


def test_bad_recording_leaves_no_directory(capsys, tmp_path):
    mono, out = write_wav(tmp_path / "mono.wav"), tmp_path / "out"
    assert call(capsys, "locate", str(mono), "--out", str(out))[0] == 2
    assert not out.exists()


def test_json_document_and_result_directory(capsys, tmp_path):
    out = tmp_path / "out"
    words = ["simulate", "--set", "duration_s=2.5", "--seed", "5", "--out", str(out)]
    status, printed, complaint = call(capsys, *words, "--json")
    assert (status, complaint) == (0, "")
    summary = json.loads(printed)
    assert summary["seed"] == 5
    assert summary["law"] == "active"
    assert summary["scenario"] == "default"
    assert summary["cause"] == "completed"
    assert summary["timing"]["simulated_s"] == pytest.approx(2.5)
    assert {"python", "drake", "numpy"} <= set(summary["versions"])
    assert summary == json.loads((out / "summary.json").read_text())
    assert {p.name for p in out.iterdir()} == {
        "scenario.yaml",
        "scenario.schema.json",
        "summary.json",
        "trajectory.parquet",
        "trajectory.png",
        "time_series.png",
        "diagram.svg",
        "replay.html",
        "report.html",
    }

    again = tmp_path / "again"
    words = ["simulate", str(out / "scenario.yaml"), "--out", str(again)]
    assert call(capsys, *words)[0] == 0
    table = "trajectory.parquet"
    assert (again / table).read_bytes() == (out / table).read_bytes()


def test_directory_that_cannot_be_made_is_refused_before_the_run(capsys):
    long = ["--set", "duration_s=100000"]
    status, _, complaint = call(capsys, "simulate", *long, "--out", "/proc/out")
    assert status == 2
    assert len(complaint.splitlines()) == 1
    assert "phonotaxis: out: /proc" in complaint


def test_a_law_that_gives_nan_is_found_before_the_run(capsys, tmp_path, monkeypatch):
    (tmp_path / "nan_laws.py").write_text(
        "def nowhere(c, s, laws):\n    return c * float('nan')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    out = tmp_path / "out"
    words = ["simulate", "--law", "nan_laws:nowhere", "--out", str(out)]
    status, printed, complaint = call(capsys, *words)
    assert (status, printed) == (2, "")
    assert len(complaint.splitlines()) == 1
    assert "'nan_laws:nowhere' returns nan at c = " in complaint
    assert not out.exists()


#: Says when the first simulated second is over: the run is under way.
TELLING = """
import sys
import diagrams
import phonotaxis

simulate = diagrams.simulate

def telling(scenario, *, progress, **others):
    def tell(time_s):
        print("runs", file=sys.__stdout__, flush=True)
        progress(time_s)
    return simulate(scenario, progress=tell, **others)

diagrams.simulate = telling
sys.exit(phonotaxis.main())
"""


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_leaves_nothing_behind(tmp_path, kind):
    out = tmp_path / "results" / "run"
    root = Path(phonotaxis.__file__).parents[1]
    words = ["simulate", "--set", "duration_s=2000", "--out", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-c", TELLING, *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(root)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "runs\n"
    process.send_signal(kind)
    _, complaint = process.communicate(timeout=30)
    assert process.returncode == 1
    assert "interrupted" in complaint
    assert len(complaint.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
