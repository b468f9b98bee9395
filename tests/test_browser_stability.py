"""The stability report opens in a browser without network, and prints."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from analysis.stability.law_analysis import analyze_law
from analysis.stability.report_files import stability_page
from analysis.stability.report_parts import SOUND_PARTS
from diagrams import load_scenario

pytestmark = [pytest.mark.browser, pytest.mark.slow]

#: The first parts have tables, matrices and every kind of figure.
PARTS = 4


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stability") / "report.html"
    analysis = analyze_law(load_scenario(), SOUND_PARTS[:PARTS])
    path.write_text(stability_page([analysis]))
    return path


def test_opens_without_a_word_on_the_console(
    chromium: Callable[..., str], report: Path
) -> None:
    shot = report.parent / "report.png"
    log = chromium(report, f"--screenshot={shot}", "--window-size=1000,4000")
    assert "CONSOLE" not in log
    picture = np.asarray(imread(shot))[:, :, :3]
    # Ink on every stretch of the page, and white round it.
    rows = picture.min(axis=(1, 2)).reshape(8, -1).min(axis=1)
    assert (rows < 0.5).all()
    assert np.median(picture) > 0.95


def test_it_does_at_all_widths_by_day_and_by_night(
    report: Path, check_page: Callable[..., None]
) -> None:
    check_page(report)


def test_a_script_that_fails_would_be_seen(
    chromium: Callable[..., str], tmp_path: Path
) -> None:
    page = tmp_path / "bad.html"
    page.write_text("<script>nowhere()</script>")
    assert "CONSOLE" in chromium(page, f"--screenshot={tmp_path / 'bad.png'}")


def test_prints_on_several_sheets_of_paper(
    chromium: Callable[..., str], report: Path
) -> None:
    pdf = report.parent / "report.pdf"
    chromium(report, f"--print-to-pdf={pdf}", "--no-pdf-header-footer")
    sheets = re.findall(rb"/Type /Page\b", pdf.read_bytes())
    assert len(sheets) > PARTS
