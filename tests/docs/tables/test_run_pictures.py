"""The pictures of runs in the pages are those that today's code draws."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from analysis.runs.run_plots import plot_trajectory
from diagrams import simulate
from docs.tables.run_pictures import IMAGES, PICTURES

ROOT = Path(__file__).resolve().parents[3]
#: A pixel that differs so much is drawn otherwise, in shares of white.
OTHERWISE = 0.2


def test_each_picture_is_in_a_page() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    text = "".join(page.read_text("utf-8") for page in pages)
    shown = set(re.findall(r"images/(\w+)\.png", text))
    assert set(PICTURES) <= shown


@pytest.mark.slow
@pytest.mark.parametrize("name", ["trajectory", *(n for n in PICTURES if "guard" in n)])
def test_a_picture_is_that_of_today(name: str, tmp_path: Path) -> None:
    """And the runs end as docs/safety.md says of them."""
    result = simulate(PICTURES[name](), engine="compiled")
    if name == "guarded_worst":
        assert result.collision is not None
        assert result.collision.fault == "robot"
    else:
        assert result.collision is None
    path = tmp_path / "drawn.png"
    plot_trajectory(result).savefig(path, dpi=150)
    drawn, kept = imread(path), imread(IMAGES / f"{name}.png")
    assert drawn.shape == kept.shape
    # A star's outline alone has some hundred.
    otherwise = np.abs(drawn - kept).max(axis=2) > OTHERWISE
    assert np.count_nonzero(otherwise) < 60
