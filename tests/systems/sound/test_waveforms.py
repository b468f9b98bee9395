"""Band, level, edges and order of what the loudspeaker plays."""

from __future__ import annotations

import math

import numpy as np
import pytest
import soundfile
from pydantic import ValidationError
from scipy.special import j0

from systems.sound.parameters import EDGE_S, SoundParameters
from systems.sound.waveforms import make_waveform

FS = 100_000
KINDS = ("chirp", "band_noise", "tone", "horn", "siren")
EDGE = round(EDGE_S * FS)


def share_outside(samples, low, high):
    """Part of the energy outside a band."""
    power = np.abs(np.fft.rfft(samples * np.hanning(len(samples)))) ** 2
    f = np.fft.rfftfreq(len(samples), 1 / FS)
    return power[(f < low) | (f > high)].sum() / power.sum()


def recording(folder, samples, rate=48_000, **settings):
    path = folder / "sound.wav"
    soundfile.write(path, samples, rate, subtype="FLOAT")
    return SoundParameters(kind="wav", file=str(path), **settings)


@pytest.mark.parametrize("kind", KINDS)
def test_level_length_and_type(kind):
    sound = SoundParameters(kind=kind, level_pa=0.2, on_s=0.3)
    samples = make_waveform(sound)
    assert samples.dtype == np.float32
    assert len(samples) % 30_000 == 0
    middle = samples[EDGE : 30_000 - EDGE].astype(float)
    # The loudspeaker gives at most four times the level.
    peak = np.abs(samples).max()
    assert peak <= 0.8 * (1 + 1e-6)
    if peak < 0.79:
        assert np.sqrt(np.mean(middle**2)) == pytest.approx(0.2, rel=0.01)
    else:
        assert 0.15 < np.sqrt(np.mean(middle**2)) < 0.2


@pytest.mark.parametrize("kind", KINDS)
def test_within_the_band_of_the_microphones(kind):
    samples = make_waveform(SoundParameters(kind=kind))[:50_000].astype(float)
    assert share_outside(samples, 50.0, 18_000.0) < 1e-3


def lines(samples, *frequencies):
    """Amplitudes of lines at whole Hz, in the second second of three."""
    spectrum = np.abs(np.fft.rfft(samples[FS : 2 * FS].astype(float)))
    return spectrum[list(frequencies)]


def test_the_microphones_pass_half_at_the_ends_of_their_band(tmp_path):
    """A Butterworth filter passes 1/sqrt(2) there, and forth and back a half."""
    t = np.arange(3 * FS) / FS
    tones = sum(np.sin(2 * np.pi * f * t) for f in (50.0, 1_000.0, 18_000.0))
    sound = recording(tmp_path, 0.2 * tones, FS, on_s=3.0, period_s=3.0)
    low, middle, high = lines(make_waveform(sound), 50, 1_000, 18_000)
    np.testing.assert_allclose([low / middle, high / middle], 0.5, rtol=0.01)


