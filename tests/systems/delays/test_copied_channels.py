"""Copies of channels, and microphones that hear alike without being copies."""

from __future__ import annotations

import numpy as np
import pytest

from systems.delays.copied_channels import copied_pairs, frame_repeats, repeats

RATE = 16_000
NO_FAULT: list[tuple[int, int]] = []


def rounded(samples):
    """In steps of 16 bits."""
    return np.rint(samples * 2.0**15) / 2.0**15


def recorded(snr_db, seed=0, seconds=3.0):
    """(3, n) one sound with pauses at three microphones as far away, noise in each."""
    rng = np.random.default_rng(seed)
    count = round(seconds * RATE)
    sound = 0.1 * rng.standard_normal(count) * (np.arange(count) % RATE < 0.6 * RATE)
    noise = 0.1 * 10.0 ** (-snr_db / 20.0) * rng.standard_normal((3, count))
    return rounded(sound + noise)


@pytest.mark.parametrize("snr_db", [10.0, 20.0, 30.0, 40.0])
def test_microphones_as_far_from_the_source_are_no_copies(snr_db):
    for seed in range(5):
        assert copied_pairs(recorded(snr_db, seed), RATE) == NO_FAULT


@pytest.mark.parametrize("gain", [1.0, 0.7, -0.3, 2.5])
@pytest.mark.parametrize("shift", [0, 1, 37, -200])
def test_copies_with_gain_and_delay(gain, shift):
    samples = recorded(20.0)
    samples[2] = rounded(gain * np.roll(samples[0], shift))
    assert copied_pairs(samples, RATE) == [(0, 2)]


def test_two_inputs_of_one_microphone():
    """The converters' noise is 30 dB below that of the microphone."""
    samples = recorded(35.0)
    microphone_noise = 0.1 * 10.0 ** (-35.0 / 20.0)
    rng = np.random.default_rng(9)
    converter = 10.0 ** (-30.0 / 20.0) * microphone_noise
    samples[1] = samples[2] + converter * rng.standard_normal(samples.shape[1])
    assert copied_pairs(samples, RATE) == [(1, 2)]


def test_short_and_silent_stretches_are_no_copies():
    samples = recorded(20.0)
    assert copied_pairs(samples[:, :100], RATE) == NO_FAULT
    samples[:, :RATE] = 0.0
    assert copied_pairs(samples, RATE) == NO_FAULT


def test_repeats_up_to_rounding():
    """Rounding to whole counts has a variance of a twelfth; noise of one, of one."""
    rng = np.random.default_rng(4)
    first = np.rint(100.0 * rng.standard_normal(2_000)).astype(np.int16)
    second = np.rint(0.6 * np.roll(first, 7) + 25.0).astype(np.int16)
    assert repeats(first, second, 7, 1.0)
    assert not repeats(first, second, 6, 1.0)
    noisy = np.rint(0.6 * np.roll(first, 7) + rng.standard_normal(2_000))
    assert not repeats(first, noisy.astype(np.int16), 7, 1.0)
    # What holds hardly a count of its own copies nothing.
    assert not repeats(first, (second * 0.01).astype(np.int16), 7, 1.0)
    assert not repeats(0 * first, second, 0, 1.0)


def test_frame_of_which_equal_channels_may_be_so():
    rng = np.random.default_rng(5)
    frame = np.rint(100.0 * rng.standard_normal((3, 2_500))).astype(np.int16)
    frame[2] = frame[0]
    pairs = np.array([[0, 1], [0, 2], [1, 2]])
    everywhere = np.ones(3, dtype=bool)
    assert frame_repeats(frame, pairs, np.array([11.0, -4.0]), everywhere, noisy=True)
    assert not frame_repeats(
        frame, pairs, np.array([11.0, -4.0]), np.array([True, False, True]), noisy=True
    )
    frame[2] = np.roll(frame[1], 15)
    # Channel 1 is 11 samples later than channel 0, and channel 2 is 26.
    assert frame_repeats(frame, pairs, np.array([11.2, 25.8]), everywhere, noisy=True)
    assert not frame_repeats(
        frame, pairs, np.array([11.0, 25.0]), everywhere, noisy=True
    )


def test_sound_without_pauses_tells_no_inputs_apart():
    """At 40 dB two microphones as far away differ by 2e-4 of the sound's power."""
    rng = np.random.default_rng(3)
    sound = 0.1 * rng.standard_normal(3 * RATE)
    samples = rounded(sound + 1e-3 * rng.standard_normal((3, sound.size)))
    assert copied_pairs(samples, RATE) == NO_FAULT


@pytest.mark.parametrize(("own", "found"), [(0.01, [(1, 2)]), (0.1, NO_FAULT)])
def test_what_differs_while_it_sounds_is_no_copy(own, found):
    """Pauses hold one hum alike; the sound a share of 2 own^2 that differs."""
    rng = np.random.default_rng(8)
    count = 3 * RATE
    loud = np.arange(count) % RATE < 0.6 * RATE
    hum = 1e-3 * rng.standard_normal(count)
    each = 1.0 + own * rng.standard_normal((3, count))
    each[0] = 0.0
    samples = hum + 0.1 * loud * each * rng.standard_normal(count)
    samples += 1e-5 * rng.standard_normal((3, count))
    samples[0] = recorded(20.0)[0]
    assert copied_pairs(rounded(samples), RATE) == found
