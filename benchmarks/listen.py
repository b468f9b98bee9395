"""How late ``phonotaxis listen`` tells what it hears, from a pipe at real-time pace.

``taskset -c 0 python -m benchmarks.listen [SECONDS]`` pipes four channels of two
simulated talkers at 48 kHz, 10 ms at a time, each block when its last sample would have
been made; 60 s unless told. A line is late by the time from when the last block of its
sound was sent to when it can be read here: where the computer wakes this program late
to send, that is told apart. The memory is that of ``listen``, from Linux's /proc.

``python -m benchmarks.listen begins`` tells how long a voice sounds until its first
line: 36 simulated talkers at 16 kHz, T60 0.2 to 0.6 s.
"""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from analysis.arrays.voting.direction_votes import VotePlan
from analysis.arrays.voting.source_listener import (
    ListenerMemory,
    ListenerParameters,
    hear_sources,
)
from studies.support.talker_trials import TALKER_ARRAYS, draw_talkers, record_talkers
from systems.sound.array_shape import ArrayShape

RATE, BLOCK_S, LOOP_S = 48_000, 0.01, 10.0
ARRAY = "square, 4.6 cm"
# What is imported and compiled is done before the clock starts: the program then waits.
IDLE_S, WARM_SAMPLES = 2.0, 4
PARTS, SETTLED_S = 4, 30.0
# A voice begins where its power first is this share of its greatest one.
BEGIN_RATE, ONSET = 16_000, 1e-3


@dataclass
class Listened:
    """What the program told, and what it took."""

    t_s: list[float] = field(default_factory=list)
    """Of each line, in the sound, s."""
    late_s: list[float] = field(default_factory=list)
    """From the end of its sound to the line, s."""
    memory_mb: list[float] = field(default_factory=list)
    """Every ten seconds, once the program has settled."""
    woken_late_s: list[float] = field(default_factory=list)
    """Of each block, s."""
    blocked: int = 0
    """Blocks that the pipe did not take at once."""
    sent_s: float = 0.0
    core_s: float = 0.0
    """Time on a processor."""
    end: dict[str, Any] = field(default_factory=dict)
    """The last line."""


def main(seconds: float) -> None:
    """Prints what came of it.

    Args:
        seconds: How long to listen, s.
    """
    rng = np.random.default_rng(1)
    scene = draw_talkers(rng, 2, 90.0, t60_s=0.3)
    heard = record_talkers(
        scene, TALKER_ARRAYS[ARRAY], rng, seconds=LOOP_S, sample_rate_hz=RATE
    )
    samples = np.rint(heard.T * 2**15).astype("<i2")
    with tempfile.TemporaryDirectory() as folder:
        geometry = Path(folder) / "array.yaml"
        places = TALKER_ARRAYS[ARRAY].tolist()
        geometry.write_text(f"microphones: {places}\n", encoding="utf-8")
        told = pipe(samples, geometry, seconds)
    print(f"sent {told.sent_s:.6f} s, heard {told.end['seconds']:.6f} s")
    print(f"status: {told.end['status']}; faults: {told.end['faults']}")
    t_s, late = np.array(told.t_s), 1e3 * np.array(told.late_s)
    for part in range(PARTS):
        first, last = (seconds * (part + k) / PARTS for k in (0, 1))
        here = late[(t_s > first) & (t_s <= last)]
        print(
            f"{first:6.0f} to {last:6.0f} s: {here.size} lines, late by "
            f"{np.median(here):.0f} ms (median), {np.quantile(here, 0.99):.0f} (99 %), "
            f"{here.max():.0f} (most); {np.mean(here > 100.0):.2%} above 100 ms"
        )
    woken = 1e3 * np.array(told.woken_late_s)
    print(
        f"blocks sent late by {np.quantile(woken, 0.99):.0f} ms (99 %), "
        f"{woken.max():.0f} (most); {told.blocked} that the pipe did not take at once"
    )
    print(f"{100.0 * told.core_s / seconds:.1f} % of one core")
    if told.memory_mb:
        print(f"memory {told.memory_mb[0]:.0f} MB, {told.memory_mb[-1]:.0f} at the end")


