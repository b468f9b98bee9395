"""The papers' claims and the failures, from the committed comparisons."""

from __future__ import annotations

import copy
import json
from itertools import combinations
from typing import Any

import pytest

from studies.__main__ import main
from studies.claims import CLAIMS
from studies.failure_shares import failure_table
from tests.results import RESULTS, comparison, documented, headings, numbers

STATIC_CONVENTIONAL = "two_static_obstacles", {"law": "conventional"}
LAWS, FOLLOWING, SLIP, WIDTH = map(comparison, ("laws", "following", "slip", "width"))


@pytest.mark.parametrize(
    ("study", "table", "results"),
    [
        ("claims", "claims", ["laws", "following", "slip"]),
        ("failure_shares", "failures", ["laws"]),
        ("hearing_equivalence", "hearing", ["hearing"]),
    ],
)
def test_documented_tables_are_those_of_the_comparisons(
    study, table, results, tmp_path, capsys
):
    files = [str(RESULTS / "comparisons" / f"{name}.json") for name in results]
    assert main([study, *files, "--out", str(tmp_path / "new.json")]) == 0
    assert capsys.readouterr().out.count("\n|") > 5
    found = json.loads((tmp_path / "new.json").read_text("utf-8"))["tables"][table]
    assert found["columns"] == headings(study, table)
    assert found["rows"] == documented(study, table)


def test_committed_result_has_a_thousand_runs_a_cell():
    cells = LAWS["cells"] + FOLLOWING["cells"]
    assert all(cell["runs"] >= 1000 for cell in cells)
    assert {cell["fields"]["law"] for cell in LAWS["cells"]} == {
        "conventional",
        "active",
        "conventional2017",
        "active2017",
    }


def test_what_the_width_costs():
    rows = documented("width", "endings")
    for law, row in zip(("conventional", "active"), rows, strict=True):
        assert row[0].startswith(f"{law}:")
        for width, cell in zip((0.82, 0.41), row[1:], strict=True):
            (found,) = (
                c
                for c in WIDTH["cells"]
                if c["fields"] == {"law": law, "robot.width_m": width}
            )
            rates = [100 * found[name]["value"] for name in ("success", "collision")]
            assert numbers(cell) == pytest.approx(rates, abs=0.5)


def test_what_came_into_the_goal_is_in_no_jam():
    """Whatever else failed there: the figure and the verdict stay the same."""
    claim = next(c for c in CLAIMS if "conventional jams" in c.text)
    swinging = copy.deepcopy(LAWS)
    for cell in swinging["cells"]:
        if (cell["scenario"], cell["fields"]["law"]) == (
            "two_static_obstacles",
            "conventional",
        ):
            cell["mechanisms"] |= {"swings": 300, "held off": 200}
    assert claim.judge(swinging) == claim.judge(LAWS)
    stuck = copy.deepcopy(LAWS)
    for cell in stuck["cells"]:
        if (cell["scenario"], cell["fields"]["law"]) == (
            "two_static_obstacles",
            "conventional",
        ):
            cell["mechanisms"] |= {"jam": 500}
    assert claim.judge(stuck)[1] == "holds"


def test_failures_table_has_the_mechanisms_that_occur():
    cell = {"scenario": "here", "fields": {"law": "active"}, "runs": 200}
    summary = {"cells": [{**cell, "mechanisms": {"swings": 20, "jam": 1}}]}
    assert str(failure_table(summary)).splitlines() == [
        "| scenario | law | failures | jam | swings |",
        "|---|---|---|---|---|",
        "| here | active | 10.5 % | 0.5 % | **10.0 %** |",
    ]


def test_mechanisms_account_for_all_failures():
    for cell in LAWS["cells"]:
        failed = cell["runs"] - round(cell["success"]["value"] * cell["runs"])
        assert sum(cell["mechanisms"].values()) == failed


def changed(**pair: Any) -> dict[str, Any]:
    """The result with the collisions of two static obstacles so instead."""
    summary = copy.deepcopy(LAWS)
    for entry in summary["pairs"]:
        if (entry["first"], entry["second"]) == ("conventional", "active"):
            entry["collision"]["difference"] |= pair
    return summary


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (0.01, 0.05, "holds"),
        (-0.02, 0.05, "not shown"),
        (-0.05, -0.01, "the reverse holds"),
    ],
)
def test_verdict_is_that_of_the_interval(low, high, verdict):
    claim = next(c for c in CLAIMS if "static obstacles better" in c.text)
    assert claim.judge(changed(low=low, high=high))[1] == verdict


