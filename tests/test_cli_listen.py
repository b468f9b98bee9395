"""``listen``, as a user meets it."""

from __future__ import annotations

import contextlib
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
from tests.analysis.arrays.plane_waves import RATE, SQUARE, plane_waves, wav_bytes

ROOT = Path(phonotaxis.__file__).parent


@pytest.fixture
def array(tmp_path) -> str:
    path = tmp_path / "array.yaml"
    path.write_text(f"microphones: {[list(place) for place in SQUARE]}\n")
    return str(path)


def call(capsys, *words: str) -> tuple[int, list[str], str]:
    status = phonotaxis.main(("listen", *words))
    captured = capsys.readouterr()
    return status, captured.out.splitlines(), captured.err


@pytest.mark.parametrize("name", ["heard.wav", "heard.flac"])
def test_a_file_gives_a_line_a_step_and_one_at_the_end(tmp_path, capsys, array, name):
    path = tmp_path / name
    soundfile.write(path, plane_waves(-120.0, 2.0).T, RATE)
    status, lines, err = call(capsys, str(path), "--geometry", array, "--json")
    *told, end = map(json.loads, lines)
    assert (status, err) == (0, "")
    assert {line["source"] for line in told} == {1}
    assert [line["t_s"] for line in told][-1] == 2.0
    np.testing.assert_allclose([t["bearing_deg"] for t in told], -120.0, atol=2.0)
    assert end == {
        "status": "the stream has ended",
        "seconds": 2.0,
        "sources": 1,
        "faults": [],
    }


def test_a_stream_that_must_not_be_believed_ends_with_status_1(tmp_path, capsys, array):
    path = tmp_path / "heard.wav"
    samples = plane_waves(-120.0, 2.0)
    samples[1:3] = 0.0
    path.write_bytes(wav_bytes(samples))
    status, lines, err = call(capsys, str(path), "--geometry", array)
    assert status == 1
    assert lines[-1].startswith("stopped: channel 3: dead")
    assert err.count("\n") == 2  # channel 2, and the end


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("none.wav",), "input: cannot read it"),
        (("raw",), "input: it is not a WAV file; state its format, for example"),
        (("raw", "--rate", "0"), "--rate: is 0; give a number above 0"),
        (("raw", "--rate", "400"), "input: it has a sample rate of 400 Hz; record at"),
        (("raw", "--rate", "16000", "--channels", "2"), "input: it has 2 channels"),
        (("mono.wav",), "input: it is mono, but the array needs 4"),
        ((), "input: it is empty"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    tmp_path, capsys, monkeypatch, array, words, complaint
):
    monkeypatch.chdir(tmp_path)
    Path("raw").write_bytes(b"\0" * 4_000)
    Path("mono.wav").write_bytes(wav_bytes(np.zeros((1, 100), np.float32)))
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        status, lines, err = call(capsys, *words, "--geometry", array)
    assert (status, lines) == (2, [])
    assert err.startswith(f"phonotaxis: {complaint}")
    assert err.count("\n") == 1


def start(array: str, *words: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "phonotaxis", "listen", "--geometry", array]
    return subprocess.Popen(
        [*command, "--json", *words],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


@pytest.mark.slow
def test_an_interrupt_ends_it_with_its_status(array):
    with start(array, "--rate", str(RATE)) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        counts = np.rint(plane_waves(10.0, 1.0).T * 2**15).astype("<i2")
        child.stdin.write(counts.tobytes())
        child.stdin.flush()
        first = json.loads(child.stdout.readline())
        child.send_signal(signal.SIGINT)
        *_, last = child.stdout.read().splitlines()
        errors = child.stderr.read() if child.stderr else b""
    assert first["bearing_deg"] == pytest.approx(10.0, abs=2.0)
    assert json.loads(last)["status"] == "interrupted"
    assert child.returncode == 0
    assert b"Traceback" not in errors


@pytest.mark.slow
def test_a_reader_that_leaves_ends_it_without_a_word(array):
    with start(array) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        child.stdin.write(wav_bytes(plane_waves(10.0, 1.0), length=0))
        child.stdin.flush()
        child.stdout.readline()
        child.stdout.close()
        with contextlib.suppress(BrokenPipeError):
            child.stdin.write(b"\0" * 8 * RATE * 20)
        errors = child.stderr.read() if child.stderr else b""
    assert child.returncode == 1
    assert errors == b""
