"""What is stated of a place, beside closed forms and arrays that are drawn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.arrays.aligned_delays import AlignedDelays
from analysis.arrays.array_geometry import ArrayGeometry
from analysis.arrays.locate import hear
from analysis.arrays.recorded_samples import RecordedSamples
from analysis.arrays.source_placement import has_place, place_source

C, RATE = 343.0, 48_000
ROW = [[0.0, 0.3], [0.0, 0.0], [0.0, -0.3]]
STAR = [[0, 0, 0], [0, 0, 0.8], [0, 0.7, -0.4], [0, -0.7, -0.4]]
TWIST = [[0.4, 0.4, 0.4], [-0.4, 0.4, -0.4], [0.4, -0.4, -0.4], [-0.4, -0.4, 0.4],
         [0.7, 0, 0]]  # fmt: skip


def geometry(places, **errors):
    exact = {"position_std_m": 0.0, "sound_speed_std": 0.0, "delay_std_s": 0.0}
    if "position_covariance_m2" in errors:
        del exact["position_std_m"]
    return ArrayGeometry.model_validate(
        {"microphones": places, "sound_speed": C} | exact | errors
    )


def delays(places, source, c=C, late=0.0, own_s=1e-8):
    arrivals = np.linalg.norm(np.asarray(source) - places, axis=1) / c + late
    own = own_s**2 * (np.eye(len(places) - 1) + 1.0)
    return AlignedDelays(arrivals[1:] - arrivals[0], own, 1.0)


def placed_at(measured, known):
    placed = place_source(measured, known)
    assert placed is not None
    return placed


@pytest.mark.parametrize(
    "errors",
    [
        {"delay_std_s": 4e-6},
        {"position_std_m": 4e-6 * C},
        {"position_covariance_m2": [[(4e-6 * C) ** 2, 0.0], [0.0, 0.0]]},
    ],
)
def test_bearing_ahead_of_a_row_by_errors_of_arrivals(errors):
    """Arrivals off by s each turn a row's normal by c s over the root of sum y^2."""
    placed = placed_at(delays(np.array(ROW), [2.0, 0.0]), geometry(ROW, **errors).known)
    expected = C * 4e-6 / math.sqrt(2 * 0.3**2)
    assert placed.fix.bearing_std == pytest.approx(expected, rel=0.02)
    assert placed.systematic.bearing_std == pytest.approx(expected, rel=0.02)


def test_errors_across_the_rays_do_nothing():
    across = geometry(ROW, position_covariance_m2=[[0.0, 0.0], [0.0, 1e-6]]).known
    placed = placed_at(delays(np.array(ROW), [20.0, 0.0]), across)
    # By 1 mm at 0.3 m, seen by a ray that is off the normal by 0.3 of 20.
    assert placed.systematic.bearing_std < 0.02 * 1e-3 / 0.3


def test_speed_of_sound_turns_a_row_by_its_tangent():
    """sin(bearing) = c tau / d: the bearing turns by tan(bearing) dc / c."""
    bearing = math.radians(50.0)
    source = 20.0 * np.array([math.cos(bearing), math.sin(bearing)])
    known = geometry(ROW, sound_speed_std=0.01 * C).known
    fix = placed_at(delays(np.array(ROW), source), known).fix
    assert fix.bearing_std == pytest.approx(0.01 * math.tan(bearing), rel=0.02)