def interval(value: float) -> dict[str, float]:
    """A number with an interval of 0.1 to both sides."""
    return {"value": value, "low": value - 0.1, "high": value + 0.1, "n": 100}


def rates_only(scenario: str, rates: dict[str, float]) -> dict[str, Any]:
    """A summary of 100 runs a law, with collision rates and nothing else."""
    names = list(rates)
    cells = [
        {
            "scenario": scenario,
            "fields": {"law": law},
            "collision": interval(rate),
        }
        for law, rate in rates.items()
    ]
    pairs = [
        {
            "scenario": scenario,
            "first": first,
            "second": second,
            "fields": {},
            "collision": {
                "difference": interval(rates[first] - rates[second]),
                "only_first": 10 * names.index(first),
                "only_second": 10 * names.index(second),
            },
        }
        for first, second in combinations(names, 2)
    ]
    return {"cells": cells, "pairs": pairs}


@pytest.mark.parametrize(
    ("kim", "verdict"),
    [(0.51, "not shown"), (0.9, "holds"), (0.3, "the reverse holds")],
)
def test_kim_is_judged_against_his_own_conventional_law(kim, verdict):
    """Eq. 20 of 2017, and not eq. 19-a of 2019, from which he is 40 points off."""
    rates = {"conventional": 0.9, "conventional2017": kim, "active2017": 0.5}
    summary = rates_only("two_static_obstacles", rates)
    (claim,) = [claim for claim in CLAIMS if claim.source.startswith("Kim")]
    figure, found = claim.judge(summary)
    assert found == verdict
    assert f"conventional2017 {100 * kim:.1f} %" in figure
    assert "10 layouts where conventional2017 alone" in figure


def slippery(**floors: dict[str, tuple[float, float]]) -> dict[str, Any]:
    """The result with intervals of figures of encounters so on some floors.

    Args:
        floors: By name, as ``icy``; each holds intervals in m by metric.
    """
    summary = copy.deepcopy(SLIP)
    frictions = {"icy": 0.1, "wet": 0.15}
    for pair in summary["pairs"]:
        if pair["field"] == "law":
            slip = pair["encounters"]["slip_way_m"]
            slip["first"] = slip["second"] = 0.004
            for floor, metrics in floors.items():
                if pair["fields"] == {"plant.friction": frictions[floor]}:
                    slip["first"] = 0.05
                    for name, (low, high) in metrics.items():
                        pair["encounters"][name]["difference"] |= {
                            "low": low,
                            "high": high,
                        }
    return summary


LESS, SAME, MORE = (0.001, 0.002), (-0.001, 0.001), (-0.002, -0.001)


@pytest.mark.parametrize(
    ("icy", "wet", "verdict"),
    [
        (LESS, LESS, "holds"),
        (LESS, SAME, "not shown"),
        (SAME, SAME, "not shown"),
        (MORE, MORE, "the reverse holds"),
        (LESS, MORE, "depends on the floor"),
    ],
)
def test_slippage_is_judged_on_every_floor(icy, wet, verdict):
    claim = next(c for c in CLAIMS if "less slippage than" in c.text)
    summary = slippery(icy={"slip_way_m": icy}, wet={"slip_way_m": wet})
    figure, judged = claim.judge(summary)
    assert judged == verdict
    assert f"({100 * icy[0]:+.2f}, {100 * icy[1]:+.2f})" in figure, "in cm"


def test_floors_without_slip_do_not_count():
    claim = next(c for c in CLAIMS if "less slippage than" in c.text)
    figure, judged = claim.judge(slippery(icy={"slip_way_m": LESS}))
    assert judged == "holds"
    assert "friction 0.15: no slip; friction 0.3: no slip" in figure


@pytest.mark.parametrize(
    ("final", "rms", "verdict"),
    [
        (LESS, LESS, "holds"),
        (MORE, MORE, "the reverse holds"),
        (LESS, SAME, "not shown"),
        (LESS, MORE, "depends on the floor"),
    ],
)
def test_accuracy_is_judged_at_the_end_and_on_the_way(final, rms, verdict):
    claim = next(c for c in CLAIMS if "accurate" in c.text)
    errors = {"odometry_error_final_m": final, "odometry_error_rms_m": rms}
    assert claim.judge(slippery(icy=errors))[1] == verdict
