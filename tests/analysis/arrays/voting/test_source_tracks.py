"""Tracks of sources whose ways are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.arrays.voting.source_tracks import TrackMemory, step_tracks
from analysis.arrays.voting.track_state import TrackParameters
from analysis.arrays.voting.vote_peaks import VotedSource

STD = math.radians(2.0)


def detected(bearing, share=1.0, later_s=0.0):
    return VotedSource(
        bearing=bearing,
        bearing_std=STD,
        elevation=None,
        elevation_std=None,
        share=share,
        power=1.0,
        rises=1.0,
        votes=10,
        confidence=1.0,
        later_s=later_s,
    )


def follow_detections(steps, step_s=0.1):
    """Tracks after each step of detections (bearing in deg, share, later_s)."""
    memory, told = TrackMemory(), []
    for k, step in enumerate(steps):
        found = [detected(math.radians(deg), *rest) for deg, *rest in step]
        tracks, memory = step_tracks(found, k * step_s, memory, TrackParameters())
        told.append(tracks)
    return told


def follow(ways, steps, step_s=0.1, seed=0):
    """Tracks over time of sources that are heard apart, or as one within 12 deg."""
    rng, memory, told = np.random.default_rng(seed), TrackMemory(), []
    for k in range(steps):
        t = k * step_s
        at = [way(t) for way in ways if way(t) is not None]
        if len(at) == 2 and abs(at[0] - at[1]) < 12.0:
            at = [0.5 * (at[0] + at[1])]
        detections = [
            detected(bearing)
            for bearing in np.radians([a + 2.0 * rng.standard_normal() for a in at])
        ]
        tracks, memory = step_tracks(detections, t, memory, TrackParameters())
        told.append((t, tracks))
    return told


def test_a_track_begins_within_half_a_second_and_ends_within_two():
    told = follow([lambda t: 170.0 if 1.0 <= t < 3.0 else None], 60)
    heard = [t for t, tracks in told if tracks]
    assert heard[0] <= 1.5
    assert 3.0 <= heard[-1] <= 5.0


def test_a_track_whose_share_falls_is_reported_no_longer():
    """After m of 0.05, the mean share (3 + 0.05 m) / (10 + m) is 0.2 at m = 6.7."""
    memory, heard = TrackMemory(), []
    for k in range(20):
        detections = [detected(0.5, 0.3 if k < 10 else 0.05)]
        tracks, memory = step_tracks(detections, 0.1 * k, memory, TrackParameters())
        heard += [k] if tracks else []
    assert heard[-1] == 9 + 6


def test_two_that_cross_keep_their_identities():
    kept = 0
    for seed in range(20):
        ways = (lambda t: 30.0 - 10.0 * t, lambda t: -30.0 + 10.0 * t)
        told = follow(ways, 60, seed=seed)
        begin = {t.identity: t.bearing for t in told[12][1]}
        end = {t.identity: t.bearing for t in told[-1][1]}
        kept += len(begin) == 2 and all(begin[k] * end.get(k, 0.0) < 0.0 for k in begin)
    assert kept >= 16


def test_time_must_run_forward():
    _, memory = step_tracks([], 1.0, TrackMemory(), TrackParameters())
    with pytest.raises(ValueError, match="before the last step"):
        step_tracks([], 0.5, memory, TrackParameters())


def test_a_track_that_pauses_stays_near_where_it_was_heard():
    """For 0.6 s, another talker pulls its detections by 10 deg/s before it pauses."""
    memory, at = TrackMemory(), []
    for k in range(40):
        pulled = 10.0 * max(0.0, 0.1 * k - 1.4)
        heard = [detected(math.radians(pulled))] if k < 20 else []
        tracks, memory = step_tracks(heard, 0.1 * k, memory, TrackParameters())
        at += [math.degrees(track.bearing) for track in tracks]
    # With the rate that it had then, it would be 15 deg away after 1.5 s.
    assert 0.0 < at[-1] - 6.0 < 12.0


@pytest.mark.parametrize(("bearing", "identities"), [(3.0, {1}), (60.0, {1, 2})])
def test_a_source_that_sounds_again_at_its_place_has_its_identity_back(
    bearing, identities
):
    def way(t):
        return 0.0 if t < 2.0 else bearing if t > 5.0 else None

    told = follow([way], 80)
    assert {t.identity for _, tracks in told for t in tracks} == identities


def test_after_a_long_time_it_is_another_source():
    told = follow([lambda t: 0.0 if t < 2.0 or t > 14.0 else None], 170)
    assert {t.identity for _, tracks in told for t in tracks} == {1, 2}


@pytest.mark.parametrize(("wander_deg", "largest_std_deg"), [(5.0, 5.0), (0.0, 2.0)])
def test_errors_that_change_slowly_are_in_the_stated_error(wander_deg, largest_std_deg):
    """A source at rest, whose detections turn to and fro once a second."""
    told = follow([lambda t: wander_deg * math.sin(2.0 * math.pi * t)], 100)
    tracks = [track for _, tracks in told for track in tracks]
    assert len({track.identity for track in tracks}) == 1
    off = np.degrees([track.bearing for track in tracks])
    std = np.degrees([track.bearing_std for track in tracks])
    assert np.mean(np.abs(off) < 2.0 * std) > 0.9
    assert np.median(std) < largest_std_deg


def test_syllables_of_a_source_that_turns_are_detections_at_their_own_times():
    """A source turns at 45 deg/s. Its syllables sound every 0.5 s.

    A window of 0.5 s hears only the last one. Its detections stay at its bearing.
    """
    steps = []
    for k in range(50):
        middle = 0.1 * k - 0.25
        syllable = 0.5 * math.floor(0.1 * k / 0.5 + 1e-9)
        steps.append([(45.0 * syllable, 1.0, syllable - middle)])
    told = follow_detections(steps)
    assert {t.identity for tracks in told for t in tracks} == {1}
    track = told[-1][0]
    assert math.degrees(track.rate) == pytest.approx(45.0, rel=0.1)
    true = math.radians(45.0 * (4.9 - 0.25))
    off = math.degrees(math.remainder(track.bearing - true, 2.0 * math.pi))
    assert abs(off) < 3.0


def test_votes_between_two_sources_that_last_half_a_window_are_no_source():
    two = [(-20.0, 0.4), (20.0, 0.4)]
    told = follow_detections(
        [[*two, (0.0, 0.3)] if 10 <= k < 15 else two for k in range(40)]
    )
    assert {t.identity for tracks in told for t in tracks} == {1, 2}


def test_a_source_that_begins_beside_another_is_told_within_one_second():
    told = follow_detections(
        [[(-20.0, 0.5), (40.0, 0.5)][: 1 + (k >= 20)] for k in range(40)]
    )
    first = min(k for k, tracks in enumerate(told) if len(tracks) == 2)
    assert 0.5 <= 0.1 * (first - 20) <= 1.0


def test_a_faint_detection_moves_a_track_less():
    """The share of a detection is its weight as a standard deviation."""

    def bearing(share):
        told = follow_detections([[(0.0, 1.0)]] * 20 + [[(6.0, share)]])
        return math.degrees(told[-1][0].bearing)

    assert 0.0 < bearing(0.2) < 0.5 * bearing(1.0)
