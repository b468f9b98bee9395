"""How soon the command line answers: lists, refusals, the first words of a run.

``python -m benchmarks.start`` prints these figures alone, with the time of
``python -c pass`` to set them against.
"""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from studies.support.figures import Figure, print_figures, stay_on_one_core
from tests.refusals import BROKEN, REFUSALS

#: The fastest counts, since a machine only ever adds time.
REPEATS = 5
_PHONOTAXIS = (sys.executable, "-m", "phonotaxis")


def start_figures() -> list[Figure]:
    """Wall times of whole processes, s."""
    with TemporaryDirectory() as folder:
        for name, content in BROKEN.items():
            Path(folder, name).write_bytes(content)
        python = _seconds((sys.executable, "-c", "pass"), folder)

        def seconds(*words: str) -> float:
            return _seconds((*_PHONOTAXIS, *words), folder)

        scenarios = seconds("scenarios")
        return [
            Figure("scenarios, s", scenarios, "<=", 0.5),
            Figure("the same, times python -c pass", scenarios / python, "<=", 12.0),
            Figure("fields, s", seconds("fields"), "<=", 0.5),
            Figure("laws, s", seconds("laws"), "<=", 0.5),
            Figure(
                "slowest refusal, s",
                max(seconds(*words) for words in REFUSALS),
                "<=",
                0.5,
            ),
            Figure("first words of a run, s", _first_words(folder), "<=", 1.0),
        ]


def _seconds(words: Sequence[str], folder: str) -> float:
    times = []
    for _ in range(REPEATS):
        start = perf_counter()
        subprocess.run(
            words, cwd=folder, env=_environment(), capture_output=True, check=False
        )
        times.append(perf_counter() - start)
    return min(times)


def _first_words(folder: str) -> float:
    """Time until a terminal shows them, s."""
    times = []
    for _ in range(REPEATS):
        terminal, other_end = pty.openpty()
        start = perf_counter()
        with subprocess.Popen(
            (*_PHONOTAXIS, "simulate"),
            cwd=folder,
            env=_environment(),
            stderr=other_end,
            stdout=subprocess.DEVNULL,
        ) as process:
            shown = os.read(terminal, 100)
            times.append(perf_counter() - start)
            process.terminate()
        os.close(terminal)
        os.close(other_end)
        if b"simulating default" not in shown:
            raise RuntimeError(f"the run began with {shown!r}")
    return min(times)


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}


if __name__ == "__main__":
    stay_on_one_core()
    sys.exit(print_figures(start_figures()))
