"""Late channels in delays of sources whose places are known, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.recording_search import Sighting
from analysis.arrays.wavefront_misfit import channel_lateness, late_channel
from systems.sound.array_shape import ArrayShape

C = 340.0
SQUARE = 0.05 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1.0]])
CIRCLE = 0.1 * np.array([[np.cos(a), np.sin(a)] for a in np.pi / 3 * np.arange(6)])
SMALL_ROW = 0.04 * np.array([[0, 1], [0, 0], [0, -1.0]])
ROBOT = 0.4 * np.array([[0, 1], [0, 0], [0, -1.0]])
CROSS = 0.06 * np.vstack((np.eye(3), -np.eye(3)))
ARRAYS = {"square": SQUARE, "circle": CIRCLE, "row": SMALL_ROW, "cross": CROSS}
NOISE_S = 1e-6


def known(places):
    """As places measured with care, and air of which little is known."""
    shape = ArrayShape.of(places)
    return KnownArray(
        shape, C, ArrayBudget(0.0005**2 * np.eye(shape.p_AM.size), 0.01 * C, 0.0)
    )


def sightings(
    places, late_us=0.0, channel=0, seed=0, count=20, scatter_s=NOISE_S, rise=0.2
):
    """Stretches of a source that walks about 1.5 to 4 m away: ranges over c."""
    rng = np.random.default_rng(seed)
    p = np.pad(places, ((0, 0), (0, 3 - places.shape[1])))
    n = len(p)
    bearing, turn = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, 0.05)
    distance = rng.uniform(1.5, 4.0)
    found = []
    for k in range(count):
        angle = bearing + turn * k
        u = np.array([np.cos(angle), np.sin(angle), rise])
        source = distance * u / np.linalg.norm(u)
        arrivals = np.linalg.norm(p - source, axis=1) / C
        arrivals[channel] += 1e-6 * late_us
        arrivals += rng.normal(0.0, scatter_s, n)
        found.append(
            Sighting(
                t_s=float(k),
                tau=arrivals[1:] - arrivals[0],
                covariance=NOISE_S**2 * (np.eye(n - 1) + 1.0),
                coherence=0.9,
            )
        )
    return found


@pytest.mark.parametrize("name", ARRAYS)
def test_nothing_is_late_in_50_good_recordings(name):
    array = known(ARRAYS[name])
    for seed in range(50):
        assert late_channel(sightings(ARRAYS[name], seed=seed), array) is None


@pytest.mark.parametrize("name", ["circle", "cross"])
@pytest.mark.parametrize("late_us", [30.0, -60.0])
def test_the_late_channel_is_named_and_measured(name, late_us):
    places = ARRAYS[name]
    array = known(places)
    for channel in range(len(places)):
        stretches = sightings(places, late_us, channel, seed=channel)
        fault = late_channel(stretches, array)
        assert fault is not None
        assert fault.kind == "late"
        assert channel in fault.channels
        found = channel_lateness(stretches, array)
        assert found is not None
        # Some of it goes into the direction's tolerances.
        assert 1e6 * found.late_s[channel] == pytest.approx(late_us, rel=0.15)


def test_a_square_cannot_tell_which_of_its_channels_is_late():
    """Three delays, two parts of a direction: one residual."""
    stretches = sightings(SQUARE, 60.0, 2, rise=1.0)
    fault = late_channel(stretches, known(SQUARE))
    assert fault is not None
    assert fault.channels == (0, 1, 2, 3)
    found = channel_lateness(stretches, known(SQUARE))
    assert found is not None
    # The residual t_0 - t_1 + t_2 - t_3 alone is seen, a quarter of it in each.
    late = found.late_s * [1, -1, 1, -1]
    np.testing.assert_allclose(late, late[0], rtol=1e-6)


def test_a_small_row_of_three_sees_that_waves_are_not_flat():
    fault = late_channel(sightings(SMALL_ROW, 40.0, 1), known(SMALL_ROW))
    assert fault is not None


@pytest.mark.parametrize("elevation_deg", [0.0, 10.0, 60.0])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.filterwarnings("error")
def test_three_in_a_triangle_have_no_spare_delay(elevation_deg, dimension):
    """Two delays are two unknowns of a plane wave, and a late channel turns it."""
    turn = 2.0 * np.pi / 3.0 * np.arange(3)
    triangle = 0.0577 * np.stack((np.cos(turn), np.sin(turn)), axis=1)
    places = np.pad(triangle, ((0, 0), (0, dimension - 2)))
    rise = np.tan(np.radians(elevation_deg))
    for late_us in (0.0, 60.0):
        for seed in range(5):
            stretches = sightings(places, late_us, 1, seed=seed, rise=rise)
            assert channel_lateness(stretches, known(places)) is None
            assert late_channel(stretches, known(places)) is None


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_long_row_of_three_has_nothing_to_tell_it_by(channel):
    """Any two delays are of some bearing and range."""
    stretches = sightings(ROBOT, 20.0, channel)
    assert late_channel(stretches, known(ROBOT)) is None


def test_swapped_neighbors_of_four_do_not_fit():
    stretches = sightings(SQUARE[[1, 0, 2, 3]], seed=3)
    assert late_channel(stretches, known(SQUARE)) is not None


def test_scatter_of_the_stretches_is_no_lateness():
    """Errors ten times the stated ones, without anything in common."""
    array = known(CIRCLE)
    for seed in range(20):
        stretches = sightings(CIRCLE, seed=seed, scatter_s=10.0 * NOISE_S)
        assert late_channel(stretches, array) is None


def test_nothing_is_late_where_the_source_is_nearer_than_the_array_is_long():
    """Whose waves are nowhere near flat: 0.6 m from the middle of 1.6 m."""
    places = 8.0 * CIRCLE
    array = known(places)
    source = np.array([0.45, 0.4, 0.0])
    arrivals = np.linalg.norm(np.pad(places, ((0, 0), (0, 1))) - source, axis=1) / C
    stretches = [
        Sighting(
            t_s=float(k),
            tau=arrivals[1:] - arrivals[0],
            covariance=NOISE_S**2 * (np.eye(len(places) - 1) + 1.0),
            coherence=0.9,
        )
        for k in range(5)
    ]
    assert late_channel(stretches, array) is None


def test_too_few_stretches_say_nothing():
    stretches = sightings(CIRCLE, 60.0, 2)
    assert channel_lateness(stretches[:2], known(CIRCLE)) is None
    assert channel_lateness([], known(CIRCLE)) is None
    assert late_channel(stretches[:3], known(CIRCLE)) is not None