@pytest.mark.parametrize("places", [STAR, TWIST])
@pytest.mark.parametrize("place_std", [0.002, 0.01])
def test_two_of_three_places_are_within_what_is_stated(places, place_std):
    """Drawn arrays, air and clocks; the interval of 150 draws."""
    rng = np.random.default_rng(17)
    stated = np.array(places, dtype=float)
    center = stated.mean(axis=0)
    side = {"side": "ahead"} if places is STAR else {}
    errors = {"position_std_m": place_std, "sound_speed_std": 3.43, "delay_std_s": 2e-6}
    known = geometry(places, **errors, **side).known
    ranges, bearings = [], []
    for _ in range(150):
        bearing, rise = rng.uniform(-0.8, 0.8), rng.uniform(-0.3, 0.3)
        u = [math.cos(bearing), math.sin(bearing), math.tan(rise)]
        source = center + rng.uniform(0.6, 3.0) * np.array(u) / np.linalg.norm(u)
        measured = delays(
            stated + place_std * rng.standard_normal(stated.shape),
            source,
            C + 3.43 * rng.standard_normal(),
            2e-6 * rng.standard_normal(len(stated)),
            own_s=5e-7,
        )
        placed = place_source(measured, known)
        if placed is None:
            continue
        fix = placed.fix
        off = math.remainder(fix.bearing - bearing, 2.0 * math.pi)
        bearings.append(off / fix.bearing_std)
        if fix.range_valid:
            assert fix.range_std <= 0.2 * fix.range
            ranges.append((fix.range - np.linalg.norm(source - center)) / fix.range_std)
    assert len(bearings) > 140
    assert len(ranges) > 40
    for all_off in (ranges, bearings):
        # 0.68 and 0.95 of a normal one, give or take three of their own deviations.
        for limit, share in ((1.0, 0.683), (2.0, 0.954)):
            slack = 3.0 * math.sqrt(share * (1.0 - share) / len(all_off))
            assert abs(np.mean(np.abs(all_off) < limit) - share) < slack


def test_sources_beyond_what_is_looked_at_have_no_range():
    """However well the array is known; 30 m is the farthest."""
    known = geometry(ROW, sound_speed_std=0.1).known
    for distance, told in ((20.0, True), (29.99, False), (35.0, False), (300.0, False)):
        placed = placed_at(delays(np.array(ROW), [distance, 0.0]), known)
        assert placed.fix.range_valid == told
        assert abs(placed.fix.bearing) < 1e-4


def test_a_small_array_known_badly_has_a_place_and_no_bearing():
    small = [[0.03, 0.03], [-0.03, 0.03], [-0.03, -0.03], [0.03, -0.03]]
    known = geometry(small, position_std_m=0.03).known
    heard = delays(np.array(small), [1.5, 0.4])
    assert has_place(heard, known)
    assert place_source(heard, known) is None


def free_field(places, source, sounds, rng):
    """(n, samples) at 48 kHz of bursts of white noise, (begin, length) each, s."""
    count = round((sounds[-1][0] + sounds[-1][1] + 0.4) * RATE)
    played = np.zeros(count)
    for begin, length in sounds:
        k, m = round(begin * RATE), round(length * RATE)
        played[k : k + m] = rng.standard_normal(m)
    f = np.fft.rfftfreq(count, 1.0 / RATE)
    spectrum = np.fft.rfft(played) * ((f > 500.0) & (f < 10_000.0))
    ranges = np.linalg.norm(source - places, axis=1)[:, np.newaxis]
    turned = spectrum * np.exp(-2j * np.pi * f * ranges / C) / ranges
    heard = np.fft.irfft(turned, count)
    return heard + 0.02 * heard.std() * rng.standard_normal(heard.shape)


@pytest.mark.parametrize("length", [0.01, 0.6])
def test_side_lobes_are_no_delays_where_microphones_stand_elsewhere(length):
    """Off by 3 cm, 90 us; the period of the middle of the band is 190 us."""
    rng = np.random.default_rng(4)
    stated = np.array(TWIST, dtype=float)
    known = geometry(TWIST, position_std_m=0.03)
    source = stated.mean(axis=0) + np.array([1.0, 0.5, 0.2])
    for _ in range(5):
        places = stated + 0.03 * rng.standard_normal(stated.shape)
        sounds = [(0.4, length)]
        samples = free_field(places, source, sounds, rng)
        heard = hear(RecordedSamples(samples, RATE, "noise"), known)
        true = delays(places, source).tau
        assert heard.sightings
        off = np.array([np.abs(s.tau - true).max() for s in heard.sightings])
        assert np.median(off) < 2e-6
        assert np.mean(off < 5e-6) > 0.9
