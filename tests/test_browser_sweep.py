"""The page of a sweep opens in a browser without network."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

import phonotaxis

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SWEEP = {
    "set": {"hearing": "ideal", "duration_s": 1.0},
    "grid": {"law": ["none", "active"], "source.speed_m_s": [0.2, 0.4]},
    "draw": {"source.heading_deg": {"uniform": [0.0, 90.0]}},
    "runs": 10,
}


def test_opens_without_a_word_on_the_console(
    chromium: Callable[..., str], check_page: Callable[..., None], tmp_path: Path
) -> None:
    (tmp_path / "sweep.yaml").write_text(json.dumps(SWEEP))
    out = tmp_path / "out"
    words = ["sweep", str(tmp_path / "sweep.yaml"), "--out", str(out)]
    assert phonotaxis.main(words) == 0
    shot = tmp_path / "report.png"
    log = chromium(
        out / "report.html", f"--screenshot={shot}", "--window-size=1000,2400"
    )
    assert "CONSOLE" not in log
    picture = np.asarray(imread(shot))[:, :, :3]
    # Ink on every stretch of the page, and white round it.
    rows = picture.min(axis=(1, 2)).reshape(8, -1).min(axis=1)
    assert (rows < 0.5).all()
    assert np.median(picture) > 0.95
    check_page(out / "report.html")
