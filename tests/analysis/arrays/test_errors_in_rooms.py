"""Stated errors of elevations and bearings in rooms, with the truth of simulations."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.voting.direction_votes import VotePlan
from analysis.arrays.voting.source_listener import (
    ListenerMemory,
    ListenerParameters,
    hear_sources,
)
from phonotaxis import locate
from studies.support.hearing_cases.errors_in_rooms import (
    ARRAYS,
    LIVE_ARRAYS,
    RATE,
    C,
    geometry,
    recorded,
)
from systems.sound.array_shape import ArrayShape

SMALL_ROOMS = ((0.3, 1), (0.6, 4), (0.3, 7), (0.6, 10))


def elevation(array, t60_s, seed):
    """Error of an elevation, and its stated deviation, deg."""
    places = ARRAYS[array]
    drawn = recorded(places, t60_s, seed, elevations_deg=(10.0, 25.0), seconds=2.0)
    found = locate(drawn.samples, geometry(places), sample_rate_hz=RATE).main_source()
    return found["elevation_deg"] - drawn.elevation_deg, found["elevation_std_deg"]


@pytest.mark.parametrize("array", ["square, 6.5 cm", "circle of 6, 9.3 cm"])
def test_elevations_in_rooms_are_within_their_errors(array):
    found = [elevation(array, t60, seed) for t60 in (0.3, 0.5) for seed in range(3)]
    errors, stds = np.array(found).T
    assert np.mean(np.abs(errors) < 2.0 * stds) > 0.8
    assert np.median(stds) < 15.0
    # Without the removal of diffuse sound: 10 to 25 deg.
    assert np.median(np.abs(errors)) < 8.0


def test_errors_in_the_free_field_stay_small():
    error, std = elevation("square, 6.5 cm", 0.0, 1)
    assert abs(error) < 2.0 * std
    assert std < 4.0


def bearings(array, t60_s, seed, seconds=2.0):
    """Errors of the bearings of a track, and their deviations, deg."""
    places = LIVE_ARRAYS[array]
    drawn = recorded(
        places, t60_s, seed, elevations_deg=(0.0, 20.0), snr_db=20.0, seconds=seconds
    )
    plan = VotePlan.of(ArrayShape.of(places), C, float(RATE))
    steps, _ = hear_sources(
        drawn.samples, ListenerMemory.blank(plan), plan, ListenerParameters()
    )
    tracks = [track for step in steps for track in step.tracks]
    off = np.degrees([t.bearing for t in tracks]) - drawn.bearing_deg
    return (off + 180.0) % 360.0 - 180.0, np.degrees([t.bearing_std for t in tracks])


def test_bearings_of_listen_are_within_their_errors():
    arrays = ("square, 6.5 cm", "square, 12 cm", "tetrahedron, 12 cm")
    # Every third seed is a room of 4.2 m by 3.4 m.
    found = [bearings(a, t60, seed) for a in arrays for t60, seed in SMALL_ROOMS]
    off, std = (np.concatenate(each) for each in zip(*found, strict=True))
    z = np.abs(off) / std
    assert np.mean(z < 1.0) > 0.6
    assert np.mean(z < 2.0) > 0.85
    assert np.median(std) < 3.0
    # The bearings of single bins alone: 2 to 3 deg.
    assert np.median(np.abs(off)) < 1.6
    free, std = bearings("square, 6.5 cm", 0.0, 1, 3.0)
    assert np.median(std) < 1.0
    assert np.abs(free).max() < 2.0 * std.max()
