"""What is steady, of sounds made to be so or not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import polygamma

from analysis.arrays.heard_sources import (
    is_steady,
    level_scatter_db,
    steered_only,
)
from analysis.arrays.voting.direction_votes import VotePlan, cast_votes
from studies.support.synthetic_speech import speech_like
from systems.sound.array_shape import ArrayShape

RATE, C = 16_000, 343.0
SQUARE = 0.023 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]])


def votes_of(sounds, seed=0):
    """Of sounds from x = 1, -1, ... far away, with noise 40 dB below them."""
    rng = np.random.default_rng(seed)
    samples = 1e-2 * rng.standard_normal((4, len(sounds[0])))
    f = np.fft.rfftfreq(len(sounds[0]), 1.0 / RATE)
    for k, sound in enumerate(sounds):
        early = (-1.0) ** k * SQUARE[:, 0] / C
        turned = np.fft.rfft(sound) * np.exp(2j * np.pi * f * early[:, None])
        samples += np.fft.irfft(turned, len(sound))
    plan = VotePlan.of(ArrayShape.of(SQUARE), C, RATE)
    return cast_votes(plan, plan.blank(), samples)[0]


def noise(seconds=3.0, seed=1):
    return np.random.default_rng(seed).standard_normal(round(seconds * RATE))


@pytest.mark.parametrize("count", [1, 2])
def test_noises_are_steady_and_speech_is_not(count):
    rng = np.random.default_rng(2)
    assert is_steady(votes_of([noise(seed=k) for k in range(count)]))
    assert not is_steady(votes_of([speech_like(rng, 3.0, RATE) for _ in range(count)]))


def test_noise_that_begins_and_ends_is_as_steady_while_it_sounds():
    gated = noise() * ((np.arange(3 * RATE) // RATE) == 1)
    whole, part = (
        level_scatter_db(votes_of([noise()])),
        level_scatter_db(votes_of([gated])),
    )
    assert part == pytest.approx(whole, abs=1.0)


def test_levels_scatter_as_those_of_gaussian_noise():
    """Power of n independent windows is chi-square with 2 n degrees of freedom, whose
    logarithm has the variance psi'(n); windows that overlap count by their correlation
    (Welch 1967)."""
    w = np.hanning(513)[:-1]
    alike = np.array([w[k:] @ w[: len(w) - k] for k in (128, 256, 384)]) / (w @ w)
    n = 4.0 / (1.0 + 2.0 * np.array([0.75, 0.5, 0.25]) @ alike**2)
    expected = 10.0 / np.log(10.0) * np.sqrt(polygamma(1, n))
    assert level_scatter_db(votes_of([noise(10.0)])) == pytest.approx(expected, rel=0.1)


def test_less_than_half_a_second_is_not_known():
    assert level_scatter_db(votes_of([noise(0.3)])) is None
    assert not is_steady(votes_of([noise(0.3)]))


def test_single_bins_are_left_out():
    votes = votes_of([noise()])
    kept = steered_only(votes)
    assert kept.steered.all()
    assert kept.t_s.size == np.count_nonzero(votes.steered)
    assert kept.group_t_s.size == votes.group_t_s.size
