"""What is made of estimates: medians, the main source, the other candidate."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from analysis.arrays.heard_sources import HeardSource, HeardSources
from analysis.arrays.locate_plots import plot_locate, write_locate
from analysis.arrays.locate_result import LocatedSource
from analysis.arrays.locate_text import locate_text
from analysis.arrays.source_estimate import SourceEstimate
from systems.sound.array_shape import ArrayShape

SQUARE = [[0.1, 0.1, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, -0.1, 0.0]]
ROW = [[0.3, 0.0], [0.0, 0.0], [-0.4, 0.0]]
UPRIGHT = [[0.1, 0.0, 0.1], [-0.1, 0.0, 0.1], [-0.1, 0.0, -0.1], [0.1, 0.0, -0.1]]


def estimate(t, bearing, elevation=None, range_m=None, std=1.0):
    return SourceEstimate(
        t_s=t,
        bearing_deg=bearing,
        bearing_std_deg=std,
        bearing_systematic_deg=0.5 * std,
        elevation_deg=elevation,
        elevation_std_deg=None if elevation is None else std,
        elevation_systematic_deg=None if elevation is None else 0.5 * std,
        range_m=range_m,
        range_std_m=None if range_m is None else 0.1,
        range_systematic_m=None if range_m is None else 0.05,
    )


def result(places, estimates, frames=20):
    return LocatedSource({}, ArrayShape.of(places), estimates, frames)


def test_bearings_on_either_side_of_180_deg():
    values = [179.0, -179.0, 178.0, -178.0, 180.0]
    found = result(ROW, [estimate(k, v) for k, v in enumerate(values)]).main_source()
    assert abs(found["bearing_deg"]) == pytest.approx(180.0)
    assert found["bearing_std_deg"] == pytest.approx(1.4826)


def test_other_sources_do_not_move_the_main_one():
    bearings = [30.0, 31.0, 29.0, 30.0, 120.0, 125.0, 119.0]
    found = result(ROW, [estimate(k, b) for k, b in enumerate(bearings)]).main_source()
    assert found["bearing_deg"] == pytest.approx(30.0)
    assert found["frames_of_main_source"] == 4
    assert found["frames_heard"] == 7


def test_moving_source_has_the_bearing_of_the_middle():
    bearings = np.linspace(-60.0, 60.0, 41)
    found = result(ROW, [estimate(k, b) for k, b in enumerate(bearings)]).main_source()
    assert found["bearing_deg"] == pytest.approx(0.0, abs=1e-9)
    assert found["frames_of_main_source"] == 41


def test_few_estimates_do_not_feign_certainty():
    """One value has no scatter, and values in common error little."""
    one = result(ROW, [estimate(0, 30.0, std=0.7)]).main_source()
    assert one["bearing_std_deg"] == pytest.approx(0.7)
    agreed = [estimate(k, 30.0 + 0.01 * k, std=0.7) for k in range(9)]
    assert result(ROW, agreed).main_source()["bearing_std_deg"] == pytest.approx(0.7)


def test_certain_estimates_count_more():
    bearings = [estimate(k, 10.0, std=0.3) for k in range(4)]
    bearings += [estimate(k, 14.0, std=3.0) for k in range(4, 10)]
    assert result(ROW, bearings).main_source()["bearing_deg"] == pytest.approx(
        10, abs=0.5
    )


@pytest.mark.parametrize(
    ("places", "bearing", "elevation", "ambiguity", "other"),
    [
        (SQUARE, 170.0, 20.0, "mirror", (170.0, -20.0)),
        (UPRIGHT, 50.0, 20.0, "mirror", (-50.0, 20.0)),
        (ROW, 50.0, None, "front_back", (-50.0, None)),
    ],
)
def test_alternatives(places, bearing, elevation, ambiguity, other):
    found = result(places, [estimate(0, bearing, elevation)]).main_source()
    assert found["ambiguity"] == ambiguity
    (alternative,) = found["alternatives"]
    assert alternative["bearing_deg"] == pytest.approx(other[0])
    if other[1] is None:
        assert alternative["elevation_deg"] is None
    else:
        assert alternative["elevation_deg"] == pytest.approx(other[1])


def test_flat_array_has_no_alternative():
    flat = [p[:2] for p in SQUARE]
    found = result(flat, [estimate(0, 50.0)]).main_source()
    assert (found["ambiguity"], found["alternatives"]) == ("none", [])


def test_range_of_few_estimates_is_none():
    few = [estimate(k, 10.0, range_m=2.0 if k < 4 else None) for k in range(10)]
    most = [estimate(k, 10.0, range_m=2.0 if k < 6 else None) for k in range(10)]
    assert result(ROW, few).main_source()["range_m"] is None
    few_text = locate_text(result(ROW, few))
    assert "no single range: 4 of 10 estimates have one, from 2.000 to 2" in few_text
    none = [estimate(k, 10.0) for k in range(10)]
    assert "range not observable (microphones" in locate_text(result(ROW, none))
    assert result(ROW, most).main_source()["range_m"] == pytest.approx(2.0)
    assert result(ROW, most).main_source()["observable"] == ["bearing", "range"]


def test_many_estimates_do_not_flood_a_terminal():
    """The summary is first; rows are evenly spaced, with the first and the last."""
    many = [estimate(k, 10.0) for k in range(1_000)]
    lines = locate_text(result(ROW, many)).splitlines()
    assert len(lines) <= 20
    assert lines[0].startswith("heard a source in 1000")
    assert lines[-1].startswith("10 of 1000 estimates; --json prints all of them")
    times = [float(line.split()[0]) for line in lines[-11:-1]]
    assert (times[0], times[-1]) == (many[0].t_s, many[-1].t_s)
    few = locate_text(result(ROW, many[:10])).splitlines()
    assert len(few) == len(lines) - 1


def test_range_that_scatters_by_more_than_is_allowed_is_none():
    """Each is stated to 0.1 m, but they are off by 0.7 m from their median."""
    ranges = [1.3, 2.0, 2.7, 1.3, 2.0, 2.7, 1.3, 2.7]
    far = [estimate(k, 10.0, range_m=r) for k, r in enumerate(ranges)]
    found = result(ROW, far).main_source()
    assert (found["range_m"], found["range_std_m"], found["range_systematic_m"]) == (
        None,
        None,
        None,
    )
    assert found["observable"] == ["bearing"]
    text = locate_text(result(ROW, far))
    assert "no single range: 8 of 8 estimates have one, from 1.300 to 2.700" in text
    assert "not observable (microphones" not in text
    assert "no single range" in plot_locate(result(ROW, far)).get_suptitle()
    near = [estimate(k, 10.0, range_m=2.0 + 0.1 * r) for k, r in enumerate(ranges)]
    assert result(ROW, near).main_source()["range_systematic_m"] == 0.05
    assert "(std 0.104, of which 0.050 from errors of array and air" in locate_text(
        result(ROW, near)
    )


def test_nothing_heard():
    silent = result(SQUARE, [])
    assert silent.main_source()["bearing_deg"] is None
    assert silent.main_source()["observable"] == []
    assert "nothing to locate" in locate_text(silent)
    assert len(plot_locate(silent).axes) == 1


def test_picture_and_files(tmp_path):
    estimates = [
        estimate(0.1 * k, math.copysign(179.0, k % 2 - 0.5), 20.0) for k in range(9)
    ]
    found = result(SQUARE, estimates)
    figure = plot_locate(found)
    bearing, elevation, plan = figure.axes
    assert bearing.get_ylabel() == "bearing (deg)"
    assert elevation.get_ylabel() == "elevation (deg)"
    # Estimates near 180 deg stay together.
    low, high = bearing.get_ylim()
    assert high - low < 10.0
    assert plan.get_aspect() == 1.0
    assert "range not observable" in figure.get_suptitle()
    write_locate(found, found.document(), tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {"locate.json", "locate.png"}
    document = json.loads((tmp_path / "locate.json").read_text())
    assert document["summary"]["elevation_deg"] == pytest.approx(20.0)


def talkers(*bearings, steady=False):
    """Sources at some bearings that are heard alike."""
    share = 1.0 / len(bearings)
    return HeardSources(
        [HeardSource(b, 1.0, None, None, share, 1.0) for b in bearings], [], steady
    )


def test_the_summary_is_of_one_of_the_sources_where_none_has_most_estimates():
    bearings = [-90.0, -88.0, 0.0, 1.0, -1.0, 90.0, 91.0]
    estimates = [estimate(0.1 * k, b) for k, b in enumerate(bearings)]
    heard = talkers(-89.0, 0.0, 90.0)
    found = LocatedSource({}, ArrayShape.of(SQUARE), estimates, 20, heard=heard)
    assert found.main_source()["bearing_deg"] == pytest.approx(0.0, abs=1.0)
    assert found.main_source()["frames_of_main_source"] == 3
    assert found.main_source()["number_of_sources"] == 3
    text = locate_text(found)
    assert "3 sources" in text
    assert text.count("% of what is heard") == 3


def test_estimates_that_no_source_is_near_are_summed_up_as_before():
    estimates = [estimate(0.1 * k, 10.0) for k in range(4)]
    heard = talkers(100.0, -100.0)
    found = LocatedSource({}, ArrayShape.of(SQUARE), estimates, 20, heard=heard)
    assert found.main_source()["bearing_deg"] == pytest.approx(10.0)


def test_the_number_of_sources_of_a_steady_sound_is_not_told():
    estimates = [estimate(0.1 * k, 10.0) for k in range(4)]
    heard = talkers(10.0, steady=True)
    found = LocatedSource({}, ArrayShape.of(SQUARE), estimates, 20, heard=heard)
    assert found.main_source()["number_of_sources"] is None
    assert "steady: the number of sources is unknown" in locate_text(found)


@pytest.mark.parametrize(
    ("bearings", "middle"),
    [((170.0, -170.0), 180.0), ((80.0, -80.0, 0.0), 0.0), ((90.0, 180.0), 135.0)],
)
def test_several_sources_are_drawn_without_a_cut_between_them(bearings, middle):
    estimates = [estimate(0.1 * k, b) for k, b in enumerate(bearings)]
    heard = talkers(*bearings)
    found = LocatedSource({}, ArrayShape.of(SQUARE), estimates, 20, heard=heard)
    low, high = plot_locate(found).axes[0].get_ylim()
    half = max(abs((b - middle + 180.0) % 360.0 - 180.0) for b in bearings)
    assert high - low < 2.0 * half + 20.0