def begins() -> None:
    """Prints how long voices sound before they are told."""
    waits = []
    for seed, t60_s in itertools.product(range(4), (0.2, 0.4, 0.6)):
        for places in TALKER_ARRAYS.values():
            rng = np.random.default_rng([seed, len(places)])
            scene = draw_talkers(rng, 1, 90.0, t60_s=t60_s)
            heard = record_talkers(
                scene, places, rng, seconds=3.0, sample_rate_hz=BEGIN_RATE
            )
            power = np.mean(heard**2, axis=0)
            onset = np.argmax(power > ONSET * power.max()) / BEGIN_RATE
            shape = ArrayShape.of(places)
            plan = VotePlan.of(
                shape, 340.0, BEGIN_RATE, band_hz=(200.0, 0.45 * BEGIN_RATE)
            )
            steps, _ = hear_sources(
                heard, ListenerMemory.blank(plan), plan, ListenerParameters()
            )
            told = [step.t_s for step in steps if step.tracks]
            waits.append(told[0] - onset if told else np.inf)
    print(
        f"{len(waits)} voices, told after {np.median(waits):.2f} s (median), "
        f"{np.quantile(waits, 0.9):.2f} (90 %), {max(waits):.2f} (most)"
    )


def pipe(samples: np.ndarray, geometry: Path, seconds: float) -> Listened:
    """Pipes sound at its own pace.

    Args:
        samples: (k, 4) counts, again and again.
        geometry: Of the array.
        seconds: How long, s.

    Returns:
        What came of it.
    """
    command = [sys.executable, "-m", "phonotaxis", "listen", "--json"]
    command += ["--geometry", str(geometry), "--rate", str(RATE), "--channels", "4"]
    told, begun = Listened(), [0.0]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdin is not None

        def read() -> None:
            for line in child.stdout or ():
                document = json.loads(line)
                now = time.monotonic() - begun[0]
                if "bearing_deg" in document:
                    last = round(document["t_s"] / BLOCK_S) - 1
                    woken = max(0.0, told.woken_late_s[last])
                    told.t_s.append(document["t_s"])
                    told.late_s.append(now - document["t_s"] - woken)
                told.end = document

        reader = threading.Thread(target=read)
        reader.start()
        child.stdin.write(samples[:1].tobytes() * WARM_SAMPLES)
        child.stdin.flush()
        warm = core_seconds(child.pid)
        time.sleep(2.0 * IDLE_S)
        while (now := core_seconds(child.pid)) > warm + 0.05:
            warm = now
            time.sleep(IDLE_S)
        begun[0] = time.monotonic() - WARM_SAMPLES / RATE
        warm, size = core_seconds(child.pid), round(BLOCK_S * RATE)
        sent, blocks = WARM_SAMPLES, round(seconds / BLOCK_S)
        for k in range(blocks):
            first = k * size % (len(samples) - size + 1)
            wait = begun[0] + (k + 1) * BLOCK_S - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            woken = time.monotonic()
            told.woken_late_s.append(woken - begun[0] - (k + 1) * BLOCK_S)
            child.stdin.write(samples[first : first + size].tobytes())
            child.stdin.flush()
            told.blocked += time.monotonic() - woken > BLOCK_S
            sent += size
            if k % round(10.0 / BLOCK_S) == 0 and k * BLOCK_S >= SETTLED_S:
                told.memory_mb.append(memory_mb(child.pid))
        told.core_s = core_seconds(child.pid) - warm
        child.stdin.close()
        reader.join()
    told.sent_s = sent / RATE
    return told


def core_seconds(pid: int) -> float:
    """Time that a process has had on a processor.

    Args:
        pid: Its number.

    Returns:
        s, in user and in system mode.
    """
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / 100.0


def memory_mb(pid: int) -> float:
    """Memory of a process that is its own and in use.

    Args:
        pid: Its number.

    Returns:
        MB.
    """
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024.0


if __name__ == "__main__":
    if sys.argv[1:] == ["begins"]:
        begins()
    else:
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
