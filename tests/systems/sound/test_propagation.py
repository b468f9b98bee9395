"""Delays, Doppler shift and amplitude of sound, against closed forms."""

from __future__ import annotations

import math
from contextlib import nullcontext

import numpy as np
import pytest

from systems.framework.signals import Emission
from systems.sound.propagation import (
    check_reach,
    microphone_paths,
    propagate,
    retarded_delays,
    sampled_at,
)

FS = 100_000.0
C = 340.0
TIME = 0.5
FRAME = 0.025
COUNT = 2500
KNOTS = np.linspace(0.0, FRAME, 11)
TONES = (100.0, 500.0, 2_000.0, 8_000.0, 13_000.0, 18_000.0)


def emission(sound, position, velocity=(0.0, 0.0), *, reach=0.15, time=TIME):
    """A source that is at position at the given time; sound is a function of time."""
    first = round((time - reach) * FS)
    t = (first + np.arange(round(reach * FS) + 16)) / FS
    knots = time - np.array([0.2, 0.1, 0.0])
    path = np.asarray(position) + (knots - time)[:, None] * np.asarray(velocity)
    return Emission(
        samples=sound(t).astype(np.float32),
        start_time=first / FS,
        sample_rate_hz=FS,
        knot_times=knots,
        p_WS=path,
        v_WS=np.tile(np.asarray(velocity, dtype=float), (3, 1)),
        level_pa=1.0,
        sounding=True,
    )


def at_rest(*places, time=TIME):
    """Instants, places and velocities of resting microphones over a frame."""
    times = np.tile(time - FRAME + KNOTS, (len(places), 1))
    p_WM = np.repeat(np.asarray(places, dtype=float)[:, None], len(KNOTS), axis=1)
    return times, p_WM, np.zeros_like(p_WM)


def hear(sound, *places):
    """(places, 2500) pressure at resting microphones."""
    times, p_WM, v_WM = at_rest(*places)
    return propagate(sound, times, p_WM, v_WM, COUNT, C)


def arrivals(time=TIME):
    return time - FRAME + np.arange(COUNT) / FS


def delay_and_gain(heard, expected, slope):
    """Local delay error (s) and gain of a signal, by least squares.

    Fits heard = g (expected - e slope) over one stretch.
    """
    basis = np.stack([expected, -slope], axis=1)
    (gain, shift), *_ = np.linalg.lstsq(basis, heard.astype(float), rcond=None)
    return shift / gain, gain


@pytest.mark.parametrize("tone", TONES)
def test_static_source(tone):
    source = np.array([1.3, 0.7])
    microphone = np.array([-0.4, 0.25])
    distance = np.linalg.norm(source - microphone)
    sound = emission(lambda t: np.sin(2 * np.pi * tone * t), source)
    heard = hear(sound, microphone)
    phase = 2 * np.pi * tone * (arrivals() - distance / C)
    error, gain = delay_and_gain(
        heard[0],
        np.sin(phase) / distance,
        2 * np.pi * tone * np.cos(phase) / distance,
    )
    assert abs(error * FS) < 1e-3
    assert gain == pytest.approx(1.0, abs=1e-3)


def analytic_delay(t, position, velocity, microphone):
    """Traveling time from a uniformly moving source, the quadratic's root."""
    v = np.asarray(velocity)
    d = np.asarray(microphone) - (position + (t - TIME)[:, None] * v)
    dv = d @ v
    a = C**2 - v @ v
    return (dv + np.sqrt(dv**2 + a * np.sum(d**2, axis=1))) / a


@pytest.mark.parametrize("tone", TONES)
@pytest.mark.parametrize("velocity", [(1.0, 0.0), (-0.6, 0.8)])
def test_source_passing_at_1_m_s(tone, velocity):
    """In every stretch of 250 samples while it passes at 0.6 m."""
    position, microphone = np.array([0.01, 0.6]), np.zeros(2)
    sound = emission(lambda t: np.sin(2 * np.pi * tone * t), position, velocity)
    heard = hear(sound, microphone)[0]
    t = arrivals()
    delay = analytic_delay(t, position, velocity, microphone)
    phase, distance = 2 * np.pi * tone * (t - delay), C * delay
    stretch = 1250 if tone == 100.0 else 250
    for k in range(0, COUNT, stretch):
        part = slice(k, k + stretch)
        error, gain = delay_and_gain(
            heard[part],
            np.sin(phase[part]) / distance[part],
            2 * np.pi * tone * np.cos(phase[part]) / distance[part],
        )
        assert abs(error * FS) < 1e-3
        assert gain == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("rate", [32_000.0, 44_000.0, 50_000.0])
