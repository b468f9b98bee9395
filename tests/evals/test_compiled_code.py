"""The run that compiles and the runs that find the code compiled agree."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

#: Sound on its way to the microphones, the frame's noise, and what is heard of it:
#: whatever may be compiled to reorder its sums.
SCRIPT = """
import hashlib
import numpy as np
from systems.sound.array_shape import ArrayShape
from systems.hearing.localise import Localiser, TDOAParameters
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
localiser = Localiser(TDOAParameters(), ArrayShape.of(places), 340.0)
fix, _ = localiser.localise(frame, localiser.blank())
digest = hashlib.sha256(heard.tobytes() + frame.tobytes())
digest.update(fix.p_AS.tobytes() + fix.covariance.tobytes())
print(digest.hexdigest())
"""


def test_compiling_changes_no_digit(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    first, second = (
        subprocess.run(
            [sys.executable, "-c", SCRIPT],
            check=True,
            cwd=Path(__file__).parents[2],
            env=environment,
            capture_output=True,
            text=True,
        ).stdout
        for _ in range(2)
    )
    assert any(tmp_path.rglob("*.nbc"))
    assert first == second
