"""``simulate --save-audio``, as a user meets it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import soundfile

import phonotaxis

ROOT = Path(phonotaxis.__file__).parents[1]


def call(capsys, *words: str) -> tuple[int, str, str]:
    status = phonotaxis.main(words)
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_summary_names_files_that_locate_reads(tmp_path, capsys):
    ears, out = tmp_path / "ears", tmp_path / "out"
    words = ("--out", str(out), "--set", "duration_s=1", "--json")
    status, printed, _ = call(capsys, "simulate", "--save-audio", str(ears), *words)
    audio = json.loads(printed)["audio"]
    assert status == 0
    assert json.loads((out / "summary.json").read_text())["audio"] == audio
    assert (audio["directory"], audio["until_s"]) == (str(ears), 1.0)
    heard, played = audio["heard"]["robot"], audio["played"]["source"]
    named = {heard["file"], heard["geometry"], played["file"]}
    assert named == {path.name for path in ears.iterdir()}
    status, located, _ = call(
        capsys,
        "locate",
        str(ears / heard["file"]),
        "--geometry",
        str(ears / heard["geometry"]),
        "--json",
    )
    assert status == 0
    assert json.loads(located)["estimates"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--set", "hearing=ideal"), "no robot hears sound waves (hearing is ideal)"),
        (("--save-audio", "full"), "full is not empty; name another directory"),
        (("--save-audio", "file"), "file is a file; name a directory"),
        (("--save-audio", "mine/../full"), "mine/../full is not empty; name another"),
        (("--save-audio", "out"), "out is the directory of the results or in it"),
        (("--save-audio", "out/ears"), "out/ears is the directory of the results or"),
    ],
)
def test_refusals_come_before_the_run_and_leave_nothing(
    tmp_path, capsys, monkeypatch, words, complaint
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("keep")
    (tmp_path / "file").write_text("keep")
    status, out, err = call(
        capsys, "simulate", "--save-audio", "ears", "--out", "out", *words
    )
    assert (status, out) == (2, "")
    assert err.startswith(f"phonotaxis: save_audio: {complaint}")
    assert err.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"full", "file"}
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["mine"]


@pytest.mark.slow
def test_an_interrupt_leaves_what_was_heard(tmp_path):
    code = (
        "import signal, sys, phonotaxis\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "sys.exit(phonotaxis.main())\n"
    )
    words = "simulate", "--save-audio", "ears", "--set", "duration_s=2000"
    with subprocess.Popen(
        [sys.executable, "-c", code, *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        heard = tmp_path / "ears" / "heard.wav"
        give_up = time.monotonic() + 60.0
        while not heard.exists() or heard.stat().st_size < 1_000_000:
            assert time.monotonic() < give_up
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, complaint = process.communicate(timeout=60)
    assert process.returncode == 1
    told = complaint.removeprefix("phonotaxis: interrupted; the sound until ")
    assert told.endswith(" s is in ears\n")
    frames = soundfile.info(heard).frames
    assert frames == soundfile.info(tmp_path / "ears" / "played.wav").frames
    assert frames == round(100_000 * float(told.split()[0]))
    assert {path.name for path in tmp_path.iterdir()} == {"ears"}
