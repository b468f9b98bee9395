"""Trials in rooms: where things stand, and what counts as located."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

import studies.support.room_trials
from studies.support.room_trials import Layout, RoomResult, draw_layouts, locate_bursts
from systems.hearing.parameters import TDOAParameters, TrackerParameters
from systems.sound.parameters import RoomParameters, SoundParameters

#: Walls that absorb nearly all: one order of faint reflections.
DULL = RoomParameters(absorption=0.999, maximum_order=1)
CHIRP = SoundParameters(kind="chirp")


def layouts(count: int, seed: int = 3, room: RoomParameters = DULL) -> list[Layout]:
    return list(draw_layouts(room, 3.0, count, seed))


def microphones(layout: Layout) -> np.ndarray:
    """(3, 2) of the default robot, in W, by hand."""
    x, y, theta = layout.pose_WB
    ahead = np.array([math.cos(theta), math.sin(theta)])
    left = np.array([-math.sin(theta), math.cos(theta)])
    M2 = np.array([x, y]) + 0.175 * ahead
    return np.array([M2 + 0.4 * left, M2, M2 - 0.4 * left])


@given(seed=st.integers(0, 2**32 - 1), corner=st.sampled_from([None, (0.0, -1.0)]))
def test_layouts_are_what_is_stated(seed, corner):
    room = RoomParameters(size_m=(6.0, 8.0, 3.0), corner_m=corner)
    low = np.array((-3.0, -4.0) if corner is None else corner) + 0.5
    high = low + np.array([5.0, 7.0])
    for layout in layouts(5, seed, room):
        M1, M2, M3 = microphones(layout)
        for place in (M1, M2, M3, layout.p_WS):
            assert np.all((place >= low) & (place <= high))
        assert 0.5 <= layout.range_m <= 3.0
        assert abs(layout.bearing_deg) <= 60.0
        away = layout.p_WS - M2
        left = (M1 - M3) / 0.8
        assert np.hypot(*away) == pytest.approx(layout.range_m)
        # The sine of the bearing is the share of the way that goes left.
        sine = math.sin(math.radians(layout.bearing_deg))
        assert away @ left == pytest.approx(layout.range_m * sine, abs=1e-12)


def test_layouts_are_the_seeds_and_more_are_the_same_and_others():
    few, many, other = layouts(3), layouts(5), layouts(3, seed=4)
    for a, b, c in zip(few, many, other, strict=False):
        np.testing.assert_array_equal(a.pose_WB, b.pose_WB)
        np.testing.assert_array_equal(a.p_WS, b.p_WS)
        assert not np.array_equal(a.p_WS, c.p_WS)


def test_a_result_counts_what_is_within_both_limits():
    """By hand: 2 of 6; Wilson's interval of it is 0.0968 to 0.7000."""
    result = RoomResult(
        layouts(6),
        np.array([0.1, -1.9, 2.1, -0.2, math.nan, 30.0]),
        np.array([0.01, -0.09, 0.0, 0.11, math.nan, 1.0]),
    )
    np.testing.assert_array_equal(result.located, [1, 1, 0, 0, 0, 0])
    np.testing.assert_array_equal(result.heard, [1, 1, 1, 1, 0, 1])
    assert result.located_rate.ends == pytest.approx((0.0968, 0.7000), abs=5e-5)


@pytest.mark.parametrize(
    ("turn_deg", "farther"), [(0.0, 0.0), (3.0, 0.2), (-175.0, -0.1)]
)
def test_errors_are_those_of_a_made_up_estimate(monkeypatch, turn_deg, farther):
    """The tracker's place is put at a known bearing and range."""
    chosen = layouts(4)
    places = []
    for layout in chosen:
        angle = layout.pose_WB[2] + math.radians(layout.bearing_deg + turn_deg)
        away = (1.0 + farther) * layout.range_m
        places.append(
            microphones(layout)[1] + away * np.array([math.cos(angle), math.sin(angle)])
        )
    answers = iter(places)
    monkeypatch.setattr(
        studies.support.room_trials, "_tracked", lambda *arguments: next(answers)
    )
    result = locate_bursts(DULL, CHIRP, chosen)
    np.testing.assert_allclose(result.bearing_errors_deg, turn_deg, atol=1e-9)
    np.testing.assert_allclose(result.range_errors, farther, atol=1e-12)


def test_without_echoes_errors_are_those_of_noise():
    """20 frames at 30 dB: far below a tenth of a degree and a per cent."""
    result = locate_bursts(
        DULL,
        CHIRP,
        layouts(4),
        parameters=TDOAParameters(suppress_echoes=False),
        tracking=TrackerParameters(hold="world"),
    )
    assert np.all(np.abs(result.bearing_errors_deg) < 0.1)
    assert np.all(np.abs(result.range_errors) < 0.02)


def test_a_layout_has_its_own_noise_whoever_stands_beside_it():
    """Trials can be compared one by one, between methods and sounds."""
    pair = layouts(2)
    room = RoomParameters(absorption=0.5, maximum_order=2)
    together = locate_bursts(room, CHIRP, pair, seed=7)
    alone = locate_bursts(room, CHIRP, pair[:1], seed=7)
    assert alone.range_errors[0] == together.range_errors[0]
    again = locate_bursts(room, CHIRP, pair, seed=8)
    assert not np.any(again.range_errors == together.range_errors)


def test_nothing_is_heard_far_below_the_noise():
    result = locate_bursts(DULL, CHIRP, layouts(2), snr_db_at_1m=-40.0)
    assert not result.heard.any()
    assert not result.located.any()
