"""What the estimator hears: accuracy, silence, ambiguity, ports and latency."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.random import Generator, Philox
from pydantic import ValidationError

from phonotaxis.testing import Bench
from systems.base.robot import RobotParameters
from systems.framework.noise import frame_noise
from systems.framework.signals import AudioFrame
from systems.hearing.parameters import TDOAParameters
from systems.hearing.tdoa_estimator import TDOAEstimator, robot_localizer
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.adc import convert
from systems.sound.parameters import MicArrayParameters

pytestmark = pytest.mark.drake

FS, N, L, C = 100_000.0, 2500, 0.4, 340.0
PLACES = np.array([[0.0, L], [0.0, 0.0], [0.0, -L]])
DEFAULT = TDOAParameters()


def localize(frame, parameters=DEFAULT, *, limited=True):
    """What a frame says to one who has heard nothing before."""
    localizer, _ = robot_localizer(
        parameters, RobotParameters(), SOUND_SPEED_M_S, limited=limited
    )
    return localizer.localize(frame, localizer.blank())[0]


def chirp(t):
    """0.5-8 kHz in 25 ms, again and again."""
    sweep = np.mod(t, 0.025)
    return np.sin(2 * np.pi * (500.0 + 150_000.0 * sweep) * sweep)


def arriving(sound, bearing_deg, distance):
    """(3, N) sound of a resting source, of unit gain at the middle microphone."""
    angle = math.radians(bearing_deg)
    source = distance * np.array([math.cos(angle), math.sin(angle)])
    ranges = np.linalg.norm(source - PLACES, axis=1)
    t = 0.3 + np.arange(N) / FS
    return np.array([sound(t - r / C) * distance / r for r in ranges])


def heard(sound, bearing_deg, distance, snr_db, seed=0):
    """The same with noise relative to the middle microphone."""
    rows = arriving(sound, bearing_deg, distance)
    noise = Generator(Philox(key=seed)).standard_normal((3, N))
    rms = np.sqrt(np.mean(rows[1] ** 2))
    return (rows + rms * 10 ** (-snr_db / 20) * noise).astype(np.float32)


def found_in(frame, parameters=DEFAULT):
    fix = localize(frame, parameters)
    assert fix is not None
    return fix


def fixes(bearing_deg, distance, snr_db, trials):
    return [
        found_in(heard(chirp, bearing_deg, distance, snr_db, seed))
        for seed in range(trials)
    ]


# Cramer-Rao bounds of a 25 ms chirp of 0.5-8 kHz at 20 dB, rms over 0, 30 and
# 60 deg: range in m, bearing in deg; from an independent calculation.
BOUNDS = {1.0: (0.0009, 0.0061), 2.0: (0.0036, 0.0042), 4.0: (0.0141, 0.0036)}


@pytest.mark.parametrize("distance", BOUNDS)
def test_accuracy_is_near_the_cramer_rao_bound(distance):
    range_errors, bearing_errors = [], []
    for bearing in (0.0, 30.0, 60.0):
        for fix in fixes(bearing, distance, 20.0, 40):
            assert fix.range_valid
            range_errors.append(fix.range - distance)
            bearing_errors.append(math.degrees(fix.bearing) - bearing)
    bound_range, bound_bearing = BOUNDS[distance]
    # 120 trials scatter by 7 %; a source cut by the frame's ends costs 10 %.
    assert np.sqrt(np.mean(np.square(range_errors))) < 1.35 * bound_range
    assert np.sqrt(np.mean(np.square(bearing_errors))) < 1.35 * bound_bearing


@pytest.mark.parametrize("distance", [1.0, 3.0])
@pytest.mark.parametrize("bearing", [0.0, 40.0])
@pytest.mark.parametrize("snr_db", [10.0, 25.0])
def test_stated_errors_are_the_actual_ones(distance, bearing, snr_db):
    found = fixes(bearing, distance, snr_db, 60)
    for name in ("range", "bearing"):
        actual = np.std([getattr(fix, name) for fix in found])
        stated = np.median([getattr(fix, f"{name}_std") for fix in found])
        assert 1 / 1.5 < stated / actual < 1.5


def test_left_is_left():
    """A sign that is broken somewhere makes this fail."""
    frame = heard(chirp, 40.0, 1.5, 30.0)
    fix = found_in(frame)
    assert fix.p_AS == pytest.approx(
        (1.5 * math.cos(math.radians(40)), 1.5 * math.sin(math.radians(40))), abs=0.01
    )
    mirrored = found_in(frame[::-1].copy())
    assert math.degrees(mirrored.bearing) == pytest.approx(-40.0, abs=0.05)


@pytest.mark.parametrize("method", ["gcc", "gcc_phat", "amdf"])
def test_every_method_finds_the_source(method):
    parameters = TDOAParameters(method=method)
    fix = found_in(heard(chirp, -25.0, 1.2, 25.0), parameters)
    assert math.degrees(fix.bearing) == pytest.approx(-25.0, abs=0.3)
    assert fix.range == pytest.approx(1.2, rel=0.1)


@pytest.mark.parametrize(
    ("method", "seconds"), [("gcc", 60), ("gcc_phat", 15), ("amdf", 10)]
)
def test_noise_is_not_heard(method, seconds):
    parameters = TDOAParameters(method=method)
    microphones = MicArrayParameters()
    for tick in range(40 * seconds):
        counts = convert(None, frame_noise((3, N), 11, tick), 0.003, microphones)
        frame = counts.astype(np.float32)
        assert localize(frame, parameters) is None


def errors_of_tones(tone_hz, *, limited=True, **fields):
    """Errors of bearings over 5 deviations and 0.01 rad, where a tone is heard.

    In 66 frames that hold the begin or the end of a tone of 40 ms, or all tone.
    """
    errors = []
    for seed, begin in enumerate(np.arange(0.25, 0.33, 0.0037)):

        def burst(t, begin=begin):
            gate = np.minimum(t - begin, begin + 0.04 - t) / 0.003
            return np.sin(2 * np.pi * tone_hz * t) * np.clip(gate, 0.0, 1.0)

        for bearing in (-50.0, 0.0, 35.0):
            noise = Generator(Philox(key=seed)).standard_normal((3, N))
            frame = arriving(burst, bearing, 2.0) + 0.01 * noise
            parameters = TDOAParameters(**fields)
            fix = localize(frame.astype(np.float32), parameters, limited=limited)
            if fix is not None:
                error = abs(fix.bearing - math.radians(bearing))
                errors.append(error / (5.0 * fix.bearing_std + 0.01))
    return errors


@pytest.mark.parametrize(
    ("method", "tone_hz", "heard_with_echoes", "heard_without"),
    [
        ("gcc", 2_000.0, 1, 0),
        ("gcc", 8_190.0, 0, 0),
        ("gcc_phat", 2_000.0, 0, 0),
        ("gcc_phat", 8_190.0, 0, 0),
        ("amdf", 2_000.0, 0, 2),
        ("amdf", 8_190.0, 0, 0),
    ],
)
def test_ambiguous_tone_gives_no_confident_wrong_target(
    method, tone_hz, heard_with_echoes, heard_without
):
    """A tone is heard, if at all, by its begin or end, and then where it is."""
    for suppress, count in ((True, heard_with_echoes), (False, heard_without)):
        errors = errors_of_tones(tone_hz, method=method, suppress_echoes=suppress)
        assert len(errors) == count
        assert max(errors, default=0.0) < 1.0


@pytest.mark.parametrize("method", ["gcc", "gcc_phat", "amdf"])
def test_ambiguity_is_what_keeps_tones_from_being_wrong_targets(method):
    """Without that check the frames of the test above give wrong bearings."""
    fields = {"method": method, "suppress_echoes": False}
    errors = np.array(errors_of_tones(8_190.0, limited=False, **fields))
    assert np.count_nonzero(errors > 1.0) >= 3


def audio(frame, **changes):
    counts = np.rint(frame / np.abs(frame).max() * 400).astype(np.int16)
    fields = {"full_scale": 512, "sample_rate_hz": FS, "time": 0.025}
    return AudioFrame(counts=counts, **{**fields, **changes})


def test_ports_show_the_frame_after_one_tick():
    at = Bench(TDOAEstimator(), audio=audio(heard(chirp, 30.0, 2.0, 30.0)))
    assert at.output("detected") == 0.0
    ports = at.tick().outputs()
    assert ports["detected"] == 1.0
    assert ports["range_valid"] == 1.0
    assert math.degrees(ports["source_bearing"][0]) == pytest.approx(30.0, abs=0.05)
    assert ports["source_range"][0] == pytest.approx(2.0, abs=0.02)
    assert ports["p_PS_B"] == pytest.approx([math.sqrt(3.0), 1.0], abs=0.02)
    covariance = ports["covariance"].reshape(2, 2)
    np.testing.assert_allclose(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_speed_of_sound_that_the_estimator_believes_in():
    """Far away sin(bearing) = c tau_13 / 2l: 3 % too fast reads 3 % too much."""
    at = Bench(TDOAEstimator(sound_speed_m_s=1.03 * C))
    at.tick(audio=audio(heard(chirp, 30.0, 1e4, 30.0)))
    bearing = at.output("source_bearing")[0]
    assert math.sin(bearing) == pytest.approx(1.03 * 0.5, abs=2e-3)


def test_a_sound_that_ends_is_read_no_longer():
    at = Bench(TDOAEstimator()).tick(audio=audio(heard(chirp, 30.0, 2.0, 30.0)))
    assert at.output("detected") == 1.0
    noise = Generator(Philox(key=1)).standard_normal((3, N))
    at.tick(audio=audio(noise))
    for values in at.outputs().values():
        np.testing.assert_array_equal(values, 0.0)


def test_nothing_heard_reads_zero():
    noise = Generator(Philox(key=1)).standard_normal((3, N))
    at = Bench(TDOAEstimator()).tick(audio=audio(noise))
    for values in at.outputs().values():
        np.testing.assert_array_equal(values, 0.0)


def test_plane_wave_has_a_bearing_and_no_range():
    """A source 10 km away."""
    fix = found_in(heard(chirp, 20.0, 1e4, 20.0))
    assert not fix.range_valid
    assert fix.range == 0.0
    assert math.degrees(fix.bearing) == pytest.approx(20.0, abs=0.1)
    assert math.hypot(*fix.p_AS) == pytest.approx(1.0)


SQUARE = ((0.15, 0.15), (0.15, -0.15), (-0.15, -0.15), (-0.15, 0.15))


@pytest.mark.parametrize(
    ("places", "bearing"),
    [
        (((0.0, -0.4), (0.0, 0.0), (0.0, 0.4)), 35.0),  # from right to left
        (((0.1, 0.4), (0.1, 0.1), (0.1, -0.2), (0.1, -0.4)), -40.0),  # four, ahead
        (SQUARE, 160.0),  # behind, which only a row cannot tell
        (SQUARE, -70.0),
    ],
)
def test_microphones_anywhere_hear_the_source(places, bearing):
    """Port values count from P, wherever the microphones stand."""
    source = 1.5 * np.array(
        [math.cos(math.radians(bearing)), math.sin(math.radians(bearing))]
    )
    ranges = np.linalg.norm(source - np.array(places), axis=1)
    t = 0.3 + np.arange(N) / FS
    noise = Generator(Philox(key=5)).standard_normal((len(places), N))
    rows = np.array([chirp(t - r / C) / r for r in ranges]) + 0.005 * noise
    block = TDOAEstimator(robot=RobotParameters(microphones_m=places))
    ports = Bench(block).tick(audio=audio(rows)).outputs()
    assert ports["detected"] == 1.0
    assert ports["range_valid"] == 1.0
    # Six standard deviations of a small array's range.
    reach = 6.0 * math.sqrt(np.trace(ports["covariance"].reshape(2, 2))) + 1e-3
    assert np.linalg.norm(ports["p_PS_B"] - source) < reach
    assert reach < 0.5


def test_wrong_audio_is_refused():
    at = Bench(TDOAEstimator())
    with pytest.raises(TypeError, match=r"TDOAEstimator.*MicArray"):
        at.tick(audio=("sound",))
    with pytest.raises(ValueError, match=r"TDOAEstimator.*48000"):
        at.tick(audio=audio(np.ones((3, N)), sample_rate_hz=48_000.0))


@pytest.mark.parametrize(
    "fields", [{"band_hz": (2e4, 1e4)}, {"band_hz": (300.0, 6e4)}, {"method": "music"}]
)
def test_bad_parameters(fields):
    with pytest.raises(ValidationError, match=next(iter(fields))):
        TDOAParameters(**fields)
