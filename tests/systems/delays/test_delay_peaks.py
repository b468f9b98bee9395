"""Weights of the phase transform; the peaks themselves are in test_delays.py."""

from __future__ import annotations

import numpy as np

from systems.delays.correlations import whitening


def test_weights_level_the_bins_down_to_a_tenth_of_their_mean():
    """s w = s / (s + m / 10), m the mean size: a half at a tenth of it."""
    cross = np.array([[0.1, 1.0j, -1.9], [0.0, 0.0, 0.0]], dtype=np.complex64)
    level = np.abs(cross) * whitening(cross)
    np.testing.assert_allclose(level[0], [0.5, 1.0 / 1.1, 1.9 / 2.0], rtol=1e-6)
    np.testing.assert_array_equal(level[1], 0.0)
