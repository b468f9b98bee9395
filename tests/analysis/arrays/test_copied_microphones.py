"""Channels that are equal by symmetry, and channels that are copies."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.copied_microphones import copied_microphones

RATE, C = 16_000, 343.0
NO_FAULT: list[tuple[int, int]] = []


def ring(count, diameter):
    turn = 2.0 * np.pi * np.arange(count) / count
    return 0.5 * diameter * np.stack((np.cos(turn), np.sin(turn)), axis=1)


SQUARE = 0.02285 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1.0]])
CIRCLE, TRIANGLE = ring(6, 0.093), ring(3, 0.115)
ROW = np.array([[0.0, 0.0], [0.2, 0.0], [0.4, 0.0]])


def plane_wave(places, bearing_deg, snr_db=np.inf, seed=1):
    """(n, 1 s) exact delays of noise up to 7 kHz, after a rest without any sound."""
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(RATE, 1.0 / RATE)
    spectrum = np.fft.rfft(rng.standard_normal(RATE)) * (f > 100.0) * (f < 7_000.0)
    turn = np.radians(bearing_deg)
    later = -(places @ [np.cos(turn), np.sin(turn)]) / C
    heard = np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * later[:, np.newaxis]))
    return heard + heard.std() * 10.0 ** (-snr_db / 20.0) * rng.standard_normal(
        heard.shape
    )


def found(samples, places):
    return copied_microphones(samples, RATE, places, C)


@pytest.mark.parametrize(
    ("places", "bearings"),
    [
        (SQUARE, (0, 45, 90, 135, 180, -90)),
        (CIRCLE, (0, 30, 60, 90, 180)),
        (TRIANGLE, (0, 60, 180, -60)),
    ],
)
def test_equal_channels_without_noise_are_no_fault(places, bearings):
    for bearing in bearings:
        assert found(plane_wave(places, bearing), places) == NO_FAULT


def test_whole_samples_of_delay_along_a_row_are_no_fault():
    one = plane_wave(ROW, 0.0)[0]
    assert found(np.array([np.roll(one, 7 * k) for k in range(3)]), ROW) == NO_FAULT
    # 13 samples are longer than sound takes for 0.2 m.
    rolled = np.array([np.roll(one, 13 * k) for k in range(3)])
    assert found(rolled, ROW) == [(0, 1), (0, 2), (1, 2)]


@pytest.mark.parametrize("snr_db", [20.0, 40.0, np.inf])
def test_copies_that_no_source_explains(snr_db):
    samples = plane_wave(SQUARE, 20.0, snr_db)
    samples[1] = samples[0]
    assert found(samples, SQUARE) == [(0, 1)]


@pytest.mark.parametrize("places", [SQUARE, CIRCLE, TRIANGLE])
def test_noise_reveals_copies_even_on_a_plane_of_symmetry(places):
    samples = plane_wave(places, 60.0, 25.0)
    samples[1] = samples[0]
    assert found(samples, places) == [(0, 1)]


def test_the_other_pair_of_the_same_plane_is_not_equal():
    """The noise of channels 3 and 4 is so faint that only their difference shows it."""
    samples = plane_wave(SQUARE, 90.0, 50.0)
    samples[1] = samples[0]
    assert found(samples, SQUARE) == [(0, 1)]


def test_one_signal_in_all_channels_is_a_copy():
    one = plane_wave(ROW, 0.0)[0]
    assert len(found(np.array([one, one, one]), ROW)) == 3
    assert found(np.array([one, one]), ROW[:2]) == [(0, 1)]
