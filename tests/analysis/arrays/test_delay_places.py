"""Places from given delays, against the true places of simulated sounds."""

from __future__ import annotations

import math

import numpy as np
import pytest

import phonotaxis
from phonotaxis import ArrayGeometry, InputError, calibrate_delays, locate_delays

C = 343.0
SQUARE = [[0.1, 0.1, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, -0.1, 0.0]]


def array(places, **fields):
    exact = {"position_std_m": 1e-6, "sound_speed_std": 0.0, "delay_std_s": 0.0}
    return ArrayGeometry(
        microphones=tuple(map(tuple, np.array(places, dtype=float))),
        sound_speed=C,
        **(exact | fields),
    )


def delays_of(places, source, late=0.0):
    arrival = np.linalg.norm(np.array(source) - np.array(places), axis=-1) / C + late
    return arrival[1:] - arrival[0]


def covariance_of(count, std):
    return std**2 * (np.eye(count - 1) + 1.0)


def off_deg(found, true):
    return (found - true + 180.0) % 360.0 - 180.0


def draws(places, distances, std, rng, count):
    """Delays of sounds all around, with their bearings and elevations."""
    middle = np.mean(places, axis=0)
    rows, angles = [], []
    for _ in range(count):
        azimuth, height = rng.uniform(-math.pi, math.pi), rng.uniform(-0.6, 0.6)
        level = math.cos(height)
        u = [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(height)]
        source = middle + rng.uniform(*distances) * np.array(u)
        late = std * rng.standard_normal(len(places))
        rows.append(delays_of(places, source, late))
        angles.append(np.degrees([azimuth, height]))
    return np.array(rows), np.array(angles)


def test_a_near_sound_has_a_position_with_its_errors():
    rng = np.random.default_rng(3)
    places = rng.uniform(-0.5, 0.5, (8, 3)) + np.array([5.0, 1.0, 2.0])
    source, std = np.array([6.5, 2.0, 2.3]), 2e-6
    late = std * rng.standard_normal((100, 8))
    delays = [delays_of(places, source, row) for row in late]
    found = locate_delays(delays, array(places), covariance=covariance_of(8, std))
    off = np.array([e.position_m for e in found.estimates]) - source
    squares = [
        o @ np.linalg.solve(np.array(e.covariance), o)
        for o, e in zip(off, found.estimates, strict=True)
    ]
    assert np.mean(squares) == pytest.approx(3.0, abs=0.8)
    assert np.linalg.norm(off, axis=1).max() < 0.15


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("count", [6, 16])
def test_the_deviations_of_directions_hold(count, stated):
    """With stated errors, and with errors that follow from the misfit."""
    rng = np.random.default_rng(4)
    places, std = rng.uniform(-0.1, 0.1, (count, 3)), 4e-6
    delays, true = draws(places, (20.0, 40.0), std, rng, 120)
    given = covariance_of(count, std) if stated else None
    found = locate_delays(delays, array(places), covariance=given)
    z = np.array(
        [
            [
                off_deg(e.bearing_deg, azimuth) / e.bearing_std_deg,
                (e.elevation_deg - height) / e.elevation_std_deg,
            ]
            for e, (azimuth, height) in zip(found.estimates, true, strict=True)
        ]
    )
    assert np.mean(np.abs(z) < 2.0) > 0.92
    assert 0.7 < z.std() < 1.1
    if not stated:
        assert found.arrival_std_s == pytest.approx(std, rel=0.15)


def test_errors_that_are_stated_too_small_are_raised():
    rng = np.random.default_rng(5)
    places = rng.uniform(-0.1, 0.1, (16, 3))
    delays, true = draws(places, (20.0, 40.0), 10e-6, rng, 60)
    found = locate_delays(delays, array(places), covariance=covariance_of(16, 1e-6))
    scales = np.array([e.error_scale for e in found.estimates])
    assert np.median(scales) == pytest.approx(10.0, rel=0.2)
    z = [
        off_deg(e.bearing_deg, azimuth) / e.bearing_std_deg
        for e, (azimuth, _) in zip(found.estimates, true, strict=True)
    ]
    assert np.mean(np.abs(z) < 2.0) > 0.9
    assert "times as large" in found.notes[0]


