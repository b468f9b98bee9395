"""One list of sources from votes, estimates and faults that are made up."""

from __future__ import annotations

import pytest

from analysis.arrays.channel_fault import ChannelFault
from analysis.arrays.heard_sources import FollowedSource, HeardSource, HeardSources
from analysis.arrays.locate_result import LocatedSource
from analysis.arrays.locate_text import locate_text
from analysis.arrays.source_estimate import SourceEstimate
from systems.sound.array_shape import ArrayShape

SQUARE = [[0.1, 0.1, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, -0.1, 0.0]]


def estimates(*bearings, elevation=10.0, range_m=None):
    return [
        SourceEstimate(
            0.1 * k,
            b,
            1.0,
            0.5,
            elevation,
            2.0,
            1.0,
            range_m,
            None if range_m is None else 0.01,
            None if range_m is None else 0.01,
        )
        for k, b in enumerate(bearings)
    ]


def source(bearing, share=1.0, elevation=10.0):
    return HeardSource(bearing, 2.0, elevation, 5.0, share, 1.0)


def located(heard, found, faults=()):
    return LocatedSource(
        {}, ArrayShape.of(SQUARE), found, 20, list(faults), HeardSources(**heard)
    )


def test_summary_and_first_source_are_the_same():
    result = located({"sources": [source(31.0)]}, estimates(30.0, 29.0, 30.0))
    document = result.document()
    first, summary = document["sources"][0], document["summary"]
    for name in ("bearing_deg", "bearing_std_deg", "elevation_deg"):
        assert first[name] == summary[name]
    assert first["bearing_deg"] == pytest.approx(30.0)
    assert (summary["number_of_sources"], summary["doubt"]) == (1, None)


def test_what_only_the_votes_heard_is_the_summary():
    result = located({"sources": [source(50.0)]}, [])
    summary = result.main_source()
    assert (summary["bearing_deg"], summary["bearing_std_deg"]) == (50.0, 2.0)
    assert (summary["frames_of_main_source"], summary["number_of_sources"]) == (0, 1)
    assert "nothing to locate" not in locate_text(result)


@pytest.mark.parametrize(
    ("heard", "found", "faults", "why"),
    [
        ({}, {}, [ChannelFault("late", (2,), "late")], "faults"),
        ({"steady": True}, {}, [], "steady"),
        ({"unfit": True}, {}, [], "phases"),
        ({}, {"range_m": 0.3}, [], "near"),
    ],
)
def test_doubted_sources_are_not_sure(heard, found, faults, why):
    heard = {"sources": [source(30.0)], **heard}
    document = located(heard, estimates(30.0, 31.0, **found), faults).document()
    assert document["summary"]["number_of_sources"] is None
    assert why in document["summary"]["doubt"]
    assert all(s["confidence"] <= 0.5 for s in document["sources"])


@pytest.mark.parametrize("kind", ["clipped", "inverted"])
def test_faults_that_turn_no_direction_are_no_doubt(kind):
    fault = ChannelFault(kind, (1,), kind)
    result = located({"sources": [source(30.0)]}, estimates(30.0), [fault])
    assert result.number_of_sources == 1


def test_votes_that_no_estimate_bears_out_are_left_out_if_they_are_doubted():
    document = located({"sources": [source(30.0)], "unfit": True}, []).document()
    assert document["sources"] == []
    assert document["summary"]["number_of_sources"] is None


def test_side_lobes_are_not_sure_and_the_confirmed_source_is():
    sources = [source(81.0, 0.6), source(54.0, 0.4)]
    found = estimates(53.0, 54.0, 55.0, 54.0, 81.0)
    document = located(
        {"sources": sources, "needs_estimates": "side lobes"}, found
    ).document()
    assert [s["bearing_deg"] for s in document["sources"]] == pytest.approx([54, 81])
    assert [s["confidence"] for s in document["sources"]] == [1.0, 0.5]
    assert document["summary"]["number_of_sources"] is None


def test_of_sources_that_need_estimates_each_has_the_direction_of_its_own():
    sources = [source(60.0, 0.6), source(28.0, 0.4)]
    found = estimates(55.0, 56.0, 57.0, 20.0, 24.0, 22.0)
    heard = {"sources": sources, "needs_estimates": "side lobes"}
    document = located(heard, found).document()
    assert [s["bearing_deg"] for s in document["sources"]] == pytest.approx([56, 22])
    assert [s["confidence"] for s in document["sources"]] == [1.0, 1.0]
    assert document["summary"]["number_of_sources"] == 2


def test_what_the_votes_missed_comes_first_and_is_not_sure():
    document = located({"sources": [source(-170.0)]}, estimates(50.0)).document()
    assert document["summary"]["bearing_deg"] == pytest.approx(50.0)
    assert [s["confidence"] for s in document["sources"]] == [0.5, 0.5]


def test_the_loudest_is_the_main_source_though_the_other_has_more_estimates():
    sources = [source(0.0, 0.9), source(120.0, 0.1)]
    found = estimates(1.0, 120.0, 121.0, 119.0, 120.0)
    result = located({"sources": sources, "beside_steady": True}, found)
    assert result.main_source()["bearing_deg"] == pytest.approx(1.0)
    assert result.document()["sources"][0]["confidence"] == 1.0
    assert result.number_of_sources is None


def test_steep_estimates_belong_to_a_source_whose_bearing_is_far_off():
    """30 deg of bearing are 5 deg of angle at an elevation of 80 deg."""
    found = estimates(80.0, 81.0, elevation=80.0)
    result = located({"sources": [source(50.0, elevation=80.0)]}, found)
    assert result.main_source()["frames_of_main_source"] == 2
    assert result.number_of_sources == 1


def test_all_estimates_along_a_moving_track_belong_to_its_source():
    bearings = [10.0 * k for k in range(10)]
    track = FollowedSource(1, [0.1 * k for k in range(10)], bearings, 1.0)
    heard = {"sources": [source(40.0)], "tracks": [track]}
    result = located(heard, estimates(*bearings))
    assert result.main_source()["frames_of_main_source"] == 10
    assert result.number_of_sources == 1
