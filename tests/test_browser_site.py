"""The site that ``make docs`` has built, in a browser without network."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.browser

SITE = Path(__file__).resolve().parents[1] / "build" / "site" / "docs"
#: One of each kind: prose, tables and formulas, pictures, docstrings.
PAGES = (
    "index.html",
    "model.html",
    "your_law.html",
    "gallery.html",
    "reference/diagrams.html",
)
WIDTHS = (390, 1100, 1400)
THEMES = ("light", "dark")

#: Looks at every frame when all are loaded, and complains on the console.
SCRIPT = """
const luminance = ([r, g, b]) => [r, g, b]
  .map(v => v / 255)
  .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
  .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
const parts = color => color.match(/[\\d.]+/g).map(Number);
function behind(view, element) {
  for (; element; element = element.parentElement) {
    const color = parts(view.getComputedStyle(element).backgroundColor);
    if (color.length === 3 || color[3] > 0.5) return color;
  }
  return [255, 255, 255];
}
function faint(view) {
  const found = [], texts = view.document.createTreeWalker(view.document.body, 4);
  while (texts.nextNode()) {
    const element = texts.currentNode.parentElement;
    if (!texts.currentNode.data.trim() || !element.checkVisibility()) continue;
    const ink = luminance(parts(view.getComputedStyle(element).color));
    const paper = luminance(behind(view, element));
    const [less, more] = [ink, paper].sort((a, b) => a - b);
    const ratio = (more + 0.05) / (less + 0.05);
    if (ratio < 4.5) found.push(`${ratio.toFixed(2)} ${texts.currentNode.data}`);
  }
  return found;
}
addEventListener("load", () => {
  for (const frame of document.querySelectorAll("iframe")) {
    const view = frame.contentWindow, page = view.document, {theme} = frame.dataset;
    const say = what => console.error(`${frame.src} ${frame.width} ${theme}: ${what}`);
    page.body.dataset.theme = theme;
    const wide = page.documentElement.scrollWidth;
    if (wide > frame.width) say(`${wide} px wide`);
    for (const text of faint(view)) say(`contrast ${text}`);
    for (const {name} of view.performance.getEntriesByType("resource"))
      if (!name.startsWith("file:")) say(`needs ${name}`);
  }
  console.log(`looked at ${document.querySelectorAll("iframe").length}`);
});
"""


def test_pages_fit_are_legible_and_need_no_network(
    chromium: Callable[..., str], tmp_path: Path
) -> None:
    assert (SITE / "index.html").exists(), "there is no site; run make docs first"
    cases = list(product(PAGES, WIDTHS, THEMES))
    frames = "".join(
        f'<iframe src="{(SITE / page).as_uri()}" width="{width}" height="800" '
        f'data-theme="{theme}"></iframe>'
        for page, width, theme in cases
    )
    harness = tmp_path / "harness.html"
    harness.write_text(f"<script>{SCRIPT}</script>{frames}")
    log = chromium(
        harness, "--allow-file-access-from-files", f"--screenshot={tmp_path / 's.png'}"
    )
    said = [line for line in log.splitlines() if "CONSOLE" in line]
    assert len(said) == 1, "\n".join(said[:40])
    assert f"looked at {len(cases)}" in said[0]


def _opened(browser: Any, name: str) -> Any:
    assert (SITE / name).exists(), f"there is no {name}; run make docs first"
    page = browser.new_context(offline=True).new_page()
    page.goto((SITE / name).as_uri())
    return page


@pytest.mark.parametrize(
    ("package", "names"),
    [
        ("phonotaxis", ["Scenario", "simulate", "locate"]),
        ("systems", ["TDOAEstimator", "MicArray", "DiffDrivePlant"]),
        ("diagrams", ["build_sound_follower", "make_simulator"]),
    ],
)
def test_public_names_have_their_docstring(
    browser: Any, package: str, names: list[str]
) -> None:
    page = _opened(browser, f"reference/{package}.html")
    told = page.evaluate(
        """(ids) => ids.map((id) => document.getElementById(id)
        ?.parentElement.querySelector("dd")?.textContent.trim() ?? "")""",
        [f"{package}.{name}" for name in names],
    )
    assert min(map(len, told)) > 20
    page.context.close()


#: Prose with tables and formulas, a reference, and the search: one of each
#: kind, for a page of hundreds of links takes a minute.
REACHED = (
    "index.html",
    "results_stability.html",
    "first_run.html",
    "reference/diagrams.html",
    "../search.html",
)


@pytest.mark.parametrize("name", REACHED)
def test_the_keyboard_reaches_every_control_of_a_page(
    check_page: Callable[..., None], name: str
) -> None:
    check_page(SITE / name)


#: Where menu and contents are drawers, one of them, and none.
@pytest.mark.parametrize("width", [390, 1100, 1400])
def test_a_page_is_used_by_the_keyboard_alone(browser: Any, width: int) -> None:
    """Over the menu, from drawers or in sight; into the text; by headings' links."""
    context = browser.new_context(
        viewport={"width": width, "height": 844}, reduced_motion="reduce", offline=True
    )
    page = context.new_page()
    page.goto((SITE / "model.html").as_uri())

    def reach(wanted: str, most: int = 30) -> None:
        for _ in range(most):
            page.keyboard.press("Tab")
            if page.evaluate("(w) => document.activeElement.matches(w)", wanted):
                return
        pytest.fail(f"{width} px: Tab does not reach {wanted}")

    if width == 390:
        reach("#__navigation", 1)
        assert page.evaluate("getComputedStyle(document.activeElement).opacity") == "1"
        page.keyboard.press("Space")
    reach(".sidebar-search")
    assert page.locator(".sidebar-search").is_visible()
    box = page.locator(".sidebar-search").bounding_box()
    assert 0.0 <= box["x"] < width
    page.goto((SITE / "model.html").as_uri())
    reach(".skip-to-content", 3)
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    inside = "document.querySelector('article').contains(document.activeElement)"
    assert page.evaluate(inside)
    page.goto((SITE / "model.html").as_uri())
    if width < 1300:
        reach("#__toc", 2)
        page.keyboard.press("Space")
        reach(".toc-drawer a", 400)
        left, right = page.evaluate(
            """(({left, right}) => [left, right])(
            document.activeElement.getBoundingClientRect())"""
        )
        assert 0.0 <= left < right <= width
    hidden = page.evaluate(
        """[...document.querySelectorAll(".headerlink")].filter(
        (link) => getComputedStyle(link).visibility !== "visible").length"""
    )
    assert not hidden
    context.close()


def test_the_search_finds_by_the_keyboard_alone(browser: Any) -> None:
    page = _opened(browser, "index.html")
    page.locator(".sidebar-search").focus()
    page.keyboard.type("guard")
    page.keyboard.press("Enter")
    page.wait_for_selector("ul.search li a")
    for _ in range(60):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.matches('ul.search a')"):
            break
    else:
        pytest.fail("Tab does not reach what was found")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") in {
        "auto",
        "solid",
    }
    page.context.close()
