"""Simulated talkers in rooms, and what is named of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.arrays.voting.direction_votes import VotePlan, cast_votes
from analysis.arrays.voting.vote_peaks import gather_sources
from studies.support.moving_talkers import moving_sound
from studies.support.talker_trials import (
    TALKER_ARRAYS,
    draw_talkers,
    record_talkers,
    score_bearings,
)
from systems.sound.array_shape import ArrayShape


def named_deg(array, talkers, apart, t60_s, seed):
    rng = np.random.default_rng(seed)
    scene = draw_talkers(rng, talkers, apart, t60_s=t60_s)
    samples = record_talkers(scene, TALKER_ARRAYS[array], rng)
    plan = VotePlan.of(ArrayShape.of(TALKER_ARRAYS[array]), 343.0, 16_000.0)
    votes, _ = cast_votes(plan, plan.blank(), samples)
    named = [math.degrees(source.bearing) for source in gather_sources(votes)]
    return score_bearings(named, scene.bearings_deg)


@pytest.mark.parametrize("array", TALKER_ARRAYS)
def test_one_talker_is_one_source_even_where_it_echoes(array):
    for seed, t60_s in enumerate((0.0, 0.4, 0.8)):
        score = named_deg(array, 1, 0.0, t60_s, seed)
        assert (score.found, score.false) == (1, 0)


def test_two_and_three_talkers_in_a_room():
    scores = [
        named_deg("square, 4.6 cm", talkers, 45.0, 0.3, seed)
        for talkers in (2, 3)
        for seed in range(2)
    ]
    assert sum(s.found for s in scores) >= 0.95 * sum(s.talkers for s in scores)
    assert sum(s.false for s in scores) == 0


def test_each_talker_is_found_once():
    score = score_bearings([10.0, 12.0, -175.0], [11.0, 178.0])
    assert (score.found, score.talkers, score.false) == (2, 2, 1)
    assert sorted(score.errors_deg) == pytest.approx([-1.0, 7.0])


def test_more_talkers_than_fit_around_the_array():
    with pytest.raises(ValueError, match="5 at 90 deg do not fit"):
        draw_talkers(np.random.default_rng(0), 5, 90.0, t60_s=0.3)


def test_too_few_voices():
    rng = np.random.default_rng(0)
    scene = draw_talkers(rng, 2, 90.0, t60_s=0.0)
    with pytest.raises(ValueError, match="1 given for 2 talkers"):
        record_talkers(scene, TALKER_ARRAYS["square, 4.6 cm"], rng, voices=[np.ones(9)])


def test_a_sound_that_rests_between_two_places_is_heard_from_both():
    responses = np.zeros((2, 1, 4))
    responses[0, 0, 0], responses[1, 0, 3] = 1.0, 2.0
    sound = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    heard = moving_sound(responses, sound, np.full(5, 0.25))
    assert heard[0] == pytest.approx([0.75, 0.0, 0.0, 0.5, 0.0])
    with pytest.raises(ValueError, match="stay within"):
        moving_sound(responses, sound, np.full(5, 1.5))
