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

from benchmarks.figures import Figure, print_figures, stay_on_one_core

__all__ = ["BROKEN", "REFUSALS", "start_figures"]

#: The fastest counts, since a machine only ever adds time.
REPEATS = 5
_PHONOTAXIS = (sys.executable, "-m", "phonotaxis")
#: Files that refusals are of, by name.
BROKEN = {
    "law.py": b"import no_such_module",
    "cut.wav": b"RIFF\0\0\0\0WAVE",
    "list.yaml": b"microphones: 3",
}
#: Bad input of every kind, of which nothing is loaded that simulates.
REFUSALS = (
    ("simulat",),
    ("simulate", "--laww", "none"),
    ("simulate", "two_static_obstacle"),
    ("simulate", "missing.yaml"),
    ("simulate", "--set", "room.reverberation_time=1", "--set", "seed=x"),
    ("simulate", "--law", "activ"),
    ("simulate", "--law", "missing.py:law"),
    ("simulate", "--sound", "missing.wav"),
    ("simulate", "--out", "/proc/out"),
    ("stability", "--law", "activ"),
    ("design", "--set", "robot.mass_kg=heavy"),
    ("compare", "no_such"),
    ("compare", "--laws", "activ"),
    ("compare", "--runs", "0"),
    ("sweep", "missing.yaml"),
    ("locate", "missing.wav"),
    ("calibrate", "missing.yaml"),
    ("listen", "missing.wav"),
    ("accuracy", "--seed", "x"),
    ("fields", "reverberatoin_time_s"),
    ("simulate", "--set", "tick_s=0.0333333"),
    ("simulate", "--set", "start.position_m=[1.9, 0]"),
    ("simulate", "--set", "room.size_m=[2, 2, 3]"),
    ("simulate", "u_trap", "--law", "guarded", "--set", "free_space.window_m=2"),
    ("simulate", "known_u", "--law", "active"),
    ("simulate", "--law", "law.py:law"),
    ("simulate", "--sound", "cut.wav"),
    ("simulate", "--set", "microphones.ego_noise_file=cut.wav"),
    ("design", "--set", "tick_s=0.0333333"),
    ("stability", "--robot", "second"),
    ("stability", "--law", "guarded"),
    ("stability", "--law", "law.py:law"),
    ("compare", "--set", "tick_s=0.0333333"),
    ("compare", "two_static_obstacles", "--grid", "tick_s=[0.025, 0.0333333]"),
    ("sweep", "list.yaml"),
    ("accuracy", "--trials", "1"),
    ("locate", "cut.wav"),
    ("locate", "cut.wav", "--geometry", "list.yaml"),
    ("listen", "cut.wav"),
    ("listen", "cut.wav", "--geometry", "list.yaml"),
    ("calibrate", "list.yaml"),
    ("export", "missing", "--csv"),
    ("columns", "nosuch"),
    ("simulate", "--movie", "film.avi"),
    ("simulate", "--movie", "missing/film.mp4"),
    ("simulate", "--save-audio", "."),
    ("simulate", "--save-audio", "ears", "--set", "hearing=ideal"),
    ("compare", "--resume"),
    ("compare", "--workers", "0"),
    ("compare", "--out", "."),
)


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
