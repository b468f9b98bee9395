"""The most likely place: against the bound, against brute force, and its errors."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from scipy.optimize import minimize

from systems.hearing.coherent import arrival_delays, refine_source
from systems.hearing.multilateration import locate_source
from systems.sound.array_shape import ArrayShape

FS, N, C = 100_000.0, 2500, 340.0
BAND = (500.0, 8000.0)
ROW = ArrayShape.of([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
FIVE = ArrayShape.of([[0.2, 0.3], [0.3, -0.1], [-0.1, -0.3], [-0.3, 0.1], [0.0, 0.05]])
SPACE = ArrayShape.of(
    [[0.2, 0.2, 0.2], [0.2, -0.2, -0.2], [-0.2, 0.2, -0.2], [-0.2, -0.2, 0.2]]
)


def place(bearing_deg, distance):
    angle = math.radians(bearing_deg)
    return distance * np.array([math.cos(angle), math.sin(angle)])


class Sound:
    """Periodic noise of the band, of RMS 1, known between its samples."""

    def __init__(self, seed, period=8192):
        generator = np.random.default_rng(seed)
        f = np.fft.rfftfreq(period, 1 / FS)
        z = generator.standard_normal((2, f.size))
        self.lines = (z[0] + 1j * z[1]) * ((f >= BAND[0]) & (f <= BAND[1]))
        self.omega = 2 * np.pi * f
        self.period = period
        self.lines /= np.sqrt(2 * np.sum(np.abs(self.lines) ** 2)) / period

    def at(self, delay, count=N):
        """Samples from `delay` s before the sound's time 0.01 s on."""
        turned = self.lines * np.exp(1j * self.omega * (0.01 - delay))
        return np.fft.irfft(turned, self.period)[:count]

    def slope_power(self):
        """Mean square of its slope, 1/s^2."""
        return 2 * np.sum(self.omega**2 * np.abs(self.lines) ** 2) / self.period**2


def frame_of(sound, shape, p_AS, snr_db, generator=None, gains=1.0):
    """(n, N) frame whose SNR at 1 m of range from a microphone is that over R^2."""
    ranges = np.linalg.norm(shape.p_AM - p_AS, axis=1)
    distance = np.linalg.norm(p_AS)
    rows = np.array([sound.at(r / C) * distance / r for r in ranges])
    if generator is not None:
        noise = generator.standard_normal(rows.shape)
        rows = rows + 10 ** (-snr_db / 20) * noise
    return (np.reshape(gains, (-1, 1)) * rows).astype(np.float32)


def start_at(shape, p_AS, error=2e-6):
    """A first fix whose delays are wrong by a fifth of a sample."""
    generator = np.random.default_rng(1)
    ranges = np.linalg.norm(shape.p_AM - p_AS, axis=1)
    tau = (ranges[1:] - ranges[0]) / C
    tau = tau + error * generator.uniform(-1, 1, tau.size)
    covariance = 1e-16 * (np.eye(tau.size) + 1.0)
    return locate_source(tau, covariance, shape, C)


def refined(frame, shape, start):
    fix = refine_source(frame, start, shape, C, sample_rate_hz=FS, band_hz=BAND)
    assert fix is not None
    return fix


def bound(sound, shape, p_AS, snr_db, samples):
    """Covariance of the position: unknown waveform, known gains of 1/R."""
    rays = p_AS - shape.p_AM
    ranges = np.linalg.norm(rays, axis=1)
    g = (np.linalg.norm(p_AS) / ranges) ** 2 * 10 ** (snr_db / 10)
    information = (
        samples * sound.slope_power() * (np.diag(g) - np.outer(g, g) / g.sum())
    )
    to_times = rays / ranges[:, None] / C
    return np.linalg.inv(to_times.T @ information @ to_times)


@pytest.mark.parametrize(
    ("shape", "p_AS", "snr_db"),
    [
        (ROW, place(0, 2.0), 20.0),
        (ROW, place(30, 4.0), 30.0),
        (ROW, place(60, 1.0), 20.0),
        (ROW, place(-60, 3.0), 30.0),
        (FIVE, place(130, 2.0), 20.0),
        (SPACE, np.array([-0.9, 0.8, 0.6]), 20.0),
    ],
)
def test_errors_are_at_the_bound_and_as_stated(shape, p_AS, snr_db):
    generator = np.random.default_rng(7)
    start = start_at(shape, p_AS)
    # The sound's levels differ from frame to frame: each has its own bound.
    to_bound, to_stated, bias = [], [], []
    ranges = np.linalg.norm(shape.p_AM - p_AS, axis=1)
    common = N - np.ptp(np.rint(ranges / C * FS))
    trials = 75
    for trial in range(trials):
        sound = Sound(trial)
        fix = refined(frame_of(sound, shape, p_AS, snr_db, generator), shape, start)
        error = fix.p_AS - p_AS
        least = bound(sound, shape, p_AS, snr_db, common)
        to_bound.append(error @ np.linalg.solve(least, error))
        to_stated.append(error @ np.linalg.solve(fix.covariance, error))
        bias.append(np.linalg.solve(np.linalg.cholesky(least), error))
    k = p_AS.size
    margin = 3.0 * math.sqrt(2.0 * k / trials)
    assert k - margin < np.mean(to_bound) < k * 1.1 + margin
    assert k - margin < np.mean(to_stated) < k + margin
    assert np.abs(np.mean(bias, axis=0)).max() < 4.0 / math.sqrt(trials)


