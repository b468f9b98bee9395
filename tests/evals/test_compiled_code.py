"""Where, when and for which processor code is compiled changes no digit."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]

#: Sound on its way to the microphones, the frame's noise, and what is heard of it.
SCRIPT = """
import hashlib
import numpy as np
from systems.sound.array_shape import ArrayShape
from systems.hearing.localize import Localizer, TDOAParameters
from systems.framework.noise import frame_noise
from systems.sound.propagation import propagate
from systems.framework.signals import Emission

knots = 0.025 * np.arange(8.0) - 0.05
path = np.stack((2.0 + 0.3 * knots, 0.1 * knots), axis=1)
samples = np.random.default_rng(2).standard_normal(20_000).astype(np.float32)
speed = np.tile([0.3, 0.1], (8, 1))
emission = Emission(samples, -0.05, 1e5, knots, path, speed, 1.0, True)
places = [[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]]
times = np.tile(0.1 + np.linspace(0.0, 0.025, 11), (3, 1))
p_WM = np.tile(np.array(places)[:, None], (1, 11, 1))
heard = propagate(emission, times, p_WM, np.zeros((3, 11, 2)), 2500, 340.0)
frame = heard + np.float32(0.01) * frame_noise((3, 2500), 1, 2)
localizer = Localizer(TDOAParameters(), ArrayShape.of(places), 340.0)
fix, _ = localizer.localize(frame, localizer.blank())
digest = hashlib.sha256(heard.tobytes() + frame.tobytes())
digest.update(fix.p_AS.tobytes() + fix.covariance.tobytes())
print(digest.hexdigest())
"""


def test_no_sum_may_be_reordered():
    folders = ("systems", "diagrams", "analysis")
    files = (f for name in folders for f in (ROOT / name).rglob("*.py"))
    assert [str(f) for f in files if "fastmath=" in f.read_text("utf-8")] == []


def digest(**environment):
    return subprocess.run(
        [sys.executable, "-c", SCRIPT],
        check=True,
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
    ).stdout


@pytest.mark.long
def test_neither_compiling_nor_the_processor_changes_a_digit(tmp_path):
    """Compiled by this run or an earlier one; anew, for any processor; from there."""
    here = digest()
    plain = {
        "NUMBA_CACHE_DIR": str(tmp_path),
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CPU_FEATURES": "",
    }
    assert here == digest(**plain)
    assert any(tmp_path.rglob("*.nbc"))
    assert here == digest(**plain)
