"""What a browser shows of drawings and of the replay's scene stands out, measured.

The ratios are WCAG 2.2's, from pixels: what is drawn, against what is there without it.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread
from numpy.typing import NDArray

from analysis.report.palette import COLORS, ROBOT_COLORS
from analysis.report.render import COLORS_CSS
from analysis.views.replay import write_replay
from diagrams import load_scenario, simulate

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SCHEMES = ("light", "dark")


def luminance(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return np.asarray(linear @ [0.2126, 0.7152, 0.0722])


def contrast(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    first, second = luminance(a), luminance(b)
    more, less = np.maximum(first, second), np.minimum(first, second)
    return np.asarray((more + 0.05) / (less + 0.05))


def pixels(shot: bytes) -> NDArray[np.float64]:
    return np.asarray(imread(io.BytesIO(shot)), dtype=float)[:, :, :3]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_lines_of_drawings_on_their_page(
    browser: Any, tmp_path: Path, scheme: str
) -> None:
    """Each color as an SVG line on white, turned over at night as pages do it."""
    lines = [color for name, color in COLORS.items() if name != "sound"]
    lines += ROBOT_COLORS
    drawn = "".join(
        f'<rect x="{20 * k}" y="0" width="20" height="20" fill="{color}"/>'
        for k, color in enumerate(lines)
    )
    wide = 20 * len(lines)
    path = tmp_path / "swatches.html"
    path.write_text(
        f"<!DOCTYPE html><style>{COLORS_CSS} body {{ margin: 0 }} "
        "svg { filter: var(--drawing); display: block }</style>"
        f'<svg width="{wide}" height="40"><rect width="{wide}" height="40" '
        f'fill="white"/>{drawn}</svg>'
    )
    context = browser.new_context(
        color_scheme=scheme, viewport={"width": wide, "height": 40}
    )
    page = context.new_page()
    page.goto(path.as_uri())
    shown = pixels(page.screenshot())
    context.close()
    inks, paper = shown[10, 10::20], shown[30, 10]
    if scheme == "light":
        np.testing.assert_allclose(inks, [to_rgb(line) for line in lines], atol=0.01)
    else:
        # Whites are dark at night, and blues stay blue.
        assert paper.max() < 0.12
        assert np.argmax(inks[0]) == 2
    assert contrast(inks, paper).min() >= 3.0


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("contrast") / "replay.html"
    overrides = ["hearing=ideal", "guard={}", "duration_s=6"]
    write_replay(simulate(load_scenario("default", overrides)), path)
    return path


@pytest.mark.parametrize("scheme", SCHEMES)
def test_bodies_marks_and_numbers_of_the_scene(
    browser: Any, replay: Path, scheme: str
) -> None:
    context = browser.new_context(
        viewport={"width": 1100, "height": 844},
        color_scheme=scheme,
        reduced_motion="reduce",
        offline=True,
    )
    page = context.new_page()
    page.goto(f"{replay.as_uri()}#t=5.8")
    page.wait_for_selector("body[data-ready=yes]")
    page.get_by_label("names").uncheck()

    def show(path: str, *, on: bool) -> None:
        page.evaluate(
            """([path, on]) => { viewer.set_dirty();
            replay.shown(path).traverse((part) => part.layers.set(on ? 0 : 1)); }""",
            [path, on],
        )

    def scene() -> NDArray[np.float64]:
        page.evaluate(
            "new Promise((f) => requestAnimationFrame(() => setTimeout(f, 80)))"
        )
        return pixels(page.locator("#meshcat-pane").screenshot())

    # One thing at a time on the bare floor, so that nothing hides another.
    things = (
        *("robot/body", "source", "obstacles", "trail/robot", "trail/source"),
        *("law", "forces", "follow", "estimate"),
    )
    all_of_them = (*things, "robot", "known", "guard")
    for path in all_of_them:
        show(path, on=False)
    bare, faint = scene(), {}
    for path in things:
        show(path, on=True)
        shown = scene()
        show(path, on=False)
        changed = np.abs(shown - bare).max(axis=2) > 0.05
        assert changed.sum() > 30, path
        ratios = contrast(shown[changed], bare[changed])
        # The edge of a thin thing is a mixture: its middle counts.
        strong = float(np.percentile(ratios, 90.0))
        if strong < 3.0:
            faint[path] = strong
    # The edge that the guard keeps free, on the floor that is known.
    show("known", on=True)
    known = scene()
    show("guard", on=True)
    shown = scene()
    changed = np.abs(shown - known).max(axis=2) > 0.05
    strong = float(np.percentile(contrast(shown[changed], known[changed]), 90.0))
    if strong < 3.0:
        faint["guard"] = strong
    for path in ("known", "guard"):
        show(path, on=False)
    # Numbers are words: their outlines are a pixel wide, whose darkest count.
    show("floor/x 1", on=False)
    without = scene()
    show("floor/x 1", on=True)
    changed = np.abs(bare - without).max(axis=2) > 0.05
    strong = float(np.percentile(contrast(bare[changed], without[changed]), 95.0))
    if strong < 4.5:
        faint["floor/x 1"] = strong
    context.close()
    assert not faint