@pytest.mark.parametrize("tone", [500.0, 2_000.0, 8_000.0, 15_000.0])
def test_microphones_of_another_rate(rate, tone):
    """A tone at 2 m, at instants of the microphone's own, while it passes at 1 m/s."""
    position, velocity = np.array([0.01, 2.0]), np.array([1.0, 0.0])
    sound = emission(lambda t: np.sin(2 * np.pi * tone * t), position, velocity)
    count = round(FRAME * rate)
    times, p_WM, v_WM = at_rest((0.0, 0.0))
    heard = propagate(sound, times, p_WM, v_WM, count, C)[0]
    t = TIME - FRAME + np.arange(count) / rate
    delay = analytic_delay(t, position, velocity, np.zeros(2))
    expected = np.sin(2 * np.pi * tone * (t - delay)) / (C * delay)
    np.testing.assert_allclose(heard, expected, atol=3e-4)


def test_sound_at_another_rate():
    """Places between the samples of two tones."""
    tones = np.array([[700.0], [9_000.0]])
    sound = np.sin(2 * np.pi * tones * np.arange(2_600) / FS).astype(np.float32)
    found = sampled_at(sound, 20, 3.125, 800)
    t = (20 + 3.125 * np.arange(800)) / FS
    np.testing.assert_allclose(found, np.sin(2 * np.pi * tones * t), atol=1e-4)


