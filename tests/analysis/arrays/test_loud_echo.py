"""An echo louder than the direct sound, by plane waves in closed form."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.loud_echo import first_sound
from analysis.arrays.recording_spectra import RecordingSpectra
from phonotaxis import locate
from studies.support.hearing_cases.errors_in_rooms import ARRAYS, RATE, C, recorded
from studies.support.hearing_cases.loud_echoes import with_echo
from studies.support.synthetic_speech import speech_like
from systems.sound.array_shape import ArrayShape

SQUARE, CIRCLE = ARRAYS["square, 6.5 cm"], ARRAYS["circle of 8, 20 cm"]
ROW = np.array([[x, 0.0, 0.0] for x in (-0.075, -0.025, 0.025, 0.075)])
DIRECT_DEG, ECHO_DEG = 30.0, 140.0


def echoing(places, sound, later_s, gain_db):
    return with_echo(
        places,
        sound,
        DIRECT_DEG,
        ECHO_DEG,
        later_s=later_s,
        gain_db=gain_db,
        seed=1,
    )


def first(samples, places, bearing_deg):
    shape = ArrayShape.of(places)
    spectra = RecordingSpectra(
        samples.astype(np.float32), RATE, 300.0, 7200.0, shape.max_delay(C), (1.0,)
    )
    height = math.radians(8.0)
    azimuth = math.radians(bearing_deg)
    u = [math.cos(azimuth), math.sin(azimuth), math.tan(height)]
    return first_sound(spectra, shape, C, math.cos(height) * np.array(u))


@pytest.mark.parametrize("places", [SQUARE, CIRCLE, ROW], ids=["4", "8", "row"])
@pytest.mark.parametrize("later_s", [2.5e-3, 12e-3])
@pytest.mark.parametrize("gain_db", [1.0, 10.0])
def test_the_first_sound_has_its_direction_and_time(places, later_s, gain_db):
    rng = np.random.default_rng(2)
    for sound in (speech_like(rng, 2.0, RATE), rng.standard_normal(RATE)):
        found = first(echoing(places, sound, later_s, gain_db), places, ECHO_DEG)
        assert found.earlier_s == pytest.approx(later_s, abs=5e-5)
        bearing_deg = math.degrees(math.atan2(found.u[1], found.u[0]))
        assert bearing_deg == pytest.approx(DIRECT_DEG, abs=12.0)
        # The autocorrelation of a sound and its echo of gain g is g / (1 + g^2) of
        # the whole, and so at most 1 / g of that of the echo alone.
        assert 0.2 < found.height < 10.0 ** (-gain_db / 20.0)
        assert found.ratio > 1.15


@pytest.mark.parametrize("places", [SQUARE, CIRCLE])
def test_nothing_comes_before_direct_sound(places):
    """Neither a fainter echo nor a room is a loud echo."""
    rng = np.random.default_rng(3)
    fainter = echoing(places, speech_like(rng, 2.0, RATE), 5e-3, -3.0)
    found = first(fainter, places, DIRECT_DEG)
    assert found.ratio < 1.1
    drawn = recorded(places, 0.4, 8, seconds=1.5)
    found = first(drawn.samples, places, drawn.bearing_deg)
    assert found.ratio < 1.1 or found.height < 0.2


def test_locate_names_the_echo_and_the_direction_of_the_direct_sound():
    sound = np.random.default_rng(4).standard_normal(RATE)
    geometry = ArrayGeometry.model_validate(
        {"microphones": SQUARE.tolist(), "sound_speed": C}
    )
    found = locate(echoing(SQUARE, sound, 5e-3, 6.0), geometry, sample_rate_hz=RATE)
    (fault,) = found.faults
    assert fault.kind == "echo"
    said = re.search(
        r"from (\d+) deg is an echo.* 5\.0 ms before from about (\d+)", fault.message
    )
    assert said is not None
    assert [float(deg) for deg in said.groups()] == pytest.approx(
        [ECHO_DEG, DIRECT_DEG], abs=12.0
    )
    assert all(source.confidence <= 0.5 for source in found.agreed.sources)
    assert found.number_of_sources is None
