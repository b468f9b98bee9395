"""Ego noise: level, color, coherence and seam of a recording that repeats."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal
import soundfile

from phonotaxis.testing import evaluate
from systems.framework.signals import FRAME_SAMPLES, TICK_S
from systems.sound.ego_noise import EgoNoise
from systems.sound.mic_array import MicArray
from systems.sound.parameters import MicArrayParameters, SoundParameters
from systems.sound.sound_emitter import make_emission
from systems.sound.waveforms import make_waveform

RATE = 16_000


def recording(path, *, channels=1, seconds=1.0, low_hz=300.0, high_hz=600.0):
    """Noise between two frequencies."""
    sections = scipy.signal.butter(
        4, (low_hz, high_hz), "bandpass", fs=RATE, output="sos"
    )
    white = np.random.default_rng(0).standard_normal((round(seconds * RATE), channels))
    soundfile.write(path, 0.3 * scipy.signal.sosfilt(sections, white, axis=0), RATE)
    return str(path)


def ego_noise(file, *, snr_db=0.0, count=3, seed=4):
    parameters = MicArrayParameters(ego_noise_file=file, ego_noise_snr_db_at_1m=snr_db)
    return EgoNoise(parameters, count, seed)


def played(noise, ticks):
    return np.concatenate([noise.frame(tick) for tick in range(1, ticks + 1)], 1)


def test_level_is_below_the_source_at_one_meter(tmp_path):
    noise = ego_noise(recording(tmp_path / "fan.wav"), snr_db=20.0)
    rms = np.std(played(noise, 38))  # once through
    assert rms == pytest.approx(0.1, rel=0.02)


def test_color_is_that_of_the_recording(tmp_path):
    noise = played(ego_noise(recording(tmp_path / "fan.wav", seconds=3.0)), 100)
    frequencies, density = scipy.signal.welch(noise[0], 100_000, nperseg=8192)
    band = (frequencies > 250.0) & (frequencies < 700.0)
    assert density[band].sum() > 0.98 * density.sum()


def test_one_channel_is_incoherent_at_the_microphones(tmp_path):
    noise = played(ego_noise(recording(tmp_path / "fan.wav", seconds=3.0)), 100)
    # 2.5 s of 300 Hz bandwidth: a correlation's error is 1 / sqrt(2 B T) = 3 %.
    assert np.abs(np.corrcoef(noise) - np.eye(3)).max() < 0.12


def test_a_channel_for_each_microphone_stays_coherent(tmp_path):
    """The second channel follows the first by 10 samples, 0.625 ms."""
    mono, _ = soundfile.read(recording(tmp_path / "fan.wav"))
    rows = np.array([mono, np.roll(mono, 10), 0.5 * mono])
    soundfile.write(tmp_path / "array.wav", rows.T, RATE, subtype="FLOAT")
    noise = played(ego_noise(str(tmp_path / "array.wav")), 30)
    late = 62  # samples at 100 kHz, and a half
    middle = 0.5 * (noise[0, 1000:-1000] + noise[0, 999:-1001])
    follower = noise[1, 1000 + late : -1000 + late]
    assert np.corrcoef(middle, follower)[0, 1] > 0.999
    np.testing.assert_allclose(noise[2], 0.5 * noise[0], atol=1e-4)


def test_it_repeats_without_a_seam(tmp_path):
    """0.25 s less the fade are eight frames; nothing clicks at their joints."""
    noise = played(ego_noise(recording(tmp_path / "fan.wav", seconds=0.25)), 24)
    np.testing.assert_array_equal(noise[:, : 8 * FRAME_SAMPLES], noise[:, -20_000:])
    smooth = scipy.signal.sosfiltfilt(
        scipy.signal.butter(4, 2_000.0, fs=100_000, output="sos"), noise
    )
    # Above 2 kHz there is little of the recording; a jump would leave half its height.
    assert np.abs(noise - smooth)[:, 2_000:-2_000].max() < 0.01


def test_same_seed_same_noise(tmp_path):
    file = recording(tmp_path / "fan.wav")
    first, again, other = (ego_noise(file, seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first.frame(9), again.frame(9))
    assert np.abs(first.frame(9) - other.frame(9)).max() > 0.1


SILENT = SoundParameters(start_s=100.0)


def counts_at(block, tick):
    """What the microphones record at a tick while the source is silent."""
    time = tick * TICK_S
    p_WS, v_WS = np.tile([2.0, 0.0], (6, 1)), np.zeros((6, 2))
    sent = make_emission(time, make_waveform(SILENT), SILENT, p_WS, v_WS)
    rest = [0.0] * 3
    outputs = evaluate(
        block, time_s=time, emission=sent, pose_WB=rest, velocity_WB=rest
    )
    return outputs["audio"].counts


def test_microphones_hear_it_beside_the_converters_noise(tmp_path):
    """The source is silent and far below: ego noise at 14 dB, white noise at 40."""
    parameters = MicArrayParameters(
        ego_noise_file=recording(tmp_path / "fan.wav"),
        ego_noise_snr_db_at_1m=14.0,
        snr_db_at_1m=40.0,
        adc_bits=16,
    )
    block = MicArray(parameters=parameters, seed=3)
    counts = [counts_at(block, tick) for tick in range(8, 48)]
    level = np.std(counts) / parameters.counts_per_pa / SILENT.level_pa
    white, ego = 10 ** (-40 / 20), 10 ** (-14 / 20)
    assert level == pytest.approx(np.hypot(white, ego), rel=0.03)


def test_it_plays_on_from_frame_to_frame(tmp_path):
    """Of 300 to 600 Hz next to nothing lies above 2 kHz, at the frames' joints too."""
    parameters = MicArrayParameters(
        ego_noise_file=recording(tmp_path / "fan.wav"),
        ego_noise_snr_db_at_1m=0.0,
        snr_db_at_1m=150.0,
        adc_bits=16,
    )
    block = MicArray(parameters=parameters, seed=3)
    frames = [counts_at(block, tick) for tick in range(8, 16)]
    noise = np.concatenate(frames, axis=1) / np.std(frames)
    sections = scipy.signal.butter(4, 2_000.0, "high", fs=100_000, output="sos")
    above = scipy.signal.sosfiltfilt(sections, noise)
    assert np.abs(above)[:, 2_000:-2_000].max() < 0.03


def too_short(path):
    return recording(path, seconds=0.1)


def constant(path):
    soundfile.write(path, np.full(RATE, 0.3), RATE, subtype="FLOAT")
    return str(path)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (str, "is not a file"),
        (lambda path: recording(path, channels=2), "2 channels for 3 microphones"),
        (too_short, r"lasts 0\.100 s"),
        (constant, "nothing between 50 and 18000 Hz"),
    ],
)
def test_unusable_recordings_are_refused(tmp_path, make, message):
    file = make(tmp_path / "fan.wav")
    with pytest.raises(ValueError, match=rf"microphones\.ego_noise_file.*{message}"):
        ego_noise(file)
