"""Arrays on a rigid sphere, in waves that are scattered by the series."""

from __future__ import annotations

import math

import numpy as np
import pytest

from phonotaxis import (
    ArrayGeometry,
    InputError,
    calibrate_delays,
    locate,
    locate_delays,
)
from studies.support.sphere_recordings import sphere_recording, spiral_sphere
from studies.support.synthetic_speech import speech_like
from systems.sound.rigid_sphere import surface_pressure

C, RATE = 343.2, 16_000.0
TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / math.sqrt(
    3.0
)


def on_sphere(toward, radius, **fields):
    return ArrayGeometry.model_validate(
        {
            "microphones": (radius * toward).tolist(),
            "sound_speed": C,
            "body": {"sphere_m": radius},
            **fields,
        }
    )


def unit(bearing_deg, elevation_deg):
    azimuth, height = np.radians([bearing_deg, elevation_deg])
    level = math.cos(height)
    return np.array(
        [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(height)]
    )


def heard(toward, radius, at, seed, seconds=1.5):
    rng = np.random.default_rng(seed)
    return sphere_recording(
        toward,
        radius,
        unit(*at),
        speech_like(rng, seconds, RATE),
        RATE,
        c=C,
        snr_db=30.0,
        rng=rng,
    )


@pytest.mark.parametrize(
    ("toward", "radius", "at"),
    [
        (TETRAHEDRON, 0.042, (-130.0, 25.0)),
        (spiral_sphere(8), 0.042, (78.0, -14.0)),
        (spiral_sphere(8), 0.09, (-20.0, 40.0)),
    ],
    ids=["4 on 4.2 cm", "8 on 4.2 cm", "8 on 9 cm"],
)
def test_a_talker_around_a_sphere(toward, radius, at):
    found = locate(
        heard(toward, radius, at, 5), on_sphere(toward, radius), sample_rate_hz=RATE
    )
    told = found.main_source()
    assert not found.faults
    assert abs(told["bearing_deg"] - at[0]) < max(2.0 * told["bearing_std_deg"], 2.0)
    assert abs(told["elevation_deg"] - at[1]) < max(
        2.0 * told["elevation_std_deg"], 2.0
    )
    assert told["bearing_std_deg"] < 5.0
    best = max(found.heard.sources, key=lambda source: source.confidence)
    assert abs(best.bearing_deg - at[0]) < 8.0


def test_without_the_sphere_the_message_names_it():
    recording = heard(TETRAHEDRON, 0.042, (-130.0, 25.0), 6)
    found = locate(recording, (0.042 * TETRAHEDRON).tolist(), sample_rate_hz=RATE)
    assert any("body" in note for note in found.notes)


def test_delays_on_a_sphere_give_the_direction():
    """Pure tones below the band's middle: their phase delays, from the series."""
    toward, radius = spiral_sphere(12), 0.05
    geometry = on_sphere(toward, radius, band=[300.0, 1000.0])
    for at in ((10.0, 0.0), (140.0, 35.0), (-75.0, -50.0)):
        angle = np.arccos(toward @ unit(*at))
        ka = 2.0 * math.pi * 600.0 * radius / C
        phase = np.angle(surface_pressure(np.array([ka]), angle))[0]
        arrival = phase / (2.0 * math.pi * 600.0)
        (e,) = locate_delays(
            arrival[1:] - arrival[0],
            geometry,
            covariance=1e-12 * (np.eye(11) + 1.0),
        ).estimates
        assert e.bearing_deg == pytest.approx(at[0], abs=1.0)
        assert e.elevation_deg == pytest.approx(at[1], abs=1.0)
        assert e.range_m is None


def test_microphones_off_the_sphere_are_refused():
    with pytest.raises(ValueError, match="microphone 2 is"):
        on_sphere(TETRAHEDRON * np.array([[1.0], [1.3], [1.0], [1.0]]), 0.042)


def test_arrays_on_a_sphere_cannot_be_calibrated():
    with pytest.raises(InputError, match="cannot be calibrated"):
        calibrate_delays(
            np.zeros((3, 3)), on_sphere(TETRAHEDRON, 0.042), covariance=np.eye(3)
        )
