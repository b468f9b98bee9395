"""The first wave front stays, its echoes go, and delays are what they were."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.random import Generator, Philox

from systems.delays.precedence import EchoMemory, keep_first_wave_front

FS, N = 100_000.0, 2500
SIZES = EchoMemory(3, FS)
CLICK, ECHO_MS = 300, 20.0
ECHO = CLICK + round(ECHO_MS * FS / 1e3)


def click(length=N, seed=0):
    """A burst of 1 ms of noise at the start."""
    sound = np.zeros(length)
    shape = np.hanning(round(1e-3 * FS))
    sound[: len(shape)] = shape * Generator(Philox(key=seed)).standard_normal(
        len(shape)
    )
    return sound


def at(sample, length=N):
    return np.roll(click(length), sample)


def frame(row):
    return np.tile(row, (3, 1)).astype(np.float32)


def energy(row, begin):
    """Of 1.5 ms about a click."""
    return float(np.sum(row[begin - 25 : begin + 125].astype(float) ** 2))


def test_a_click_stays_and_its_echo_goes():
    """20 ms later and 6 dB below: what is heard of it falls from 25 % to 1 %."""
    rows = frame(at(CLICK) + 0.5 * at(ECHO))
    assert energy(rows[0], ECHO) == pytest.approx(0.25 * energy(rows[0], CLICK))
    dry, _, _ = keep_first_wave_front(rows, None, SIZES)
    for row in dry:
        assert energy(row, ECHO) < 0.01 * energy(row, CLICK)


def test_an_echo_in_the_next_frame_goes_too():
    first, second = frame(at(CLICK)), frame(0.5 * at(ECHO - N + 500))
    _, memory, _ = keep_first_wave_front(first, None, SIZES)
    dry, _, news = keep_first_wave_front(second, memory, SIZES)
    unwarned, _, all_news = keep_first_wave_front(second, None, SIZES)
    assert np.sum(dry**2) < 0.05 * np.sum(unwarned**2)
    assert news < 0.05 < all_news


def test_a_louder_sound_is_no_echo():
    rows = frame(at(CLICK) + 3.0 * at(ECHO))
    dry, _, _ = keep_first_wave_front(rows, None, SIZES)
    assert energy(dry[0], ECHO) > 0.5 * energy(dry[0], CLICK)


@given(st.lists(st.floats(0.0, 110.0), min_size=3, max_size=3))
def test_one_wave_front_keeps_its_delays(delays):
    """Fractional delays of a burst, measured by the phase of the cross-spectrum."""
    f = np.fft.rfftfreq(N)
    spectrum = np.fft.rfft(at(CLICK))
    spectrum[f * FS > 10_000] = 0.0
    turns = np.exp(-2j * np.pi * np.outer(delays, f))
    rows = np.fft.irfft(spectrum * turns, N).astype(np.float32)
    dry, _, _ = keep_first_wave_front(rows, None, SIZES)
    band = (f * FS > 500) & (f * FS < 8_000)
    after = np.fft.rfft(dry.astype(float))
    for k in (1, 2):
        lag = delays[k] - delays[0]
        cross = after[k] * after[0].conj() * np.exp(2j * np.pi * f * lag)
        weight = np.abs(cross[band])
        slope = np.sum(weight * f[band] * np.angle(cross[band]))
        slope /= 2.0 * np.pi * np.sum(weight * f[band] ** 2)
        assert abs(slope) < 0.1  # samples; 0.34 mm


@pytest.mark.parametrize("channels", [3, 4, 8])
def test_channels_do_not_touch_each_other(channels):
    rows = Generator(Philox(key=1)).standard_normal((channels, N)).astype(np.float32)
    sizes = EchoMemory(channels, FS)
    dry, memory, _ = keep_first_wave_front(rows, None, sizes)
    alone = EchoMemory(1, FS)
    for k in range(channels):
        single, its_memory, _ = keep_first_wave_front(rows[k : k + 1], None, alone)
        np.testing.assert_allclose(dry[k], single[0], atol=1e-6)
        np.testing.assert_allclose(memory[k], its_memory[0], rtol=1e-6)


def test_what_the_noise_drowns_need_not_be_remembered():
    """Nothing, and a memory at the level below which noise is no news."""
    rows = Generator(Philox(key=4)).standard_normal((3, N)).astype(np.float32)
    drowned = np.full(SIZES.shape, SIZES.least(0.01), dtype=np.float32)
    of_it = keep_first_wave_front(rows, drowned, SIZES, 0.01)
    of_nothing = keep_first_wave_front(rows, None, SIZES, 0.01)
    for one, other in zip(of_it, of_nothing, strict=True):
        np.testing.assert_array_equal(one, other)
    louder, _, _ = keep_first_wave_front(rows, 2.0 * drowned, SIZES, 0.01)
    assert not np.array_equal(louder, of_nothing[0])


def test_memory_fades_by_60_db_in_0_69_seconds():
    """Power that falls as exp(-t / 50 ms): 60 dB in ln(1e6) * 50 ms."""
    whole = np.ones(SIZES.shape, dtype=np.float32)
    samples = math.log(1e6) * 0.05 * FS
    assert SIZES.faded(whole, round(samples))[0, 0] == pytest.approx(1e-6, rel=1e-3)


def test_a_frame_of_silence_fades_the_memory_as_long_as_it_lasts():
    rows = Generator(Philox(key=2)).standard_normal((3, N)).astype(np.float32)
    _, memory, _ = keep_first_wave_front(rows, None, SIZES)
    dry, after, _ = keep_first_wave_front(0.0 * rows, memory, SIZES)
    np.testing.assert_array_equal(dry, 0.0)
    np.testing.assert_allclose(after, memory * math.exp(-0.025 / 0.05), rtol=1e-4)


@given(st.integers(0, 100), st.floats(1e-3, 1e3))
def test_level_does_not_matter(seed, gain):
    """The memory is a power; what comes out is white whatever goes in."""
    rows = Generator(Philox(key=seed)).standard_normal((2, 3, N)).astype(np.float32)
    _, memory, _ = keep_first_wave_front(rows[0], None, SIZES)
    dry, after, news = keep_first_wave_front(rows[1], memory, SIZES)
    loud = np.float32(gain)
    again, louder, same = keep_first_wave_front(loud * rows[1], loud**2 * memory, SIZES)
    np.testing.assert_allclose(again, dry, atol=1e-4 * np.abs(dry).max())
    np.testing.assert_allclose(louder, loud**2 * after, rtol=1e-3)
    assert same == pytest.approx(news, abs=1e-5)
    assert 0.0 <= news <= 1.0


def test_little_of_noise_is_news_once_its_level_is_known():
    """Powers of noise are exponential: exp(-4) of the energy is beyond four times
    the mean; without the level all that rises is news."""
    noise = np.random.default_rng(4).standard_normal((3, N)).astype(np.float32)
    _, _, unaware = keep_first_wave_front(noise, None, SIZES)
    dry, _, news = keep_first_wave_front(noise, None, SIZES, 1.0)
    assert 0.0 < news < 1.2 * math.exp(-4.0)
    assert unaware > 5.0 * news
    assert np.isfinite(dry).all()


def test_a_click_in_noise_is_as_it_was_and_the_noise_is_gone():
    noise = np.random.default_rng(4).standard_normal(N) * 0.01
    clean, *_ = keep_first_wave_front(frame(at(CLICK)), None, SIZES)
    noisy, *_ = keep_first_wave_front(frame(at(CLICK) + noise), None, SIZES, 0.01**2)
    assert energy(noisy[0], CLICK) == pytest.approx(energy(clean[0], CLICK), rel=0.2)
    assert energy(noisy[0], ECHO) < 0.02 * energy(noisy[0], CLICK)


def test_the_taper_is_even_and_its_square_adds_up():
    """Over four hops to 1: half of sin^2 has mean 1/4."""
    sizes = EchoMemory(3, 50_000.0)
    np.testing.assert_allclose(sizes.taper, sizes.taper[::-1], atol=1e-6)
    hops = sizes.taper.reshape(4, sizes.hop)
    np.testing.assert_allclose(np.sum(hops**2, axis=0), 1.0, rtol=1e-5)
