"""Bearings from gathered spectra: free field, noise, tones, lost microphones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from phonotaxis.testing import Bench
from studies.support.bearing_trials import BearingTrial, hear_once
from studies.support.listening_methods import PlaneListener, PrintedListener
from systems.base.robot import RobotParameters
from systems.framework.faults import Fault
from systems.framework.input_error import InputError
from systems.framework.signals import AudioFrame
from systems.hearing.cross_power_estimator import ArrayListener, CrossPowerEstimator
from systems.sound.parameters import (
    MicArrayParameters,
    SoundParameters,
)

SIREN = SoundParameters(kind="siren", on_s=1.0, period_s=1.0)
NOISE = SoundParameters(kind="band_noise", on_s=1.0, period_s=1.0)
BUZZER = SoundParameters(kind="tone", tone_hz=2700.0, on_s=1.0, period_s=1.0)


def off_deg(trial: BearingTrial, **how) -> float:
    heard = hear_once(trial, **how)
    assert heard is not None
    return abs(math.degrees(math.remainder(heard.bearing - trial.bearing, math.tau)))


@pytest.mark.parametrize("sound", [SIREN, NOISE], ids=["siren", "noise"])
@pytest.mark.parametrize("method", [ArrayListener, PlaneListener])
def test_in_the_free_field_it_hears_to_a_few_degrees(sound, method):
    for k, bearing in enumerate(np.radians([-170.0, -95.0, -20.0, 48.0, 130.0])):
        trial = BearingTrial(sound, 0.5 + 0.4 * k, float(bearing), seed=k)
        assert off_deg(trial, method=method) < 4.0


def test_the_range_is_good_where_it_is_near():
    """Design: within 20 % at 0.5 m."""
    for k, bearing in enumerate((0.3, 2.0, -2.5)):
        heard = hear_once(BearingTrial(SIREN, 0.5, bearing, seed=k))
        assert heard is not None
        assert heard.place is not None
        assert np.linalg.norm(heard.place) == pytest.approx(0.5, rel=0.2)


def test_a_fan_beside_it_is_subtracted():
    """Directed noise 5 dB above the siren: heard is the fan without, the siren with."""
    trial = BearingTrial(SIREN, 1.0, 2.0, seed=3, fan_bearing=-0.7, fan_snr_db=-5.0)
    assert off_deg(trial) < 10.0
    assert off_deg(trial, subtract=False) > 10.0


def test_a_steady_tone_is_ambiguous_and_a_siren_is_not():
    """2.7 kHz repeats every 126 mm: within the 150 mm arms."""
    tone = hear_once(BearingTrial(BUZZER, 1.0, 0.8, seed=1))
    siren = hear_once(BearingTrial(SIREN, 1.0, 0.8, seed=1))
    assert tone is not None
    assert tone.ambiguous
    assert siren is not None
    assert not siren.ambiguous


def test_silence_is_not_heard():
    quiet = SoundParameters(kind="siren", on_s=1.0, period_s=1.0, start_s=600.0)
    assert hear_once(BearingTrial(quiet, 1.0, 0.0, seed=1)) is None


@pytest.mark.parametrize("microphone", [1, 2, 4])
def test_three_microphones_are_enough_for_a_bearing(microphone):
    fault = Fault(sensor="microphones", number=microphone, kind="dead")
    trial = BearingTrial(SIREN, 1.0, 1.1, seed=2, faults=(fault,))
    assert off_deg(trial) < 10.0


def test_two_are_not():
    faults = tuple(Fault(sensor="microphones", number=k, kind="dead") for k in (2, 3))
    assert hear_once(BearingTrial(SIREN, 1.0, 1.1, seed=2, faults=faults)) is None


def test_the_printed_chain_is_coarser():
    """Whole samples and spherical interpolation: worse on average over bearings."""
    trials = [
        BearingTrial(SIREN, 1.75, b, seed=k) for k, b in enumerate((0.2, 1.3, 2.9))
    ]
    printed = np.mean([off_deg(t, method=PrintedListener) for t in trials])
    ours = np.mean([off_deg(t) for t in trials])
    assert ours < printed


def frames(count, rate=32_000.0):
    """A plane wave from ahead: 14 samples earlier at the front arm, 7 later behind."""
    generator = np.random.default_rng(1)
    wave = 300.0 * generator.standard_normal(800 * count + 40)
    for k in range(count):
        begins = [800 * k + 20 + shift for shift in (0, 14, -7, -7)]
        counts = np.array([wave[b : b + 800] for b in begins]).astype(np.int16)
        yield AudioFrame(counts, 2048, rate, 0.025 * (k + 1))


def test_it_asks_for_sound_only_while_it_listens():
    block = CrossPowerEstimator(microphones=MicArrayParameters(sample_rate_hz=32_000.0))
    values, memory, asked = np.zeros(10), block._blank, []
    played = list(frames(12))
    for k, listening in enumerate([0, 0, 1, 1, 2, 2, 2, 2, 2, 2, 0, 0]):

        def audio(k=k):
            asked.append(k)
            return played[k]

        values, memory = block.hear(np.array([listening]), audio, memory)
    assert asked == list(range(2, 10))
    assert values[4] == 1.0
    assert abs(values[0]) < math.radians(3.0)


def test_frames_of_another_rate_are_refused():
    block = CrossPowerEstimator(microphones=MicArrayParameters(sample_rate_hz=32_000.0))
    at = Bench(block, audio=next(frames(1, 48_000.0)), listening=2.0)
    with pytest.raises(InputError, match="48000"):
        at.tick()


def test_three_microphones_at_the_start_are_refused():
    with pytest.raises(InputError, match="four or more"):
        ArrayListener(RobotParameters(), 340.0, MicArrayParameters())
