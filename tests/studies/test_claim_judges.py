"""Verdicts on summaries that are made up, each figure written out by hand.

Beside every cell and pair that counts stands one that does not, of another
scenario, law or floor, whose figures say the reverse.
"""

from __future__ import annotations

from typing import Any

import pytest

from studies.support.claim_judges import (
    FREE,
    ONE,
    STATIC,
    TWO,
    accurate,
    avoids_more,
    blind,
    collision_free,
    earlier,
    follows,
    jams,
    slips_less,
    smoother,
    vibrates,
)

LESS, SAME, MORE = (0.1, 0.3), (-0.1, 0.3), (-0.3, -0.1)
ICY = {"plant.friction": 0.1}


def rate(low: float, high: float) -> dict[str, float]:
    return {"value": 0.25 * low + 0.75 * high, "low": low, "high": high, "n": 200}


def cell(scenario: str, law: str, **rest: Any) -> dict[str, Any]:
    return {"scenario": scenario, "fields": {"law": law}, "runs": 200, **rest}


def pair(scenario: str, second: str = "active", **rest: Any) -> dict[str, Any]:
    laws = {"first": "conventional", "second": second}
    return {"scenario": scenario, **laws, "fields": {}, **rest}


def median(
    ends: tuple[float, float], *, value: float = -0.25, **rest: float
) -> dict[str, Any]:
    low, high = ends
    difference = {"value": value, "low": low, "high": high, "n": 40}
    return {"first": 1.25, "second": 1.5, "difference": difference, **rest}


def cells(*entries: dict[str, Any]) -> dict[str, Any]:
    return {"cells": list(entries), "pairs": []}


def pairs(*entries: dict[str, Any]) -> dict[str, Any]:
    return {"cells": [], "pairs": list(entries)}


@pytest.mark.parametrize(
    ("low", "verdict"),
    [(0.96, "holds"), (0.95, "holds"), (0.949, "does not hold")],
)
def test_following_is_to_succeed_in_95_percent(low, verdict):
    error = {"following_error_rms_m": {"value": 0.625}}
    sure = {"metrics": error, "success": rate(1.0, 1.0)}
    summary = cells(
        cell(STATIC, "active", **sure),
        cell(FREE, "conventional", **sure),
        cell(FREE, "active", **sure) | {"fields": {"law": "active", **ICY}},
        cell(FREE, "active", metrics=error, success=rate(low, 0.98)),
    )
    figure, judged = follows(summary)
    assert judged == verdict
    assert f"({100 * low:.1f}, 98.0); median rms" in figure
    assert figure.endswith("0.62 m")


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (0.01, 0.05, "holds"),
        (0.01, 0.051, "not shown"),
        (0.05, 0.2, "not shown"),
        (0.051, 0.2, "does not hold"),
    ],
)
def test_free_of_collisions_is_at_most_5_percent(low, high, verdict):
    rates = {"collision": rate(low, high), "success": rate(0.6, 0.8)}
    wrong = {"collision": rate(0.03, 0.06), "success": rate(0.1, 0.2)}
    summary = cells(
        cell(ONE, "active", **wrong),
        cell(TWO, "conventional", **wrong),
        cell(TWO, "active", **rates),
    )
    figure, judged = collision_free(TWO)(summary)
    assert judged == verdict
    assert figure.endswith("succeeds in 75.0 % (60.0, 80.0)")


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (0.001, 0.2, "holds"),
        (0.0, 0.2, "not shown"),
        (-0.2, 0.0, "not shown"),
        (-0.2, -0.001, "the reverse holds"),
    ],
)
def test_an_interval_that_ends_at_zero_shows_nothing(low, high, verdict):
    rates = {"difference": {"value": 0.125, "low": low, "high": high, "n": 200}}
    counts = {"only_first": 31, "only_second": 6}
    summary = {
        "cells": [
            cell(ONE, "conventional", collision=rate(0.0, 0.4)),
            cell(ONE, "active", collision=rate(0.1, 0.2)),
        ],
        "pairs": [pair(ONE, collision=rates | counts)],
    }
    figure, judged = avoids_more(ONE, "active")(summary)
    assert judged == verdict
    assert figure == (
        "collisions: conventional 30.0 % (0.0, 40.0), active 17.5 % (10.0, 20.0); "
        f"+12.5 points ({100 * low:+.1f}, {100 * high:+.1f}); 31 layouts where "
        "conventional alone collides, 6 where active alone does"
    )