@pytest.mark.parametrize(
    ("wrong", "value"),
    [([5], 0.75), ([0], 0.75), ([2, 9], -0.75), ([5], math.nan), ([2, 9], math.inf)],
)
def test_impossible_delays_are_left_out(wrong, value):
    """A gross error at microphone 0 makes all delays after it wrong."""
    rng = np.random.default_rng(6)
    places = rng.uniform(-0.1, 0.1, (12, 3))
    arrival = np.linalg.norm(np.array([3.0, 2.0, 1.0]) - places, axis=1) / C
    good = locate_delays(
        arrival[1:] - arrival[0], array(places), covariance=covariance_of(12, 1e-6)
    )
    arrival[wrong] += value
    found = locate_delays(
        arrival[1:] - arrival[0], array(places), covariance=covariance_of(12, 1e-6)
    )
    (e,) = found.estimates
    assert e.left_out == tuple(wrong)
    assert e.bearing_deg == pytest.approx(good.estimates[0].bearing_deg, abs=0.05)
    assert e.freedom == good.estimates[0].freedom - len(wrong)
    assert e.error_scale == 1.0
    assert ", ".join(str(k + 1) for k in wrong) in found.notes[0]


def test_delays_in_milliseconds_are_no_place():
    found = locate_delays(
        1e3 * delays_of(SQUARE, [3.0, 2.0, 1.0]), SQUARE, covariance=1e-12 * np.eye(3)
    )
    (e,) = found.estimates
    assert e.direction is None
    assert "in s" in e.reason
    assert "in s" in str(found)


def test_the_mirror_image_is_an_alternative():
    source = np.array([2.0, 1.0, 1.5])
    found = locate_delays(
        delays_of(SQUARE, source), array(SQUARE), covariance=covariance_of(4, 1e-7)
    )
    (e,) = found.estimates
    (other,) = e.alternatives
    assert e.elevation_deg is not None
    assert e.elevation_std_deg is not None
    assert other.elevation_deg == pytest.approx(-e.elevation_deg)
    assert e.bearing_deg == pytest.approx(other.bearing_deg)
    assert e.elevation_deg == pytest.approx(33.9, abs=3.0 * e.elevation_std_deg)
    one_sided = array(SQUARE, side="above")
    found = locate_delays(
        delays_of(SQUARE, source), one_sided, covariance=covariance_of(4, 1e-7)
    )
    assert found.estimates[0].alternatives == ()


def test_both_positions_of_four_microphones_are_named():
    """Four microphones in space: two positions can have the same three delays."""
    rng = np.random.default_rng(8)
    places = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    listed, twins = 0, 0
    for _ in range(60):
        source = rng.uniform(-1.5, 1.5, 3)
        delays = delays_of(places, source)
        found = locate_delays(delays, array(places), covariance=covariance_of(4, 1e-8))
        (e,) = found.estimates
        if e.position_m is None:
            continue
        every = [e.position_m, *(o.position_m for o in e.alternatives)]
        twins += len(every) > 1
        off = [float(np.linalg.norm(np.array(p) - source)) for p in every]
        listed += min(off) < 0.01
    assert listed >= 50
    assert twins > 0


@pytest.mark.parametrize(
    ("delays", "covariance", "message"),
    [
        ([0.0] * 4, None, "times"),
        ([0.0] * 2, None, "need"),
        ("abc", None, "not numbers"),
        ([0.0] * 3, None, "too few delays"),
        ([0.0] * 3, np.eye(2), "shape"),
        ([0.0] * 3, np.diag([1.0, 1.0, -1.0]), "negative"),
        ([0.0] * 3, np.triu(np.ones((3, 3))), "symmetric"),
        ([0.0] * 3, np.full((3, 3), np.nan), "finite"),
    ],
)
def test_what_cannot_be_used_is_named(delays, covariance, message):
    with pytest.raises(InputError, match=message):
        locate_delays(delays, SQUARE, covariance=covariance)


def test_the_document_holds_plain_values(tmp_path):
    found = locate_delays(
        delays_of(SQUARE, [1.0, 2.0, 1.0]), SQUARE, covariance=covariance_of(4, 1e-6)
    )
    folder = found.save(tmp_path / "out")
    assert {p.name for p in folder.iterdir()} == {"delays.json", "delays.png"}
    (row,) = found.document()["estimates"]
    assert row["bearing_deg"] == found.estimates[0].bearing_deg
    assert np.shape(row["covariance"]) == (3, 3)


def on_a_stand(rng, count=24):
    """True places and places as measured by hand, 3 mm off."""
    true = rng.uniform(-0.12, 0.12, (count, 3))
    return true, true + 0.003 * rng.standard_normal(true.shape)


