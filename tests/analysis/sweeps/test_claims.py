"""The pages on claims and failures quote the committed comparison."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from analysis.sweeps.claims import CLAIMS, claims_table
from analysis.sweeps.failure_shares import failure_table

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "docs" / "results"
LAWS = json.loads((RESULTS / "laws.json").read_text("utf-8"))
FOLLOWING = json.loads((RESULTS / "following.json").read_text("utf-8"))
WIDTH = json.loads((RESULTS / "width.json").read_text("utf-8"))


def test_claims_page_holds_the_table_of_the_committed_result():
    assert claims_table([LAWS, FOLLOWING]) in (ROOT / "docs" / "claims.md").read_text(
        "utf-8"
    )


def test_failures_page_holds_the_table_of_the_committed_result():
    assert failure_table(LAWS) in (ROOT / "docs" / "failures.md").read_text("utf-8")


def test_committed_result_has_a_thousand_runs_a_cell():
    cells = LAWS["cells"] + FOLLOWING["cells"]
    assert all(cell["runs"] >= 1000 for cell in cells)
    assert {cell["law"] for cell in LAWS["cells"]} == {
        "conventional",
        "active",
        "active2017",
    }


def test_failures_page_quotes_what_the_width_costs():
    page = (ROOT / "docs" / "failures.md").read_text("utf-8")
    for law in ("conventional", "active"):
        wide, narrow = (
            next(
                f"{100 * c['success']['estimate']:.0f} %, "
                f"{100 * c['collision']['estimate']:.0f} %"
                for c in WIDTH["cells"]
                if (c["law"], c["fields"]["robot.width_m"]) == (law, width)
            )
            for width in (0.82, 0.41)
        )
        assert f"| {law}: success, collision | {wide} | {narrow} |" in page


def test_mechanisms_account_for_all_failures():
    for cell in LAWS["cells"]:
        failed = cell["runs"] - round(cell["success"]["estimate"] * cell["runs"])
        assert sum(cell["mechanisms"].values()) == failed


def changed(**pair: Any) -> dict[str, Any]:
    """The result with the collisions of two static obstacles so instead."""
    summary = copy.deepcopy(LAWS)
    for entry in summary["pairs"]:
        if (entry["first"], entry["second"]) == ("conventional", "active"):
            entry["collision"] |= pair
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