@pytest.mark.parametrize(
    ("jerk", "sparc", "verdict"),
    [
        (LESS, MORE, "holds"),
        (LESS, SAME, "holds"),
        (SAME, MORE, "holds"),
        (SAME, SAME, "not shown"),
        (MORE, SAME, "the reverse holds"),
        (SAME, LESS, "the reverse holds"),
        (MORE, LESS, "the reverse holds"),
        (LESS, LESS, "jerk and SPARC disagree"),
        (MORE, MORE, "jerk and SPARC disagree"),
    ],
)
def test_smoother_is_less_jerk_or_more_sparc_and_neither_against_it(
    jerk, sparc, verdict
):
    """SPARC is negative, the more so the less smooth: the first's is the lower."""
    metrics = {"jerk_rms_m_s3": median(jerk), "sparc": median(sparc)}
    other = {"jerk_rms_m_s3": median(SAME), "sparc": median(SAME)}
    summary = pairs(
        pair(STATIC, "active2017", encounters=other),
        pair(STATIC, encounters=metrics),
    )
    figure, judged = smoother(STATIC)(summary)
    assert judged == verdict
    assert figure == (
        "rms jerk 1.25 m/s^3 (conventional) and 1.50 m/s^3 (active); -0.25 m/s^3 "
        f"({jerk[0]:+.2f}, {jerk[1]:+.2f}) in 40 pairs; SPARC -0.250 "
        f"({sparc[0]:+.3f}, {sparc[1]:+.3f})"
    )


@pytest.mark.parametrize("missing", ["jerk_rms_m_s3", "sparc"])
def test_smoothness_that_no_pair_has_shows_nothing(missing):
    metrics = {"jerk_rms_m_s3": median(LESS), "sparc": median(MORE)}
    del metrics[missing]
    figure, judged = smoother(STATIC)(pairs(pair(STATIC, encounters=metrics)))
    assert (figure[:9], judged) == ("no layout", "not shown")


def floor(friction: float, slip: float, ends, **rest: Any) -> dict[str, Any]:
    figures = {"slip_way_m": median(ends, first=slip, second=0.001), **rest}
    return pair(STATIC, encounters=figures) | {"fields": {"plant.friction": friction}}


def test_floors_on_which_nothing_slips_do_not_count():
    """4.9 mm is none, 5 mm is some; nor do other laws, scenes, or other fields."""
    sticky = floor(0.3, 0.0049, MORE)
    changes: list[dict[str, Any]] = [
        {"scenario": ONE},
        {"second": "active2017"},
        {"first": "none"},
        {"fields": {}},
    ]
    wrong = [floor(0.1, 0.1, MORE) | change for change in changes]
    empty = pair(STATIC, encounters={}) | {"fields": {"plant.friction": 0.05}}
    figure, judged = slips_less(pairs(*wrong, empty, sticky, floor(0.2, 0.005, LESS)))
    assert judged == "holds"
    assert figure == (
        "the wheels slip: friction 0.05: no layout on which both push and succeed; "
        "friction 0.3: no slip; friction 0.2: 0.50 cm (conventional) and 0.10 cm "
        "(active); -25.00 cm (+10.00, +30.00) in 40 pairs"
    )


def test_slip_of_the_second_alone_is_slip():
    slip = {"slip_way_m": median(MORE, first=0.0, second=0.006)}
    icy = pair(STATIC, encounters=slip) | {"fields": ICY}
    assert slips_less(pairs(icy))[1] == "the reverse holds"


def test_no_floor_with_slip_shows_nothing():
    assert slips_less(pairs(floor(0.3, 0.0, LESS))) == (
        "the wheels slip: friction 0.3: no slip",
        "not shown",
    )


@pytest.mark.parametrize(
    ("final", "rms", "verdict"),
    [
        (LESS, LESS, "holds"),
        (SAME, LESS, "not shown"),
        (MORE, LESS, "depends on the floor"),
        (MORE, MORE, "the reverse holds"),
    ],
)
def test_accuracy_is_reported_at_the_end(final, rms, verdict):
    """0.4 and 0.15 m at the end, whatever it is on the way."""
    errors = {
        "odometry_error_final_m": median(final, first=0.4, second=0.15),
        "odometry_error_rms_m": median(rms),
    }
    figure, judged = accurate(pairs(floor(0.1, 0.2, SAME, **errors)))
    assert judged == verdict
    assert "friction 0.1: 40.00 cm (conventional) and 15.00 cm (active)" in figure


