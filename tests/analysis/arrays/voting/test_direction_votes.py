"""Votes of waves whose directions are known, however the sound is cut into blocks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.arrays.voting.direction_votes import VotePlan, cast_votes
from analysis.arrays.voting.vote_peaks import gather_sources
from analysis.arrays.voting.vote_records import join_votes
from studies.support.synthetic_speech import speech_like
from systems.sound.array_shape import ArrayShape

RATE, C = 16_000, 343.0
SQUARE = 0.023 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]])
TETRAHEDRON = 0.03 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
ROW = np.array([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])


def waves(places, sounds, directions, noise=1e-3, seed=0):
    """(n, samples) of plane waves; directions (azimuth, elevation) in deg."""
    places = np.pad(places, ((0, 0), (0, 3 - places.shape[1])))
    length = sounds[0].size
    f = np.fft.rfftfreq(length, 1.0 / RATE)
    heard = noise * np.random.default_rng(seed).standard_normal((len(places), length))
    for sound, (azimuth, elevation) in zip(sounds, directions, strict=True):
        a, e = math.radians(azimuth), math.radians(elevation)
        u = np.array(
            [math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e)]
        )
        early = places @ u / C
        heard += np.fft.irfft(
            np.fft.rfft(sound) * np.exp(2j * np.pi * f * early[:, None]), length
        )
    return heard


def talkers(count, seconds=2.0, seed=0):
    rng = np.random.default_rng(seed)
    return [speech_like(rng, seconds, RATE) for _ in range(count)]


def votes_of(places, samples, block=1_600):
    plan = VotePlan.of(ArrayShape.of(places), C, RATE)
    memory, parts = plan.blank(), []
    for k in range(0, samples.shape[1], block):
        votes, memory = cast_votes(plan, memory, samples[:, k : k + block])
        parts.append(votes)
    return join_votes(parts)


@pytest.mark.parametrize("places", [SQUARE, TETRAHEDRON])
@pytest.mark.parametrize(("azimuth", "elevation"), [(25.0, 10.0), (-170.0, 30.0)])
def test_a_far_talker_has_all_votes(places, azimuth, elevation):
    samples = waves(places, talkers(1), [(azimuth, elevation)])
    votes = votes_of(places, samples)
    single = ~votes.steered
    assert single.sum() > 300
    off = np.degrees(votes.azimuth[single]) - azimuth
    assert np.median(np.abs((off + 180.0) % 360.0 - 180.0)) < 1.0
    assert np.degrees(np.median(votes.elevation[single])) == pytest.approx(
        elevation, abs=1.5
    )
    (source,) = gather_sources(votes)
    assert math.degrees(source.bearing) == pytest.approx(azimuth, abs=0.5)
    assert source.elevation is not None
    assert source.elevation is not None
    assert math.degrees(source.elevation) == pytest.approx(elevation, abs=1.5)
    assert source.share > 0.95
    assert source.confidence == pytest.approx(1.0)


def test_steered_votes_are_more_exact_than_their_grid():
    row = np.array([[0.0, y] for y in (-0.075, -0.025, 0.025, 0.075)])
    off = []
    for k, azimuth in enumerate(np.linspace(-31.0, 29.0, 7)):
        votes = votes_of(row, waves(row, talkers(1, 1.0, k), [(azimuth, 0.0)]))
        off.append(np.degrees(np.median(votes.azimuth[votes.steered])) - azimuth)
    # The step of the grid is 3.3 deg, and errors of up to half of it are equally
    # likely without the parabola: an RMS of 0.95 deg.
    assert np.sqrt(np.mean(np.square(off))) < 0.5


@pytest.mark.parametrize("apart", [30.0, 90.0])
def test_talkers_at_once_are_told_apart(apart):
    directions = [(-60.0 + apart * k, 10.0) for k in range(3)]
    samples = waves(SQUARE, talkers(3, 3.0), directions)
    found = sorted(
        math.degrees(s.bearing) for s in gather_sources(votes_of(SQUARE, samples))
    )
    assert found == pytest.approx([a for a, _ in directions], abs=2.0)


def test_blocks_do_not_matter():
    samples = waves(SQUARE, talkers(2), [(40.0, 0.0), (-80.0, 0.0)])
    whole, parts = (
        votes_of(SQUARE, samples, samples.shape[1]),
        votes_of(SQUARE, samples, 397),
    )
    assert abs(whole.azimuth.size - parts.azimuth.size) <= 0.001 * whole.azimuth.size
    bearings = [[s.bearing for s in gather_sources(votes)] for votes in (whole, parts)]
    assert bearings[0] == pytest.approx(bearings[1], abs=1e-3)


def test_an_array_with_wide_pairs_votes_by_the_steered_response():
    """Half a wavelength fits between neighbors only up to 430 Hz."""
    samples = waves(ROW, talkers(1), [(35.0, 0.0)])
    votes = votes_of(ROW, samples)
    assert votes.steered.all()
    (source,) = gather_sources(votes)
    assert math.degrees(source.bearing) == pytest.approx(35.0, abs=2.0)
    assert source.elevation is None


def test_a_steady_noise_is_one_source():
    noise = np.random.default_rng(3).standard_normal(2 * RATE)
    samples = waves(SQUARE, [noise], [(120.0, 0.0)])
    (source,) = gather_sources(votes_of(SQUARE, samples))
    assert math.degrees(source.bearing) == pytest.approx(120.0, abs=2.0)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_silence_and_noise_of_each_channel_alone_are_no_source(level):
    noise = np.random.default_rng(4).standard_normal((4, 3 * RATE))
    assert gather_sources(votes_of(SQUARE, level * noise)) == []


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda x: x[:3], "block: .* each of the 4 microphones"),
        (lambda x: x * np.nan, "block: channel 1: sample 0 is nan"),
    ],
)
def test_blocks_that_cannot_be_heard(change, says):
    plan = VotePlan.of(ArrayShape.of(SQUARE), C, RATE)
    with pytest.raises(ValueError, match=says):
        cast_votes(plan, plan.blank(), change(np.ones((4, 100))))


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"c": 0.34}, "c: .* m/s"),
        ({"sample_rate_hz": 10.0}, "sample_rate_hz"),
        ({"band_hz": (500.0, 400.0)}, "band_hz"),
    ],
)
def test_plans_that_make_no_sense(settings, says):
    given = {"c": C, "sample_rate_hz": RATE, **settings}
    with pytest.raises(ValueError, match=says):
        VotePlan.of(ArrayShape.of(SQUARE), **given)


def test_an_upright_row_has_no_bearings_to_vote_for():
    upright = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.2]]
    with pytest.raises(ValueError, match=r"microphones: .* gives no bearings"):
        VotePlan.of(ArrayShape.of(upright), C, RATE)


@pytest.mark.parametrize("elevation", [75.0, 82.0, -80.0, 89.0])
def test_a_steep_talker_is_one_source(elevation):
    places = TETRAHEDRON if elevation < 0.0 else SQUARE
    samples = waves(places, talkers(1), [(50.0, elevation)])
    (source,) = gather_sources(votes_of(places, samples))
    off = math.degrees(source.bearing) - 50.0
    assert abs(off) <= max(1.0, 3.0 * math.degrees(source.bearing_std))
    assert source.elevation is not None
    assert math.degrees(source.elevation) == pytest.approx(elevation, abs=2.0)


def test_few_phases_fit_if_the_channels_are_in_a_wrong_order():
    samples = waves(SQUARE, talkers(1), [(70.0, 10.0)])
    shares = []
    for order in ([0, 1, 2, 3], [0, 2, 1, 3]):
        waves_found, fitting = votes_of(SQUARE, samples[order]).group_fits.sum(axis=0)
        shares.append(fitting / waves_found)
    assert shares[0] > 0.75
    assert shares[1] < 0.2


def test_a_talker_has_more_weight_than_a_fan_that_sounds_all_the_time():
    (voice,) = talkers(1, 3.0)
    fan = np.random.default_rng(5).standard_normal(voice.size)
    samples = waves(SQUARE, [voice, 0.35 * fan], [(0.0, 0.0), (120.0, 0.0)])
    votes = votes_of(SQUARE, samples)
    most = max(gather_sources(votes, by_level=False), key=lambda s: s.share)
    assert math.degrees(most.bearing) == pytest.approx(120.0, abs=3.0)
    first = gather_sources(votes)[0]
    assert math.degrees(first.bearing) == pytest.approx(0.0, abs=3.0)
    assert first.rises > 0.5
    assert most.rises < 0.1
