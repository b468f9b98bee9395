"""What levels say of a near source, and do not say of a far one."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from hypothesis import given, strategies as st

from analysis.arrays.frame_delays import (
    FrameDelays,
    exchanged_channels,
    levels_contradict,
)
from systems.hearing.multilateration import locate_source
from systems.sound.array_shape import ArrayShape

C = 340.0
ROW = ArrayShape.of([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])


def fix_at(p_AS):
    """The fix of exact delays, and the ranges from the microphones."""
    ranges = np.linalg.norm(ROW.p_AM - p_AS, axis=1)
    tau = (ranges[1:] - ranges[0]) / C
    return locate_source(tau, 1e-14 * (np.eye(2) + 1.0), ROW, C), ranges


def test_levels_of_a_near_source():
    near = np.array([0.1, 0.3])
    fix, ranges = fix_at(near)
    gains = 10 ** (np.array([1.0, -1.0, 1.0]) / 20)
    assert not levels_contradict(3.0 * gains / ranges, fix, ROW)
    assert levels_contradict(gains, fix, ROW)
    assert levels_contradict(ranges, fix, ROW)
    assert not levels_contradict(gains, fix.without_range(), ROW)
    fix, ranges = fix_at(20.0 * near)
    assert not levels_contradict(ranges, fix, ROW)


def test_nearer_than_a_millimeter_counts_as_one():
    """Of 1 mm, 0.4 m and 0.8 m: 58 dB, of which equal levels have nothing."""
    fix, _ = fix_at(np.array([0.1, 0.3]))
    at_one = replace(fix, p_AS=ROW.p_AM[0])
    assert levels_contradict(np.ones(3), at_one, ROW)
    assert not levels_contradict(1.0 / np.array([1e-3, 0.4, 0.8]), at_one, ROW)


@given(
    st.floats(-1.4, 1.4),
    st.floats(0.15, 5.0),
    st.lists(st.floats(-0.69, 0.69), min_size=3, max_size=3),
)
def test_true_places_agree_with_levels_of_unequal_microphones(angle, distance, db):
    """From 3 dB of spread on, gains within 0.69 dB never halve what 1/R asks."""
    p_AS = distance * np.array([np.cos(angle), np.sin(angle)])
    fix, ranges = fix_at(p_AS)
    levels = 10 ** (np.array(db) / 20) / ranges
    assert not levels_contradict(levels, fix, ROW)


def test_exchanged_neighbors_never_pass_for_a_near_source():
    """Off broadside, where exchanges change little, and below the 3 dB of 0.35 m."""
    near = 0
    angles, distances = np.linspace(0.25, 1.2, 40), np.linspace(1.5, 5.0, 20)
    for angle, distance, first in product(angles, distances, (0, 1)):
        p_AS = distance * np.array([np.cos(angle), np.sin(angle)])
        ranges = np.linalg.norm(ROW.p_AM - p_AS, axis=1)
        ranges[[first, first + 1]] = ranges[[first + 1, first]]
        tau = (ranges[1:] - ranges[0]) / C
        fix = locate_source(tau, 1e-12 * (np.eye(2) + 1.0), ROW, C)
        if fix.range_valid and fix.range < 0.35:
            near += 1
            assert levels_contradict(1.0 / ranges, fix, ROW)
    assert near >= 100


def test_neighbors_that_may_stand_either_way_round_are_not_exchanged():
    """6 cm apart, and each known to 1 cm; known to 1 mm, they are."""
    places = np.array([[0.0, 0.5], [0.0, 0.06], [0.0, 0.0], [0.0, -0.5]])
    stated, wired = ArrayShape.of(places), places[[0, 2, 1, 3]]
    lags = []
    for bearing in np.radians([78.0, 80.0, 82.0, 84.0, 86.0, 88.0]):
        source = 3.0 * np.array([np.cos(bearing), np.sin(bearing)])
        paths = np.linalg.norm(source - wired, axis=1)
        i, j = stated.pairs.T
        lags.append((paths[j] - paths[i]) / 0.007)
    for std, exchanges in ((0.001, [(1, 2)]), (0.01, [])):
        delays = FrameDelays(
            np.array(lags), np.ones((6, 4)), stated, 0.007, position_std_m=std
        )
        assert exchanged_channels(delays) == exchanges