def test_horn_is_two_reeds_a_major_third_apart():
    """Phase modulation by b leaves J_0(b) of a line; harmonics fall with n^-0.7."""
    samples = make_waveform(SoundParameters(kind="horn", on_s=3.0, period_s=3.0))
    n = np.array([1, 2, 3, 1, 2, 3])
    f = np.array([380] * 3 + [5 * 380 // 4] * 3) * n
    expected = n**-0.7 * np.abs(j0(2 * np.pi * f * 0.004 / 11.0))
    found = lines(samples, *f)
    np.testing.assert_allclose(found / found[0], expected / expected[0], rtol=0.01)


@pytest.mark.parametrize(
    ("time", "frequency"), [(0.0625, 825.0), (0.125, 1050.0), (0.375, 1050.0)]
)
def test_siren_sweeps_up_and_down_twice_a_second(time, frequency):
    """600 to 1500 Hz in 0.25 s, and back; a square wave's third is a third."""
    samples = make_waveform(SoundParameters(kind="siren", on_s=1.0))
    middle = round(time * FS)
    part = samples[middle - 2_000 : middle + 2_000] * np.hanning(4_000)
    power = np.abs(np.fft.rfft(part)) ** 2
    f = np.fft.rfftfreq(4_000, 1.0 / FS)
    near = abs(f - frequency) < 0.5 * frequency
    third = abs(f - 3.0 * frequency) < 0.9 * frequency
    mean = np.sum(f[near] * power[near]) / power[near].sum()
    assert mean == pytest.approx(frequency, abs=5.0)
    share = power[third].sum() / power[near].sum()
    assert share == pytest.approx(1.0 / 9.0, rel=0.05)


@pytest.mark.parametrize("kind", KINDS)
def test_bursts_begin_and_end_softly(kind):
    """The first and last millisecond stay below a fifth of the peak."""
    samples = np.abs(make_waveform(SoundParameters(kind=kind))[:50_000])
    assert samples[:100].max() < 0.2 * samples.max()
    assert samples[-100:].max() < 0.2 * samples.max()


def test_chirp_fills_the_band_in_every_frame():
    """However a 25 ms frame is cut, each 750 Hz of the band has its share."""
    samples = make_waveform(SoundParameters())[:50_000].astype(float)
    for start in (2_500, 3_100, 11_234):
        power = np.abs(np.fft.rfft(samples[start : start + 2_500])) ** 2
        shares = power[15:195].reshape(10, 18).sum(axis=1) / power.sum()
        assert shares.min() > 0.05


@pytest.mark.parametrize("tone", [200.0, 2_000.0, 17_000.0])
def test_tone_has_its_frequency(tone):
    samples = make_waveform(SoundParameters(kind="tone", tone_hz=tone))
    spectrum = np.abs(np.fft.rfft(samples[:50_000] * np.hanning(50_000)))
    assert np.argmax(spectrum) * 2.0 == pytest.approx(tone, abs=2.0)


def test_noise_follows_its_seed_and_band():
    sound = SoundParameters(kind="band_noise", low_hz=2_000.0, high_hz=4_000.0)
    samples = make_waveform(sound, seed=1)
    np.testing.assert_array_equal(samples, make_waveform(sound, seed=1))
    other = make_waveform(sound, seed=2)
    assert abs(np.corrcoef(samples, other)[0, 1]) < 0.1
    assert share_outside(samples[:50_000].astype(float), 1_800.0, 4_200.0) < 0.1


@pytest.mark.parametrize("rate", [16_000, 44_100, 96_000, 192_000])
def test_file_is_resampled(tmp_path, rate):
    tone = np.sin(2 * np.pi * 1_000.0 * np.arange(rate) / rate)
    samples = make_waveform(recording(tmp_path, tone, rate))
    spectrum = np.abs(np.fft.rfft(samples[:50_000] * np.hanning(50_000)))
    assert np.argmax(spectrum) * 2.0 == pytest.approx(1_000.0, abs=2.0)


def test_file_plays_on_through_the_bursts(tmp_path):
    """A rising sweep of 2 s: burst k plays its part of it, then it repeats."""
    t = np.arange(96_000) / 48_000
    sweep = np.sin(2 * np.pi * (1_000.0 * t + 500.0 * t**2))
    samples = make_waveform(recording(tmp_path, sweep))
    assert len(samples) >= 4 * 50_000
    for k in range(4):
        burst = samples[k * 50_000 : (k + 1) * 50_000].astype(float)
        spectrum = np.abs(np.fft.rfft(burst * np.hanning(50_000))) ** 2
        mean = np.sum(spectrum * np.arange(len(spectrum)) * 2.0) / spectrum.sum()
        # The instantaneous frequency is 1000 + 1000 t.
        assert mean == pytest.approx(1_250.0 + 500.0 * k, abs=20.0)


def test_leading_silence_is_cut(tmp_path):
    tone = np.sin(2 * np.pi * 1_000.0 * np.arange(48_000) / 48_000)
    quiet = np.concatenate([1e-4 * tone, tone])
    samples = make_waveform(recording(tmp_path, quiet))
    # The band-pass rings for some milliseconds before the tone.
    early = samples[1_500:5_000].astype(float)
    late = samples[20_000:40_000].astype(float)
    assert early.std() == pytest.approx(late.std(), rel=0.05)


def test_file_of_several_channels_is_refused(tmp_path):
    stereo = np.random.default_rng(0).standard_normal((4_800, 2)) * 0.1
    with pytest.raises(ValueError, match=r"sound\.file.*2 channels.*mix"):
        make_waveform(recording(tmp_path, stereo))


def test_file_with_nothing_but_an_offset_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"sound\.file.*50 and 18000 Hz"):
        make_waveform(recording(tmp_path, np.full(48_000, 0.5)))


def test_rate_below_twice_the_band_is_refused(tmp_path):
    tone = np.sin(np.arange(8_000))
    sound = recording(tmp_path, tone, 8_000, low_hz=5_000.0)
    with pytest.raises(ValueError, match=r"sound\.file.*8000 Hz.*low_hz"):
        make_waveform(sound)


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"low_hz": 9_000.0}, "low_hz"),
        ({"high_hz": 60_000.0}, "high_hz"),
        ({"on_s": 2.5}, "on_s"),
        ({"on_s": 0.001}, "on_s"),
        ({"level_pa": -1.0}, "level_pa"),
        ({"level_pa": math.nan}, "level_pa"),
        ({"kind": "wav"}, "file"),
        ({"kind": "bell"}, "kind"),
        ({"loudness": 1.0}, "loudness"),
    ],
)
def test_bad_parameters(fields, complaint):
    with pytest.raises(ValidationError, match=complaint):
        SoundParameters(**fields)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_would_not_be_played_is_refused(kind):
    with pytest.raises(ValidationError, match=f"'bell.wav' is not used by .* {kind}"):
        SoundParameters(kind=kind, file="bell.wav")
