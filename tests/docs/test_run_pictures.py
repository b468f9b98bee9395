"""The pictures of runs are shown in the pages, and show what the pages say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from diagrams import simulate
from docs.building.run_pictures import PICTURES

ROOT = Path(__file__).resolve().parents[2]


def test_each_picture_is_in_a_page() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    text = "".join(page.read_text("utf-8") for page in pages)
    shown = set(re.findall(r"images/(\w+)\.png", text))
    assert set(PICTURES) <= shown


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in PICTURES if "guard" in n])
def test_guarded_runs_end_as_the_page_says(name: str) -> None:
    """The worst one in a collision, the others without."""
    result = simulate(PICTURES[name](), engine="compiled")
    assert (result.collision is not None) == (name == "guarded_worst")