@pytest.mark.parametrize("snr_db", [0.0, 6.0])
def test_stated_errors_hold_in_much_noise(snr_db):
    """There noise meets noise, too, and whole samples are far off."""
    p_AS = place(20, 1.0)
    generator = np.random.default_rng(9)
    start = start_at(ROW, p_AS, error=0.0)
    squares = []
    for trial in range(150):
        frame = frame_of(Sound(trial), ROW, p_AS, snr_db, generator)
        fix = refined(frame, ROW, start)
        t = (arrival_delays(fix, ROW, C) - arrival_delays(start, ROW, C)) * C
        rays = p_AS - ROW.p_AM
        J = rays / np.linalg.norm(rays, axis=1)[:, None]
        J = J[1:] - J[0]
        squares.append(t @ np.linalg.solve(J @ fix.covariance @ J.T, t))
    assert np.mean(squares) == pytest.approx(2.0, abs=3.0 * math.sqrt(4.0 / 150))


@pytest.mark.parametrize(
    ("shape", "p_AS"), [(ROW, place(40, 1.5)), (FIVE, place(-100, 1.2)),
                        (SPACE, np.array([0.7, 0.9, 0.5]))],
)  # fmt: skip
def test_is_the_maximum_of_the_likelihood(shape, p_AS):
    """Brute force on whole frames: a burst that begins and ends within all."""
    generator = np.random.default_rng(11)
    sound = Sound(3)
    spectrum = np.fft.rfft(sound.at(0.0, 4096) * np.hanning(4096))
    f = np.fft.rfftfreq(4096, 1 / FS)
    ranges = np.linalg.norm(shape.p_AM - p_AS, axis=1)
    shifts = np.exp(-2j * np.pi * f * ranges[:, None] / C) / ranges[:, None]
    whole = np.fft.irfft(spectrum * shifts, 4096)
    noise = np.fft.rfft(0.05 * generator.standard_normal(whole.shape))
    inside = (f >= BAND[0]) & (f <= BAND[1])
    # The noise ends at the band's edges too: what happens there is not the point.
    frame = np.fft.irfft(np.fft.rfft(whole) + noise * inside, 4096)
    fix = refined(frame.astype(np.float32), shape, start_at(shape, p_AS))
    X = np.fft.rfft(frame)[:, inside]

    def minus_likelihood(x):
        R = np.linalg.norm(shape.p_AM - x, axis=1)
        a = 1.0 / R
        Y = np.sum(a[:, None] * X * np.exp(2j * np.pi * f[inside] * R[:, None] / C), 0)
        return -np.sum(np.abs(Y) ** 2) / np.sum(a**2) / np.sum(np.abs(X) ** 2)

    best = minimize(
        minus_likelihood, p_AS, method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-15, "maxiter": 2000},
    )  # fmt: skip
    off = fix.p_AS - best.x
    # A frame's noise at its edges, which the cut takes away, is a tenth of it.
    assert off @ np.linalg.solve(fix.covariance, off) < 0.15**2 * p_AS.size
    error = best.x - p_AS
    assert error @ np.linalg.solve(fix.covariance, error) < 16.0


def test_half_a_sample_pulls_nothing():
    """Without noise, wherever the delays lie between the samples."""
    sound = Sound(5)
    for distance in np.linspace(2.0, 2.05, 12):
        p_AS = place(25, distance)
        fix = refined(frame_of(sound, ROW, p_AS, 99.0), ROW, start_at(ROW, p_AS))
        least = np.sqrt(np.diag(bound(sound, ROW, p_AS, 40.0, N)))
        assert np.all(np.abs(fix.p_AS - p_AS) < 0.2 * least)


def test_gains_of_one_decibel_cost_nothing():
    """They would, if 1/R told of the place or if the residual were all noise."""
    p_AS = place(15, 2.0)
    clean = frame_of(Sound(1), ROW, p_AS, 30.0, np.random.default_rng(2))
    start = start_at(ROW, p_AS)
    one = refined(clean, ROW, start)
    gains = 10 ** (np.array([0.5, -0.5, 0.3]) / 20)
    other = refined((gains[:, None] * clean).astype(np.float32), ROW, start)
    assert other.bearing == pytest.approx(one.bearing, abs=0.3 * one.bearing_std)
    assert other.range == pytest.approx(one.range, abs=0.3 * one.range_std)
    assert other.range_std == pytest.approx(one.range_std, rel=0.15)


def test_a_far_source_keeps_to_its_bearing():
    """Noise alone has an inverse range beyond one sigma in a sixth of the frames."""
    p_AS = place(35, 5000.0)
    generator = np.random.default_rng(3)
    start = start_at(ROW, p_AS).without_range()
    sound = Sound(2)
    ranged = 0
    for _ in range(60):
        fix = refined(frame_of(sound, ROW, p_AS, 5.0, generator), ROW, start)
        ranged += fix.range_valid
        assert abs(fix.bearing - math.radians(35.0)) < 4.5 * fix.bearing_std
    assert 2 <= ranged <= 20


@pytest.mark.parametrize(
    "frame",
    [np.zeros((3, N), np.float32), np.ones((3, N), np.float32),
     np.ones((3, 100), np.float32)],
)  # fmt: skip
def test_nothing_to_hear_gives_no_place(frame):
    start = start_at(ROW, place(60, 1.0))
    fix = refine_source(frame, start, ROW, C, sample_rate_hz=FS, band_hz=BAND)
    assert fix is None


def test_takes_less_than_four_milliseconds():
    p_AS = place(50, 2.0)
    frame = frame_of(Sound(2), ROW, p_AS, 20.0, np.random.default_rng(3))
    start = start_at(ROW, p_AS)
    spent = []
    for _ in range(30):
        begin = time.perf_counter()
        refined(frame, ROW, start)
        spent.append(time.perf_counter() - begin)
    assert np.median(spent) < 4e-3
