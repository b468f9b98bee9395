"""Predicted errors of arrays, against simulated delays and closed forms."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.integrate import quad

import phonotaxis
from analysis.arrays.array_resolution import Sounding, predicted_error
from phonotaxis import ArrayGeometry, InputError, array_resolution, locate_delays

C = 340.0
SQUARE = [[0.1, 0.1, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, -0.1, 0.0]]
SPACE = np.random.default_rng(2).uniform(-0.5, 0.5, (7, 3))
ROW = [[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]]


def test_two_microphones_have_the_bound_of_knapp_and_carter():
    """1 / (2 T int w^2 g / (1 - g) df) with the squared coherence g."""
    sound = Sounding(snr_db=3.0, seconds=0.7, band_hz=(300.0, 5000.0))
    snr = 10.0**0.3
    coherence = (snr / (1.0 + snr)) ** 2
    ratio = coherence / (1.0 - coherence)
    integral = quad(lambda f: (2.0 * math.pi * f) ** 2 * ratio, 300.0, 5000.0)[0]
    bound = math.sqrt(1.0 / (2.0 * 0.7 * integral))
    assert math.sqrt(2.0) * sound.arrival_std(2) == pytest.approx(bound)


@pytest.mark.parametrize(
    ("places", "at"),
    [
        (SQUARE, (40.0, 35.0, 30.0)),
        (SQUARE, (-100.0, 60.0, 30.0)),
        (SPACE, (10.0, -20.0, 1.5)),
        (SPACE, (150.0, 40.0, 2.5)),
        (ROW, (20.0, 0.0, 1.5)),
    ],
)
def test_simulated_errors_are_as_predicted(places, at):
    """Errors of arrival times, positions and speed of sound, drawn 200 times."""
    rng = np.random.default_rng(7)
    places = np.array(places, dtype=float)
    noise, place_std, speed_std = 1e-6, 2e-4, 0.5
    geometry = ArrayGeometry(
        microphones=tuple(map(tuple, places)),
        sound_speed=C,
        sound_speed_std=speed_std,
        position_std_m=place_std,
        delay_std_s=0.0,
        largest_range_error=1.0,
    )
    azimuth, height = np.radians(at[:2])
    level = math.cos(height)
    u = np.array(
        [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(height)]
    )[: places.shape[1]]
    source = places.mean(axis=0) + at[2] * u
    true = places + place_std * rng.standard_normal((200, *places.shape))
    speed = C + speed_std * rng.standard_normal((200, 1))
    arrival = np.linalg.norm(source - true, axis=2) / speed
    arrival += noise * rng.standard_normal(arrival.shape)
    covariance = noise**2 * (np.eye(len(places) - 1) + 1.0)
    found = locate_delays(
        arrival[:, 1:] - arrival[:, :1], geometry, covariance=covariance
    ).estimates
    distance = at[2] if at[2] < 5.0 else None
    said = predicted_error(geometry.known, noise, at[0], at[1], distance)
    for name, expected in (
        ("bearing_deg", said.bearing_std_deg),
        ("elevation_deg", said.elevation_std_deg),
        ("range_m", said.range_std_m),
    ):
        values = [getattr(e, name) for e in found]
        if expected is None:
            continue
        known = np.array([v for v in values if v is not None])
        assert len(known) > 0.95 * len(values)
        spread = np.subtract(*np.quantile(known, [0.8413, 0.1587])) / 2.0
        if distance is None:
            # The prediction includes the unknown range, which is the same in all.
            assert 0.6 * expected < spread < 1.15 * expected
        else:
            assert spread == pytest.approx(expected, rel=0.2)


def test_limits_of_a_square_and_a_row():
    square = array_resolution(SQUARE)
    assert square.ambiguity == "mirror"
    # To first order, a plane measures no elevation in its own plane.
    level = [e for e in square.far if e.elevation_deg == 0.0]
    assert all(e.elevation_std_deg is None for e in level)
    assert all(e.bearing_std_deg is not None for e in level)
    assert square.angles == ("bearing", "elevation")
    assert square.highest_hz == pytest.approx(C / 0.4)
    assert square.lowest_hz == pytest.approx(C / (2.0 * 0.2 * math.sqrt(2.0)))
    row = array_resolution(ROW)
    assert row.ambiguity == "front_back"
    assert row.angles == ("bearing",)
    assert row.highest_hz == pytest.approx(C / 0.8)
    assert all(e.elevation_std_deg is None for e in row.far)
    # A row measures bearings best straight ahead, and not along itself.
    stds = {e.bearing_deg: e.bearing_std_deg for e in row.far}
    assert stds[0.0] == min(s for s in stds.values() if s is not None)
    assert stds[90.0] is None or stds[90.0] > 5.0 * stds[0.0]


def test_what_a_better_array_brings():
    improvements = array_resolution(ROW).improvements
    bearing = {i.change: i.bearing_std_deg or math.nan for i in improvements}
    farthest = {i.change: i.farthest_range_m or 0.0 for i in improvements}
    stated = bearing["as stated"]
    assert bearing["exact positions"] < stated
    assert bearing["twice the aperture"] < 0.7 * stated
    assert bearing["exact sampling times"] <= stated
    assert farthest["twice the aperture"] > farthest["as stated"]


def test_the_command_writes_its_files(tmp_path, capsys):
    geometry = tmp_path / "array.yaml"
    geometry.write_text(f"microphones: {SQUARE}\n")
    out = tmp_path / "out"
    words = ["array", str(geometry), "--snr-db", "10", "--out", str(out), "--json"]
    assert phonotaxis.main(words) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == json.loads((out / "array.json").read_text())
    assert {p.name for p in out.iterdir()} == {"array.json", "array.png"}
    assert document["sound"]["snr_db"] == 10.0
    assert len(document["far"]) == 3 * len(document["bearings_deg"])
    assert phonotaxis.main(["array", str(geometry)]) == 0
    text = capsys.readouterr().out
    assert "mirror image" in text
    assert "twice the aperture" in text
    assert phonotaxis.main(["array", str(geometry), "--seconds", "0"]) == 2


def test_values_out_of_range_are_refused():
    with pytest.raises(InputError, match="-40 to 80"):
        array_resolution(SQUARE, snr_db=math.nan)
    with pytest.raises(InputError, match="more than 0"):
        array_resolution(SQUARE, seconds=-1.0)
