"""Gathered spectra against transforms and correlations by other means."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import scipy.signal

from systems.hearing.cross_powers import (
    FINE,
    CrossPowers,
    FrameSpectra,
    cross_correlations,
    gather_frame,
    signal_powers,
)

RATE = 32_000.0
FACTS = FrameSpectra(2, 800, RATE, 8_000.0)
BAND = (200.0, 8_000.0)


def gathered(channels, facts=FACTS):
    """Of a long recording, (channels, n)."""
    sums = CrossPowers(
        np.zeros((len(facts.pairs), facts.bins), dtype=complex),
        np.zeros((facts.channels, facts.bins)),
        0.0,
    )
    frames = np.split(channels, channels.shape[1] // facts.samples, axis=1)
    for before, now in itertools.pairwise(frames):
        sums = gather_frame(facts, sums, before, now)
    return sums


def noise(seed, *shape):
    return np.random.default_rng(seed).standard_normal(shape)


def test_they_are_the_sums_of_welch():
    """Hann windows of two frames that overlap by one: scipy's csd, up to its scale."""
    channels = noise(1, 2, 20 * 800)
    sums = gathered(channels)
    settings = {"fs": RATE, "window": "hann", "nperseg": 1600, "noverlap": 800}
    f, cross = scipy.signal.csd(channels[1], channels[0], **settings)
    _, own = scipy.signal.welch(channels[0], **settings)
    # scipy gives one-sided densities.
    scale = RATE * np.sum(scipy.signal.get_window("hann", 1600) ** 2) / 2.0
    inner = slice(1, FACTS.bins)
    np.testing.assert_allclose(FACTS.frequencies_hz, f[: FACTS.bins])
    assert sums.frames == 19.0
    np.testing.assert_allclose(
        sums.pairs[0, inner] / sums.frames, scale * cross[inner], rtol=1e-9
    )
    np.testing.assert_allclose(
        sums.own[0, inner] / sums.frames, scale * own[inner], rtol=1e-9
    )


@pytest.mark.parametrize("delay", [-9.5, -3.25, 0.0, 4.0, 11.75])
def test_the_peak_stands_at_the_later_channels_delay(delay):
    """t_2 - t_1 is positive where channel 2 hears it later; delayed by its phase."""
    n = 40 * 800
    first = noise(2, n)
    phase = np.exp(-2j * np.pi * np.fft.rfftfreq(n) * delay)
    second = np.fft.irfft(np.fft.rfft(first) * phase, n)
    mean, occupied = signal_powers(
        FACTS, gathered(np.stack([first, second])), None, BAND
    )
    weighted = np.where(occupied, mean / np.abs(mean), 0.0)
    (correlation,) = cross_correlations(FACTS, weighted)
    at = int(correlation.argmax())
    found = (at if at < len(correlation) // 2 else at - len(correlation)) / FINE
    assert found == pytest.approx(delay, abs=0.13)
    # All bins of one place add up, each with that of the negative frequency.
    assert correlation.max() == pytest.approx(2.0 * occupied.sum(), rel=0.02)


def test_only_bins_of_the_sound_are_occupied():
    """A tone of 3 kHz in both, 20 dB below it noise that the channels do not share."""
    t = np.arange(40 * 800) / RATE
    channels = np.sin(2.0 * np.pi * 3_000.0 * t) + 0.05 * noise(3, 2, len(t))
    _, occupied = signal_powers(FACTS, gathered(channels), None, BAND)
    f = FACTS.frequencies_hz[occupied[0]]
    assert 3_000.0 in f
    assert np.mean(np.abs(f - 3_000.0) <= 40.0) > 0.5
    assert not occupied[:, FACTS.frequencies_hz < 200.0].any()


def test_steady_noise_that_both_hear_is_subtracted():
    """Delayed by 6 samples and 5 dB louder than the sound, which is delayed by -3."""
    n = 81 * 800
    fan, sound = 10.0 ** (5.0 / 20.0) * noise(4, 2 * n), noise(5, n)
    both = [np.stack([x, np.roll(x, shift)]) for x, shift in ((fan, 6), (sound, -3))]
    alone = gathered(both[0][:, n:])
    sums = gathered(both[0][:, :n] + both[1])
    found = []
    for subtracted in (None, alone):
        mean, _ = signal_powers(FACTS, sums, subtracted, BAND)
        (correlation,) = cross_correlations(FACTS, mean, 1)
        at = int(correlation.argmax())
        found.append(at if at < FACTS.samples else at - FACTS.length)
    assert found == [6, -3]
