"""The stretch that channels share: where it is cut, and its edges."""

from __future__ import annotations

import numpy as np
import pytest

from systems.delays.overlap import EDGE_SAMPLES, cut_to_overlap

ARRIVALS = np.array([0.0, 3.25, -1.75])


def test_channels_are_cut_where_the_sound_is_the_same():
    """Each counts from when the sound arrives: 0, 3 and -2 samples late."""
    frame = np.arange(100.0) - np.array([[0.0], [3.0], [-2.0]])
    cut = cut_to_overlap(frame.astype(np.float32), ARRIVALS)
    assert cut.shape == (3, 100 - 5)
    middle = slice(EDGE_SAMPLES, -EDGE_SAMPLES)
    expected = np.tile(np.arange(2.0, 97.0), (3, 1))
    np.testing.assert_array_equal(cut[:, middle], expected[:, middle])


def test_edges_follow_the_arrivals_below_the_sample():
    """Raised cosines, late by 0, a quarter and a quarter of a sample."""
    cut = cut_to_overlap(np.ones((3, 100), dtype=np.float32), ARRIVALS)
    k = np.arange(EDGE_SAMPLES)
    for row, late in zip(cut, (0.0, 0.25, 0.25), strict=True):
        for edge, way in ((row[:EDGE_SAMPLES], -late), (row[:-17:-1], late)):
            angle = np.pi * np.clip((k + 0.5 + way) / EDGE_SAMPLES, 0.0, 1.0)
            np.testing.assert_allclose(edge, np.sin(angle / 2.0) ** 2, atol=1e-6)
    np.testing.assert_array_equal(cut[:, EDGE_SAMPLES:-EDGE_SAMPLES], 1.0)


@pytest.mark.parametrize(("length", "soft"), [(31, False), (32, True)])
def test_a_stretch_shorter_than_two_edges_has_none(length, soft):
    cut = cut_to_overlap(np.ones((2, length), dtype=np.float32), np.zeros(2))
    assert (cut.min() < 0.5) == soft
