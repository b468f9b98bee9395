"""Sources of votes that are made up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import erfinv

from analysis.arrays.voting.vote_peaks import gather_sources
from analysis.arrays.voting.vote_records import DirectionVotes


def votes_at(single_deg, steered_deg):
    azimuth = np.radians(np.concatenate((single_deg, steered_deg)))
    count = azimuth.size
    return DirectionVotes(
        np.arange(count) * 0.01,
        azimuth,
        np.full(count, np.nan),
        np.ones(count),
        np.ones(count),
        np.ones(count),
        np.arange(count) >= len(single_deg),
        np.empty(0),
        np.empty((0, 24)),
        np.empty((0, 2)),
    )


def around(center, count, rng):
    return center + 3.0 * rng.standard_normal(count)


def test_where_both_kinds_of_votes_agree_is_a_source():
    rng = np.random.default_rng(1)
    single = np.concatenate([around(c, 60, rng) for c in (-50.0, 40.0, 110.0)])
    steered = np.concatenate([around(c, 20, rng) for c in (-50.0, 40.0, -130.0)])
    found = sorted(
        math.degrees(s.bearing) for s in gather_sources(votes_at(single, steered))
    )
    assert found == pytest.approx([-50.0, 40.0], abs=1.5)


@pytest.mark.parametrize("apart", [0.0, 6.0])
def test_kinds_of_votes_that_differ_state_a_larger_error(apart):
    # Normal quantiles have exactly this scatter, and no luck.
    quantiles = np.sqrt(2.0) * erfinv(np.linspace(-0.99, 0.99, 90))
    single = 20.0 + 0.5 * apart + 2.0 * quantiles
    steered = 20.0 - 0.5 * apart + 2.0 * quantiles[::9]
    (source,) = gather_sources(votes_at(single, steered))
    # Ten independent votes of either kind: the bearing is halfway, and two values
    # apart by d have the standard deviation d / 2.
    assert math.degrees(source.bearing) == pytest.approx(20.0, abs=0.3)
    assert math.degrees(source.common_std) == pytest.approx(
        math.hypot(0.5 * apart, 0.25), abs=0.25
    )


def test_where_no_single_bin_votes_is_no_source():
    rng = np.random.default_rng(2)
    (source,) = gather_sources(votes_at(around(20.0, 40, rng), around(-20.0, 40, rng)))
    assert math.degrees(source.bearing) == pytest.approx(20.0, abs=1.5)


def test_any_votes_can_be_gathered():
    rng = np.random.default_rng(2)
    for _ in range(300):
        centers = rng.uniform(-180.0, 180.0, 3)
        single = rng.choice(centers, 30) + rng.normal(0.0, 12.0, 30)
        steered = rng.choice(centers, 12) + rng.normal(0.0, 12.0, 12)
        for source in gather_sources(votes_at(single, steered)):
            assert math.isfinite(source.bearing_std)
            assert 0.0 <= source.confidence <= 1.0


@pytest.mark.parametrize(("votes", "sources"), [(40, 1), (90, 2)])
def test_few_votes_that_agree_are_an_echo(votes, sources):
    rng = np.random.default_rng(3)
    talker = 6.0 * rng.standard_normal(300)
    narrow = 80.0 + 0.5 * rng.standard_normal(votes)
    steered = np.append(talker[:40], narrow[:4])
    found = gather_sources(votes_at(np.append(talker, narrow), steered))
    assert len(found) == sources
    assert math.degrees(found[0].bearing) == pytest.approx(0.0, abs=1.5)
