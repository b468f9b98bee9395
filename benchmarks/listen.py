"""How late ``phonotaxis listen`` tells what it hears, from a pipe at real-time pace.

``python -m benchmarks.listen [SECONDS]`` pipes four channels of a simulated talker at
48 kHz, 10 ms at a time, each block when its last sample would have been made; 60 s
unless told. A line is late by the time from then to when it can be read.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from analysis.talkers.talker_trials import TALKER_ARRAYS, draw_talkers, record_talkers

RATE, BLOCK_S, LOOP_S = 48_000, 0.01, 10.0
ARRAY = "square, 4.6 cm"


def main(seconds: float) -> None:
    """Prints a table.

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
        late, end = _pipe(samples, geometry, seconds)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    share = 100.0 * (spent.ru_utime + spent.ru_stime) / seconds
    print(
        f"listened {end['seconds']:.1f} of {seconds:g} s, {len(late)} lines; late by "
        f"{1e3 * np.median(late):.0f} ms (median), {1e3 * np.quantile(late, 0.99):.0f} "
        f"(99 %), {1e3 * np.max(late):.0f} (most); {share:.1f} % of one core"
    )


def _pipe(
    samples: np.ndarray, geometry: Path, seconds: float
) -> tuple[np.ndarray, dict]:
    command = [sys.executable, "-m", "phonotaxis", "listen", "--json"]
    command += ["--geometry", str(geometry), "--rate", str(RATE), "--channels", "4"]
    late, lines, begun = [], [], []
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=False
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None

        def read() -> None:
            for line in child.stdout or ():
                document = json.loads(line)
                lines.append(document)
                if "t_s" in document:
                    late.append(time.monotonic() - begun[0] - document["t_s"])

        reader = threading.Thread(target=read)
        reader.start()
        size = round(BLOCK_S * RATE)
        # What is compiled and imported is done before the clock starts.
        child.stdin.write(samples[:1].tobytes() * 4)
        child.stdin.flush()
        time.sleep(5.0)
        begun.append(time.monotonic() - 4.0 / RATE)
        for k in range(round(seconds / BLOCK_S)):
            first = k * size % (len(samples) - size)
            wait = begun[0] + (k + 1) * BLOCK_S - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            child.stdin.write(samples[first : first + size].tobytes())
            child.stdin.flush()
        child.stdin.close()
        reader.join()
    return np.array(late), lines[-1]


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
