"""Plane waves of known directions, above where neighbors' phases wrap as well."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.voting.single_waves import PhasePlane
from studies.support.talker_trials import TALKER_ARRAYS
from systems.sound.array_shape import ArrayShape

C = 343.0


@pytest.mark.parametrize("array", TALKER_ARRAYS)
@pytest.mark.parametrize("above", [False, True])
def test_waves_that_are_told_have_their_directions(array, above):
    shape = ArrayShape.of(TALKER_ARRAYS[array])
    plane = PhasePlane.of(shape, C)
    rng = np.random.default_rng(5)
    ends = (plane.wraps_hz, plane.highest_hz) if above else (400.0, plane.wraps_hz)
    frequency = np.sort(rng.uniform(*ends, 300))
    azimuth, elevation = rng.uniform(-np.pi, np.pi, 300), rng.uniform(0.0, 0.9, 300)
    level = np.cos(elevation)
    u = np.stack(
        (level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)), axis=1
    )
    pattern = np.exp(2j * np.pi * frequency[:, None] / C * (u @ shape.p_AM.T))
    fits = plane.fit(pattern, frequency)
    # Above, directions on the other side fit nearly as well where few pairs differ.
    assert fits.fits.mean() > (0.15 if above else 0.99)
    off = np.angle(np.exp(1j * (fits.azimuth - azimuth[fits.fits])))
    assert np.abs(off).max() < 1e-6
    assert fits.elevation == pytest.approx(elevation[fits.fits], abs=1e-6)
