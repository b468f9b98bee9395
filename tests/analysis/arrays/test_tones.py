"""Continuous tones: located, ambiguous, or among echoes."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_geometry import ArrayGeometry
from phonotaxis import InputError, locate

C, RATE = 343.2, 16_000
SQUARE = 0.02285 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
ROW = np.outer((-0.075, -0.025, 0.025, 0.075), (1, 0, 0))


def tones_at(places, sources, seconds=1.0, *, gains=1.0, snr_db=30.0):
    """Plane waves of tones from bearings in deg, at the elevation 10 deg."""
    t = np.arange(round(seconds * RATE)) / RATE
    heard = np.zeros((len(places), t.size))
    for number, (bearing, tones_hz) in enumerate(sources):
        a, h = np.radians([bearing, 10.0])
        u = np.array([np.cos(a) * np.cos(h), np.sin(a) * np.cos(h), np.sin(h)])
        for k, f in enumerate(tones_hz):
            early = places @ u / C
            phase = 2.0 * np.pi * f * (t + early[:, np.newaxis]) + number + 2.0 * k
            heard += np.sin(phase)
    heard *= np.broadcast_to(gains, len(places))[:, np.newaxis]
    noise = np.random.default_rng(4).standard_normal(heard.shape)
    return heard + np.sqrt(0.5) * 10.0 ** (-snr_db / 20.0) * noise


def located(heard, places):
    stated = {"microphones": places.tolist(), "temperature_c": 20.0}
    geometry = ArrayGeometry.model_validate(stated)
    return locate(heard, geometry, sample_rate_hz=RATE)


@pytest.mark.parametrize("frequency", [200.0, 437.0, 1000.0, 2500.0, 3600.0])
@pytest.mark.parametrize("bearing", [50.0, -170.0])
def test_a_tone_below_the_limit_has_one_direction(frequency, bearing):
    told = located(tones_at(SQUARE, [(bearing, [frequency])]), SQUARE).main_source()
    assert abs(told["bearing_deg"] - bearing) < 3.0 * told["bearing_std_deg"]
    assert told["bearing_std_deg"] < 4.0
    elevation, std = told["elevation_deg"], told["elevation_std_deg"]
    assert abs(elevation - 10.0) < 3.0 * std + 1.0


def test_above_the_limit_the_message_names_the_tone_and_its_directions():
    # At 5 kHz and 4.57 cm, the components of the direction are known up to multiples of
    # c / (f d) = 1.502; of the unit vector's sin 50 deg cos 10 deg, -0.75 remains.
    result = located(tones_at(SQUARE, [(50.0, [5000.0])]), SQUARE)
    assert not result.estimates
    (fault,) = result.faults
    assert fault.kind == "tone"
    assert "a tone of 5000 Hz" in fault.message
    assert "bearing -50 or 50 deg" in fault.message
    assert "below 375" in fault.message
    assert "a tone of 5000 Hz" in str(result)


def test_harmonics_resolve_what_one_of_them_leaves_open():
    heard = tones_at(SQUARE, [(50.0, [2600.0, 5200.0])])
    told = located(heard, SQUARE).main_source()
    assert abs(told["bearing_deg"] - 50.0) < 3.0


def test_two_tones_from_two_directions():
    heard = tones_at(SQUARE, [(153.0, [1200.0]), (45.0, [2100.0])])
    bearings = [e.bearing_deg for e in located(heard, SQUARE).estimates]
    near = [min(abs(b - 153.0), abs(b - 45.0)) < 3.0 for b in bearings]
    assert all(near)
    assert np.ptp(bearings) > 90.0


def test_a_row_has_the_mirror_image_as_its_alternative():
    told = located(tones_at(ROW, [(65.0, [1500.0])]), ROW).main_source()
    # The bearing of a row is that of a source at the elevation 0.
    cone = np.degrees(np.arccos(np.cos(np.radians(65.0)) * np.cos(np.radians(10.0))))
    assert abs(told["bearing_deg"] - cone) < 3.0 * told["bearing_std_deg"]
    assert told["ambiguity"] == "front_back"


def test_levels_that_differ_tell_of_echoes():
    heard = tones_at(SQUARE, [(50.0, [800.0])], gains=[1.0, 0.6, 0.8, 1.5])
    result = located(heard, SQUARE)
    assert not result.estimates
    assert [fault.kind for fault in result.faults] == ["tone"]
    assert "echoes" in result.faults[0].message


def test_hum_in_phase_is_no_tone():
    t = np.arange(2 * RATE) / RATE
    hum = sum(np.sin(2.0 * np.pi * f * t) for f in (150.0, 250.0, 350.0))
    noise = 0.05 * np.random.default_rng(1).standard_normal((4, t.size))
    assert not located(hum + noise, SQUARE).estimates


def test_a_tone_among_other_sound_hides_no_late_channels():
    """All but a tenth of the power is that of one line."""
    rest = np.random.default_rng(6).uniform(300.0, 6000.0, 400)
    heard = tones_at(SQUARE, [(50.0, [453.0])], 2.0)
    heard += 0.015 * tones_at(SQUARE, [(50.0, rest)], 2.0)
    heard[2:] = np.roll(heard[2:], 800, axis=1)
    with pytest.raises(InputError, match=r"channels 3 and 4 50\.. ms late"):
        located(heard[:, 800:], SQUARE)
