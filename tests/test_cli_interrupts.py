"""Ctrl-C at any moment: exit status 1, one line, nothing left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import phonotaxis

ROOT = Path(phonotaxis.__file__).parents[1]
#: Says when ``main`` began to load: what is before, is Python's own start. A shell's
#: background job begins with Ctrl-C ignored, which would be inherited.
CODE = """
import signal
import sys
import phonotaxis
signal.signal(signal.SIGINT, signal.default_int_handler)
def loads(event, arguments):
    if event == "import" and arguments[0] == "phonotaxis.commands.interrupts":
        print("started", flush=True)
sys.addaudithook(loads)
sys.exit(phonotaxis.main())
"""


def started(folder: Path, *words: str) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", CODE, *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "started\n"
    return process


@pytest.mark.parametrize(
    ("kind", "after_s"),
    [
        *((signal.SIGINT, after_s) for after_s in (0.0, 0.2, 0.8, 1.6)),
        (signal.SIGTERM, 0.8),
    ],
)
def test_an_early_interrupt_is_one_line(tmp_path, kind, after_s):
    process = started(tmp_path, "simulate", "--set", "duration_s=2000", "--out", "run")
    time.sleep(after_s)
    process.send_signal(kind)
    printed, complaint = process.communicate(timeout=60)
    assert complaint == "phonotaxis: interrupted; nothing was written\n"
    assert (process.returncode, printed) == (1, "")
    assert list(tmp_path.iterdir()) == []
