"""What is told of a step, as JSON, as text and on a screen."""

from __future__ import annotations

import io
import json
import math

import numpy as np
import pytest

from analysis.arrays.live_hearing import HeardStep
from analysis.arrays.step_views import JsonLines, Screen, TextLines, view
from analysis.arrays.voting.source_listener import TrackedSources
from analysis.arrays.voting.track_state import SourceTrack


def track(identity: int, bearing_deg: float, *, sounding: float = 0.9) -> SourceTrack:
    return SourceTrack(
        identity=identity,
        bearing=math.radians(bearing_deg),
        rate=0.0,
        covariance=np.diag([math.radians(3.0) ** 2, 0.1]),
        elevation=None,
        sounding=sounding,
        silent=0.95 - sounding,
        t_born=0.0,
        t_heard=0.0,
        t_shared=0.0,
        hits=9,
        share=0.5,
    )


def step(t_s: float, *tracks: SourceTrack) -> HeardStep:
    return HeardStep(TrackedSources(t_s, tracks), -36.0)


@pytest.mark.parametrize(
    ("bearing_deg", "place"),
    [
        (0.0, 0.5),
        (90.0, 0.25),
        (-90.0, 0.75),
        (179.9, 0.0),
        (-179.9, 1.0),
        (45.0, 0.375),
    ],
)
@pytest.mark.parametrize("width", [80, 60, 30])
def test_the_compass_goes_from_behind_over_the_left_to_behind(
    bearing_deg, place, width
):
    lines = view(step(1.0, track(7, bearing_deg)), width, [])
    compass = lines[2][1:]
    assert max(map(len, lines[1:3])) < width
    assert compass.index("7") == pytest.approx(place * (len(compass) - 1), abs=0.5)


def test_the_screen_tells_time_level_and_all_of_each_source():
    two = step(2.5, track(1, 30.0), track(12, -60.0, sounding=0.2))
    lines = view(two, 80, ["! 2.0 s: a fault"])
    assert lines[0] == "      2.5 s   level ██████░░░░░░  -36 dB"
    assert lines[3:] == [
        "   1:  +30 ±3 deg   95 %  sounds",
        "   12:  -60 ±3 deg   95 %  pauses",
        "! 2.0 s: a fault",
    ]


def test_the_screen_is_drawn_in_place_and_the_cursor_comes_back():
    out = io.StringIO()
    with Screen(out, io.StringIO()) as screen:
        screen.tell(step(0.1, track(1, 0.0)))
        before = out.tell()
        screen.tell(step(0.2))
    drawn = out.getvalue()
    assert drawn.startswith("\x1b[?25l")
    assert drawn.endswith("\x1b[?25h")
    # Up by the four lines of before, and what one source less leaves is wiped.
    assert drawn[before:].startswith("\x1b[4F")
    assert drawn[before:].count("\n") == 3
    assert "\x1b[J" in drawn[before:]


def test_json_has_a_line_for_each_source_and_fault():
    out, errors = io.StringIO(), io.StringIO()
    lines = JsonLines(out, errors)
    lines.tell(step(0.3, track(1, 30.0), track(2, -60.0)))
    lines.name_fault("channel 1: clipped", 0.4)
    first, second, fault = map(json.loads, out.getvalue().splitlines())
    assert first == {
        "t_s": 0.3,
        "source": 1,
        "bearing_deg": 30.0,
        "bearing_std_deg": 3.0,
        "elevation_deg": None,
        "confidence": 0.95,
        "sounding": 0.9,
    }
    assert (second["source"], second["bearing_deg"]) == (2, -60.0)
    assert fault == {"t_s": 0.4, "fault": "channel 1: clipped"}
    assert errors.getvalue() == "phonotaxis: at 0.4 s: channel 1: clipped\n"


def test_text_has_a_line_a_second():
    out = io.StringIO()
    lines = TextLines(out, io.StringIO())
    for k in range(1, 31):
        lines.tell(step(0.1 * k, track(1, 30.0)))
    assert [line.split()[0] for line in out.getvalue().splitlines()] == [
        "1.0",
        "2.0",
        "3.0",
    ]