@pytest.mark.parametrize("speed", [5.0, -5.0])
def test_doppler_shift_of_2_khz(speed):
    """Han 2019, eq. 1, for a source that comes or goes at 5 m/s."""
    tone = 2_000.0
    sound = emission(lambda t: np.sin(2 * np.pi * tone * t), (6.0, 0.0), (-speed, 0.0))
    heard = hear(sound, (0.0, 0.0))[0].astype(float)
    expected = tone * C / (C - speed)
    t = arrivals()
    # Amplitude changes by 2 % over the frame: fit it along with the phase.
    halves = []
    for part in (slice(0, COUNT // 2), slice(COUNT // 2, COUNT)):
        basis = np.exp(-2j * np.pi * expected * t[part]) * np.hanning(COUNT // 2)
        halves.append(np.angle(basis @ heard[part]))
    drift = math.remainder(halves[1] - halves[0], 2 * np.pi) / (2 * np.pi * FRAME / 2)
    assert abs(drift) < 0.1


def test_doppler_shift_of_a_moving_microphone():
    """Han 2019, eq. 1: the observer's speed stands in the numerator."""
    tone, speed = 2_000.0, 0.7
    sound = emission(lambda t: np.sin(2 * np.pi * tone * t), (6.0, 0.0))
    times, p_WM, v_WM = at_rest((0.0, 0.0))
    p_WM[0, :, 0] += speed * (times[0] - TIME)
    v_WM[0, :, 0] = speed
    heard = propagate(sound, times, p_WM, v_WM, COUNT, C)
    t = arrivals()
    distance = 6.0 - speed * (t - TIME)
    phase = 2 * np.pi * tone * (t - distance / C)
    # d phase / dt = 2 pi f (c + v) / c, as in the paper.
    assert np.gradient(phase, t)[10] / (2 * np.pi) == pytest.approx(
        tone * (C + speed) / C
    )
    np.testing.assert_allclose(heard[0], np.sin(phase) / distance, atol=1e-4)


def test_microphones_of_a_turning_robot():
    """A robot that turns on the spot carries them along circles."""
    omega, p_BM = 3.0, np.array([[0.175, 0.4], [0.175, -0.4]])
    times = np.tile(KNOTS, (2, 1))
    turn = omega * FRAME
    start, end = np.array([1.0, 2.0, 3.1]), np.array([1.0, 2.0, 3.1 + turn])
    spin = np.array([0.0, 0.0, omega])
    p_WM, v_WM = microphone_paths(times, 0.0, start, spin, FRAME, end, spin, p_BM)
    for m, (x, y) in enumerate(p_BM):
        angle = 3.1 + omega * KNOTS + math.atan2(y, x)
        radius = math.hypot(x, y)
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        along = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
        np.testing.assert_allclose(p_WM[m], [1.0, 2.0] + radius * circle, atol=1e-12)
        np.testing.assert_allclose(v_WM[m], omega * radius * along, atol=1e-12)


def test_wrapped_heading_makes_no_turn():
    spin = np.array([0.0, 0.0, 1.0])
    poses = [np.array([0.0, 0.0, a]) for a in (math.pi - 0.0125, -math.pi + 0.0125)]
    p_BM = np.array([[0.0, 1.0]])
    times = KNOTS[None]
    _, v_WM = microphone_paths(times, 0.0, poses[0], spin, FRAME, poses[1], spin, p_BM)
    np.testing.assert_allclose(np.linalg.norm(v_WM, axis=2), 1.0, rtol=1e-9)


def test_rate_of_the_delay_is_its_derivative():
    sound = emission(np.zeros_like, (1.0, 0.5), (2.0, -1.0))
    step = 1e-6
    times = np.array([[0.48 - step, 0.48, 0.48 + step]])
    p_WM = np.stack([times[0] * 0.3, times[0] * -0.2], axis=1)[None]
    v_WM = np.broadcast_to([0.3, -0.2], p_WM.shape).copy()
    path = (sound.knot_times, sound.p_WS, sound.v_WS)
    delays, rates = retarded_delays(times, p_WM, v_WM, *path, C)
    difference = (delays[0, 2] - delays[0, 0]) / (2 * step)
    assert rates[0, 1] == pytest.approx(difference, abs=1e-8)


def test_close_microphone_is_not_infinitely_loud():
    """Nearer than 1 cm, the amplitude is that at 1 cm."""
    tone = emission(lambda t: np.sin(2 * np.pi * 1_000.0 * t), (0.001, 0.0))
    heard = hear(tone, (0.0, 0.0))
    assert np.abs(heard).max() == pytest.approx(100.0, rel=1e-3)


def test_source_out_of_reach_is_an_error():
    sound = emission(np.cos, (40.0, 0.0), reach=0.1)
    with pytest.raises(ValueError, match=r"MicArray.*40\.00 m.*maximum_range_m"):
        hear(sound, (0.0, 0.0))


@pytest.mark.parametrize(
    ("distance", "speed", "heard"),
    [
        (33.0, 0.0, True),
        (35.0, 0.0, False),
        (31.0, -20.0, False),  # it was at 35 m when its path begins, 0.2 s ago
        (37.0, 20.0, True),
    ],
)
def test_reach_is_what_sound_travels_in_the_time(distance, speed, heard):
    """The emission begins 0.1 s before the frame: 34 m less 2 cm."""
    sound = emission(np.cos, (distance, 0.0), (speed, 0.0), reach=0.1)
    begin = sound.start_time + 0.1
    with nullcontext() if heard else pytest.raises(ValueError, match="away"):
        check_reach(sound, begin, np.zeros(2), C)


def test_against_pyroomacoustics():
    """Free-field responses of an anechoic room, at three microphones."""
    import pyroomacoustics as pra

    rng = np.random.default_rng(5)
    spectrum = np.zeros(10_001, dtype=complex)
    spectrum[100:3000] = np.exp(2j * np.pi * rng.random(2900))
    noise = np.fft.irfft(spectrum)
    noise /= noise.std()
    source, places = [2.5, 0.8], [[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]]

    room = pra.AnechoicRoom(2, fs=round(FS))
    room.set_sound_speed(C)
    room.add_source(source, signal=noise)
    room.add_microphone_array(np.array(places).T)
    room.simulate()
    # Its fractional delay filters shift every channel by half their length.
    offset = pra.constants.get("frac_delay_length") // 2

    first = round((TIME - 0.15) * FS)
    sound = emission(lambda t: noise[np.rint(t * FS).astype(int) - first], source)
    ours = hear(sound, *places)
    start = round((TIME - FRAME) * FS) - first + offset
    theirs = room.mic_array.signals[:, start : start + COUNT]
    difference = np.std(ours - theirs, axis=1) / np.std(theirs, axis=1)
    assert difference.max() < 5e-3
