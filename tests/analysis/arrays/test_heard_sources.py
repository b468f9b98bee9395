"""Sources and tracks of recordings whose talkers and noises are known."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.heard_sources import heard_sources
from studies.support.moving_talkers import moving_sound, ring_scene
from studies.support.synthetic_speech import speech_like
from studies.support.talker_trials import (
    TALKER_ARRAYS,
    heard_from,
    impulse_responses,
    talker_sounds,
    with_noise,
)
from systems.sound.array_shape import ArrayShape

RATE, C = 16_000, 343.0
PLACES = TALKER_ARRAYS["square, 4.6 cm"]


@pytest.fixture(scope="module")
def ring():
    """Bearings every 4 deg from -40 to 40 deg, and what is heard from there."""
    scene = ring_scene(-40.0, 40.0, step_deg=4.0)
    return list(scene.bearings_deg), impulse_responses(scene, PLACES)


def heard(samples, rng):
    noisy = with_noise(samples, 25.0, rng).astype(np.float32)
    return heard_sources(noisy, ArrayShape.of(PLACES), C, RATE, (300.0, 7_200.0))


def still(ring, bearings, sounds):
    at, responses = ring
    return sum(
        heard_from(responses[at.index(b)], s)
        for b, s in zip(bearings, sounds, strict=True)
    )


def walking(ring, way_deg, sound):
    at, responses = ring
    return moving_sound(responses, sound, (way_deg - at[0]) / 4.0)


def test_talkers_are_told_apart_and_are_sure(ring):
    rng = np.random.default_rng(1)
    told = heard(still(ring, [-24.0, 20.0], talker_sounds(2, rng)), rng)
    assert not told.steady
    bearings = sorted(source.bearing_deg for source in told.sources)
    assert bearings == pytest.approx([-24.0, 20.0], abs=2.0)
    assert min(source.confidence for source in told.sources) > 0.6
    assert {round(np.sign(track.bearing_deg[-1])) for track in told.tracks} == {-1, 1}


@pytest.mark.parametrize("bearings", [[16.0], [-28.0, 28.0]])
def test_how_many_steady_noises_there_are_is_not_told(ring, bearings):
    rng = np.random.default_rng(2)
    noises = rng.standard_normal((len(bearings), 2 * RATE))
    told = heard(still(ring, bearings, noises), rng)
    assert told.steady
    (source,) = told.sources
    assert min(abs(source.bearing_deg - b) for b in bearings) < 6.0
    assert source.confidence <= 0.5
    assert all(track.confidence <= 0.5 for track in told.tracks)


def test_one_who_walks_is_one_source_and_one_track(ring):
    rng = np.random.default_rng(3)
    way = np.linspace(-38.0, 38.0, 5 * RATE)
    told = heard(walking(ring, way, speech_like(rng, 5.0, RATE)), rng)
    assert len(told.sources) == 1
    (track,) = told.tracks
    t_s = np.array(track.t_s)
    assert t_s[0] < 0.5
    off = np.array(track.bearing_deg) - np.interp(t_s, np.arange(way.size) / RATE, way)
    assert np.sqrt(np.mean(off**2)) < 4.0


def test_two_who_cross_keep_their_identities(ring):
    rng = np.random.default_rng(4)
    way = np.linspace(-38.0, 38.0, 5 * RATE)
    sounds = talker_sounds(2, rng, seconds=5.0)
    told = heard(walking(ring, way, sounds[0]) + walking(ring, -way, sounds[1]), rng)
    first, second = told.tracks
    assert first.bearing_deg[0] * second.bearing_deg[0] < 0.0
    for track in (first, second):
        assert abs(track.bearing_deg[0] + track.bearing_deg[-1]) < 20.0
        assert abs(track.bearing_deg[-1]) > 20.0
