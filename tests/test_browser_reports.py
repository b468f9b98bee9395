"""The pages of a run and of a comparison open in a browser, and lead to their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import phonotaxis

pytestmark = [pytest.mark.browser, pytest.mark.slow]

RUNS = {
    "one": ["two_static_obstacles", "--law", "none", "--set", "hearing=ideal"],
    "several": ["convoy", "--set", "hearing=ideal", "--set", "duration_s=2"],
}
COMPARED = ["two_static_obstacles", "--laws", "none,active", "--runs", "4"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("reports")


@pytest.mark.parametrize("name", list(RUNS))
def test_the_page_of_a_run(folder, browser, check_page, name):
    out = folder / name
    assert phonotaxis.main(["simulate", *RUNS[name], "--out", str(out)]) == 0
    check_page(out / "report.html")
    _check_links(browser, out / "report.html")


def test_the_page_of_a_comparison(folder, browser, check_page):
    out = folder / "compare"
    words = ["compare", *COMPARED, "--set", "hearing=ideal", "--out", str(out)]
    assert phonotaxis.main(words) == 0
    check_page(out / "report.html")
    _check_links(browser, out / "report.html")
    _check_fades(browser, out / "report.html")


def _check_fades(browser: Any, path: Path) -> None:
    """On a phone, exactly the boxes that scroll fade out, where there is more."""
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto(path.as_uri())
    boxes = page.evaluate("""[...document.querySelectorAll(".wide, .drawing")].map(
        (box) => [box.scrollWidth > box.clientWidth, ...["left", "right"].map((side) =>
            parseFloat(getComputedStyle(box).getPropertyValue(`--more-${side}`)))])""")
    assert {tuple(box) for box in boxes} == {(True, 0, 48), (False, 0, 0)}
    page.close()


def _check_links(browser: Any, path: Path) -> None:
    """Every link leads to a part of the page or to a file; every picture is there."""
    page = browser.new_page()
    page.goto(path.as_uri())
    links = page.evaluate("[...document.links].map((a) => a.getAttribute('href'))")
    assert links
    for link in links:
        file, _, anchor = link.partition("#")
        if file:
            assert (path.parent / file).is_file(), link
        else:
            assert page.locator(f"[id='{anchor}']").count() == 1, link
    shown = page.evaluate("[...document.images].map((i) => [i.src, i.naturalWidth])")
    assert shown
    assert all(width > 0 for _, width in shown), shown
    page.close()
