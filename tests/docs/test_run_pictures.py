"""The pictures of runs are shown in the pages, and show what the pages say."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from diagrams import simulate
from docs.building.law_rates import SUMMARY, plot_law_rates
from docs.building.run_pictures import PICTURES, RATES

ROOT = Path(__file__).resolve().parents[2]


def test_each_picture_is_in_a_page() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    text = "".join(page.read_text("utf-8") for page in pages)
    shown = set(re.findall(r"images/(\w+)\.png", text))
    assert {*PICTURES, RATES} <= shown


def test_rates_of_laws_are_those_of_the_summary() -> None:
    """Points of the panels, against the counts of runs that ended by collision."""
    cells = json.loads(SUMMARY.read_text("utf-8"))["cells"]
    counted = [
        sum(n for cause, n in cell["causes"].items() if cause.startswith("collision"))
        for cell in cells
    ]
    panels: list[Any] = plot_law_rates().axes[1::4]
    drawn = [panel.containers[0].lines[0].get_xdata() for panel in panels]
    assert [100 * x for values in drawn for x in values] == pytest.approx(counted)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in PICTURES if "guard" in n])
def test_guarded_runs_end_as_the_page_says(name: str) -> None:
    """The worst one in a collision, the others without."""
    result = simulate(PICTURES[name](), engine="compiled")
    assert (result.collision is not None) == (name == "guarded_worst")