@pytest.mark.parametrize(
    ("ends", "verdict"),
    [(MORE, "holds"), (SAME, "not shown"), (LESS, "the reverse holds")],
)
def test_earlier_is_from_farther_away(ends, verdict):
    """The first's distance less the second's is negative where active is earlier."""
    figures = {"reaction_distance_m": median(ends)}
    other = {"reaction_distance_m": median(SAME)}
    summary = pairs(pair(ONE, metrics=other), pair(STATIC, metrics=figures))
    figure, judged = earlier(summary)
    assert judged == verdict
    assert figure.startswith("first push of 0.5 N at 1.25 m (conventional) and 1.50 m")


@pytest.mark.parametrize(
    ("conventional", "active", "verdict"),
    [
        (60, 20, "holds"),  # 24.1 to 36.7 % and 6.6 to 14.9 %
        (40, 30, "not shown"),
        (20, 60, "the reverse holds"),
        (0, 20, "the reverse holds"),  # up to 1.9 %
        (20, 0, "holds"),
        (0, 0, "not shown"),
    ],
)
def test_jams_are_compared_by_wilsons_intervals(conventional, active, verdict):
    summary = cells(
        *(
            cell(STATIC, law, mechanisms={"jam": jammed, "swings": 7} if jammed else {})
            for law, jammed in (("conventional", conventional), ("active", active))
        )
    )
    figure, judged = jams(summary)
    assert judged == verdict
    assert f"conventional {conventional / 2:.1f} % (" in figure
    assert f"active {active / 2:.1f} % (" in figure


def test_jams_have_wilsons_interval():
    """0 of 200: from 0 to z^2 / (n + z^2), z = 1.96."""
    summary = cells(
        *(cell(STATIC, n, mechanisms={}) for n in ("conventional", "active"))
    )
    assert "active 0.0 % (0.0, 1.9) of all layouts" in jams(summary)[0]


@pytest.mark.parametrize(
    ("jerk", "turns", "verdict"),
    [
        (LESS, LESS, "holds"),
        (LESS, SAME, "holds"),
        (SAME, LESS, "holds"),
        (SAME, SAME, "not shown"),
        (LESS, MORE, "not shown"),
        (MORE, SAME, "the reverse holds"),
    ],
)
def test_vibration_is_jerk_or_reversals_and_neither_against_it(jerk, turns, verdict):
    metrics = {
        "jerk_rms_m_s3": median(jerk),
        "turn_reversals_per_s": median(turns, value=0.125),
    }
    other = {"jerk_rms_m_s3": median(SAME), "turn_reversals_per_s": median(SAME)}
    summary = pairs(pair(STATIC, encounters=other), pair(ONE, encounters=metrics))
    figure, judged = vibrates(summary)
    assert judged == verdict
    ends = f"({turns[0]:+.3f}, {turns[1]:+.3f})"
    assert figure.endswith(f"reversals of turning +0.125 1/s {ends}")


def hits(scenario: str, collisions: int, **mechanisms: int) -> dict[str, Any]:
    estimate = {"value": collisions / 200, "low": 0.0, "high": 1.0, "n": 200}
    names = {name.replace("_", " "): count for name, count in mechanisms.items()}
    return cell(scenario, "active", collision=estimate, mechanisms=names)


@pytest.mark.parametrize(
    ("never", "out", "verdict", "shares"),
    [
        (12, 8, "not shown", "30 % were with one that gave no echo, 20 %"),
        (12, 9, "holds", "30 % were with one that gave no echo, 22 %"),
        (0, 32, "holds", "0 % were with one that gave no echo, 80 %"),
    ],
)
def test_most_collisions_are_more_than_half_of_both_scenes(never, out, verdict, shares):
    """8 with one moving obstacle and 32 with two: 40 in all."""
    summary = cells(
        hits(STATIC, 100, no_echo=100),
        hits(ONE, 8, late_echo=8),
        hits(TWO, 32, no_echo=never, out_of_sight=out, echo_in_time=2),
    )
    figure, judged = blind(summary)
    assert judged == verdict
    assert figure.startswith("of 40 collisions")
    assert shares in figure


def test_no_collision_with_what_moves_shows_nothing():
    figure, judged = blind(cells(hits(ONE, 0), hits(TWO, 0)))
    assert (figure[:15], judged) == ("of 0 collisions", "not shown")
