"""Arrays of recorders: calls at microphones far apart, and bats."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.aligned_delays import AlignedDelays
from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.call_placement import place_call
from analysis.arrays.call_search import CallSearch
from analysis.arrays.standing_sounds import sounding_band, standing_sound
from phonotaxis import listen, locate
from systems.framework.input_error import InputError

C, RATE = 343.2, 24_000
SQUARE = np.array([[0, 0, 1.5], [50, 0, 1.5], [50, 50, 2.5], [0, 50, 1.0]])
FIVE = np.vstack((SQUARE, [[25.0, 20.0, 6.0]]))


def sweep(from_hz, to_hz, seconds, rate):
    t = np.arange(round(seconds * rate)) / rate
    phase = from_hz * t + 0.5 * (to_hz - from_hz) / seconds * t**2
    return np.sin(2.0 * np.pi * phase) * np.hanning(t.size) ** 0.3


def record(places, source, played, rate, *, noise, seed=1):
    """Each channel delayed by its distance and fainter by its distance, with noise."""
    heard = np.random.default_rng(seed).standard_normal((len(places), played.size))
    heard *= noise
    f = np.fft.rfftfreq(2 * played.size, 1.0 / rate)
    spectrum = np.fft.rfft(played, 2 * played.size)
    for k, r in enumerate(np.linalg.norm(places - source, axis=1)):
        delayed = np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * r / C))
        heard[k] += delayed[: played.size] / r
    return heard


def call_at(t_s, seconds, rate=RATE, sound=None):
    played = np.zeros(round(seconds * rate))
    sound = sweep(2500.0, 6000.0, 0.3, rate) if sound is None else sound
    first = round(t_s * rate)
    played[first : first + sound.size] += sound
    return played


def geometry(places, std=0.02, **more):
    stated = {"temperature_c": 20.0, **more}
    return ArrayGeometry.model_validate(
        {"microphones": places.tolist(), "position_std_m": std, **stated}
    )


def true_delays(places, source):
    at = np.linalg.norm(places - source, axis=1) / C
    return at[1:] - at[0]


@pytest.mark.parametrize("seed", [1, 2])
def test_delays_of_a_call_in_noise_as_loud_as_the_call(seed):
    source = np.array([70.0, 20.0, 8.0])
    played = call_at(0.7, 4.0)
    # At 50 m, the power of the sweep is 0.5 / 50^2.
    heard = record(SQUARE, source, played, RATE, noise=0.7 / 50.0, seed=seed)
    array = geometry(SQUARE).known
    search = CallSearch(heard.astype(np.float32), RATE, (60.0, 10_000.0), array)
    (found,) = search.sightings()
    std = np.sqrt(np.diag(found.covariance))
    assert np.all(std < 1e-5)
    errors = found.tau - true_delays(SQUARE, source)
    assert np.all(np.abs(errors) < 4.0 * std + 1e-6)
    low, high = search.found_band_hz
    assert 2000.0 < low < 2900.0
    assert 5500.0 < high < 6500.0


def test_the_position_of_a_call_among_the_recorders():
    source = np.array([31.0, 22.0, 4.0])
    heard = record(FIVE, source, call_at(0.7, 3.0), RATE, noise=0.003)
    result = locate(heard, geometry(FIVE), sample_rate_hz=RATE)
    told = result.main_source()
    std = np.sqrt(np.diag(told["position_covariance_m2"]))
    assert np.all(np.abs(np.array(told["position_m"]) - source) < 3.0 * std + 0.01)
    assert np.all(std[:2] < 0.3)
    assert not result.faults


def test_a_recorder_out_of_earshot_does_not_count():
    places = np.vstack((FIVE, [[220.0, 10.0, 3.0]]))
    source = np.array([20.0, 35.0, 5.0])
    heard = record(places, source, call_at(0.7, 4.0), RATE, noise=0.01)
    heard[5] = 0.01 * np.random.default_rng(9).standard_normal(heard.shape[1])
    array = geometry(places).known
    search = CallSearch(heard.astype(np.float32), RATE, (60.0, 10_000.0), array)
    (found,) = search.sightings()
    std = np.sqrt(np.diag(found.covariance))
    assert std[4] > 0.1
    assert np.all(std[:4] < 1e-5)
    placed = place_call(found, array)
    assert placed is not None
    at = placed.fix.p_AS + places.mean(axis=0)
    assert np.linalg.norm((at - source)[:2]) < 0.5


def test_shots_within_a_kilometer_and_coordinates_of_a_map():
    places = 20.0 * FIVE * [1.0, 1.0, 0.5] + [481_000.0, 5_212_000.0, 300.0]
    source = np.array([481_300.0, 5_212_500.0, 310.0])
    t = np.arange(240) / 8000.0
    shot = (1.0 - t / 0.003) * np.exp(-t / 0.003)
    played = call_at(0.5, 7.0, 8000, shot)
    heard = record(places, source, played, 8000, noise=2e-5)
    told = locate(heard, geometry(places, 0.5), sample_rate_hz=8000).main_source()
    error = np.array(told["position_m"])[:2] - source[:2]
    std = np.sqrt(np.diag(told["position_covariance_m2"]))[:2]
    assert np.all(np.abs(error) < 3.0 * std)
    assert np.all(std < 10.0)


@pytest.mark.parametrize("size_m", [0.3, 1.5])
def test_bats_without_a_stated_band(size_m):
    star = size_m * np.array(
        [[0, 0, 0], [0, 0.6, 0], [0.5, -0.3, 0], [-0.5, -0.3, 0.3]]
    )
    rate, source = 384_000, np.array([2.0, 3.0, 1.0])
    call = sweep(80e3, 30e3, 0.005, rate)
    played = call_at(0.08, 0.2, rate, call) + call_at(0.14, 0.2, rate, call)
    heard = record(star, source, played, rate, noise=0.03)
    result = locate(heard, geometry(star, 0.0005), sample_rate_hz=rate)
    low, high = result.array["band_hz"]
    assert 20e3 < low < 35e3
    assert 70e3 < high < 90e3
    told = result.main_source()
    off = source - star.mean(axis=0)
    true = np.degrees(np.arctan2(off[1], off[0]))
    assert abs(told["bearing_deg"] - true) < max(1.0, 3.0 * told["bearing_std_deg"])


def test_places_above_and_below_nearly_level_recorders():
    """The stated errors cover the truth, although two places may fit."""
    rng = np.random.default_rng(3)
    places = SQUARE * [1.0, 1.0, 2.0]
    z = []
    for _ in range(25):
        source = np.append(rng.uniform(-40.0, 90.0, 2), rng.uniform(-5.0, 15.0))
        array = geometry(places + 0.1 * rng.standard_normal((4, 3)), 0.1).known
        tau = true_delays(places, source)
        delays = AlignedDelays(tau, 1e-12 * (np.eye(3) + 1.0), 1.0)
        placed = place_call(delays, array)
        assert placed is not None
        off = source - places.mean(axis=0)
        fix = placed.fix
        turn = fix.bearing - np.arctan2(off[1], off[0])
        height = fix.elevation - np.arctan2(off[2], np.hypot(off[0], off[1]))
        z.append([np.angle(np.exp(1j * turn)) / fix.bearing_std])
        z[-1].append(height / fix.elevation_std)
    sizes = np.abs(z)
    assert np.all(np.mean(sizes < 2.0, axis=0) > 0.85)
    assert sizes.max() < 5.0


def test_delays_that_fit_no_place():
    array = geometry(FIVE).known
    tau = true_delays(FIVE, np.array([60.0, 10.0, 3.0]))
    tau[1] += 0.02
    delays = AlignedDelays(tau, 1e-12 * (np.eye(4) + 1.0), 1.0)
    assert place_call(delays, array) is None


def test_positions_in_millimeters_are_named():
    places = 0.023 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    heard = record(places, np.array([1.0, 1.5]), call_at(0.3, 1.0), RATE, noise=0.01)
    result = locate(heard, (1000.0 * places).tolist(), sample_rate_hz=RATE)
    assert [fault.kind for fault in result.faults] == ["size"]
    assert "positions in m" in result.faults[0].message


def test_listen_needs_a_compact_array(tmp_path):
    with pytest.raises(InputError, match="too far for a live direction"):
        listen(tmp_path / "a.wav", SQUARE.tolist())


def test_sounds_are_kept_and_noise_is_not():
    rng = np.random.default_rng(1)
    sound = call_at(0.5, 2.0)
    noisy = (sound + 0.05 * rng.standard_normal(sound.size)).astype(np.float32)
    kept = standing_sound(noisy, RATE, (300.0, 10_000.0))
    during = slice(round(0.55 * RATE), round(0.75 * RATE))
    error = kept.samples[during] - sound[during]
    assert np.std(error) < 0.1 * np.std(sound[during])
    assert np.mean(kept.samples[RATE:] ** 2) < 0.02 * 0.05**2
    band = sounding_band(kept, RATE)
    assert band is not None
    low, high = band
    assert 2300.0 < low < 2800.0
    assert 5700.0 < high < 6300.0


def test_silence_has_no_band():
    silence = np.zeros(RATE, dtype=np.float32)
    assert sounding_band(standing_sound(silence, RATE, (300.0, 10_000.0)), RATE) is None