def test_an_array_is_calibrated_by_sounds_in_unknown_directions():
    """Delays in whole samples, one of them grossly wrong; judged by new sounds."""
    rng = np.random.default_rng(11)
    true, measured = on_a_stand(rng)
    known = array(measured, position_std_m=0.003, delay_std_s=1e-6)
    sample = 1.0 / 192_000.0
    delays, _ = draws(true, (3.0, 5.0), 0.0, rng, 60)
    delays = sample * np.round(delays / sample)
    delays[7, 3] = 0.75
    result = calibrate_delays(delays, known)
    assert any("sound 8: " in note for note in result.notes)
    assert result.run.misfit is None
    assert result.run.calibration.freedom == 60 * (23 - 3) - 1
    shape = {gain.name: gain for gain in result.run.gains}["shape of the array"]
    assert shape.after < 0.3 * shape.before
    new, angles = draws(true, (3.0, 5.0), 0.0, rng, 60)
    new = sample * np.round(new / sample)
    errors = {}
    for name, geometry in (("before", known), ("after", result.geometry)):
        found = locate_delays(new, geometry)
        off = np.array(
            [
                off_deg(e.bearing_deg, azimuth)
                for e, (azimuth, _) in zip(found.estimates, angles, strict=True)
            ]
        )
        stds = np.array([e.bearing_std_deg for e in found.estimates])
        assert np.mean(np.abs(off) < 2.0 * stds) > 0.9
        # Sounds at unknown places do not show the orientation of the array.
        errors[name] = np.std(off - off.mean())
    assert errors["after"] < 0.5 * errors["before"]


def test_a_sound_with_large_errors_counts_less():
    rng = np.random.default_rng(12)
    true, measured = on_a_stand(rng, 12)
    known = array(measured, position_std_m=0.003, delay_std_s=1e-7)
    delays, _ = draws(true, (3.0, 5.0), 1e-6, rng, 40)
    clean = calibrate_delays(delays, known).geometry
    delays[4] += 80e-6 * rng.standard_normal(11)
    result = calibrate_delays(delays, known)
    assert any("sounds 5: " in note for note in result.notes)

    def apart(geometry):
        off = np.array(geometry.microphones) - np.array(clean.microphones)
        return float(np.sqrt(np.mean(off**2)))

    assert apart(result.geometry) < 1e-4


def test_known_positions_calibrate_four_microphones():
    rng = np.random.default_rng(13)
    true = np.array(SQUARE) + 0.003 * rng.standard_normal((4, 3))
    sources = rng.uniform(-3.0, 3.0, (30, 3)) + np.array([0.0, 0.0, 3.2])
    delays = [
        delays_of(true, source, 1e-7 * rng.standard_normal(4)) for source in sources
    ]
    known = array(SQUARE, position_std_m=0.003)
    result = calibrate_delays(
        delays,
        known,
        covariance=covariance_of(4, 1e-7),
        positions_m=sources,
        position_std_m=1e-4,
    )
    found = np.array(result.geometry.microphones)
    off = (found - found.mean(axis=0)) - (true - true.mean(axis=0))
    assert np.abs(off).max() < 3e-4
    with pytest.raises(InputError, match="one position with 3"):
        calibrate_delays(delays, known, positions_m=sources[:2])
    with pytest.raises(InputError, match="too few delays"):
        calibrate_delays(delays, known)


def test_the_file_of_a_large_array_keeps_the_error_of_its_orientation():
    """A covariance of 64 microphones has no room in a file; its turns are kept."""
    rng = np.random.default_rng(14)
    true, measured = on_a_stand(rng, 64)
    known = array(measured, position_std_m=0.003, delay_std_s=1e-6)
    delays, _ = draws(true, (3.0, 5.0), 1e-6, rng, 30)
    result = calibrate_delays(delays, known, covariance=covariance_of(64, 1e-6))
    fields = result.document()["geometry"]
    assert "position_covariance_m2" not in fields
    whole, filed = result.geometry, ArrayGeometry.model_validate(fields)
    for geometry in (whole, filed):
        found = locate_delays(delays[0], geometry, covariance=covariance_of(64, 1e-6))
        systematic = found.estimates[0].bearing_systematic_deg
        turn = 3.0 / 1e3 / math.sqrt(np.sum((true - true.mean(0))[:, :2] ** 2))
        assert systematic == pytest.approx(math.degrees(turn), rel=0.25)


def test_the_names_are_public():
    assert {"locate_delays", "calibrate_delays", "DelayResult"} <= set(
        phonotaxis.__all__
    )
