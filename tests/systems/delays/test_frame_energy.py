"""Energy of a frame, with the share that slow noise keeps."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.random import Generator, Philox

from systems.delays.frame_energy import BLOCK_SAMPLES, frame_energy

FS = 100_000.0


def test_white_noise_keeps_all_but_the_blocks_means():
    frame = Generator(Philox(1)).standard_normal((3, 40 * BLOCK_SAMPLES), np.float32)
    blocks = frame.astype(float).reshape(3, 40, BLOCK_SAMPLES)
    expected = np.sum(np.var(blocks, axis=2)) * BLOCK_SAMPLES
    assert frame_energy(frame) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("hertz", "least_db", "most_db"),
    [
        (100.0, -19.2, -18.2),  # (w T)^2 / 12 for a slope across a block of T
        (4000.0, -0.1, 0.1),
    ],
)
def test_slow_tones_hardly_count(hertz, least_db, most_db):
    t = np.arange(2500) / FS
    tone = np.sin(2.0 * np.pi * hertz * t).astype(np.float32)[np.newaxis]
    share_db = 10.0 * np.log10(frame_energy(tone) / np.vdot(tone, tone))
    assert least_db < share_db < most_db


def test_what_is_not_a_number_shows():
    frame = np.zeros((3, 2500), dtype=np.float32)
    frame[2, 2499] = np.nan
    assert np.isnan(frame_energy(frame))
