"""What pictures say stands out from what is behind it, by day and by night.

WCAG 2.2: 4.5 to 1 for words (1.4.3), 3 to 1 for lines and marks that tell something
(1.4.11). Ratios are worked out here, from the standard's formula; by night pages turn
drawings over by a filter of CSS, whose matrix is that of the Filter Effects Module.
``tests/test_browser_contrast.py`` holds both against a browser.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Wedge
from matplotlib.text import Text
from numpy.typing import NDArray

from analysis.report import palette
from analysis.report.render import COLORS_CSS
from analysis.views.picture import plot_trajectory
from analysis.views.time_series import plot_time_series

ROOT = Path(__file__).resolve().parents[3]
SCHEMES = ("light", "dark")
#: Laid below what is drawn, or a grid: nothing is told by them alone.
GROUNDS = {
    "#F0E442": "sound, which has a line along its foot; marks have black edges",
    "#E5E5E5": "grid",
    "#EEEEEE": "grid",
    "#D0D0D0": "the unit circle, a grid",
    "#BBBBBB": "contours of a Nichols chart, a grid",
    "#B0B0B0": "hatching of empty cells",
    "#DCEBF7": "area, whose edge is drawn",
    "#F3E6EF": "odor, whose edge is drawn",
    "#E7CCDF": "odor",
    "#D9AECB": "odor",
    "#C98BB5": "odor",
    "#E8EEF4": "boxes of the diagram, which have edges",
    "#FBE3D6": "boxes",
    "#FCEFC9": "boxes",
    "#DDF1E7": "boxes",
    "#DCEAF7": "boxes",
}


def luminance(rgb: NDArray[np.float64]) -> float:
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def by_night(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """invert(.91) hue-rotate(180deg)."""
    turned = np.clip(0.91 + rgb * (1.0 - 2.0 * 0.91), 0.0, 1.0)
    # cos 180 deg = -1, sin 180 deg = 0.
    weights = np.array([0.213, 0.715, 0.072])
    matrix = 2.0 * np.tile(weights, (3, 1)) - np.eye(3)
    return np.clip(matrix @ turned, 0.0, 1.0)


def contrast(color: Any, scheme: str = "light", behind: Any = "white") -> float:
    red, green, blue, alpha = to_rgba(color)
    paper = np.array(to_rgba(behind)[:3])
    ink = alpha * np.array([red, green, blue]) + (1.0 - alpha) * paper
    if scheme == "dark":
        ink, paper = by_night(ink), by_night(paper)
    less, more = sorted((luminance(ink), luminance(paper)))
    return (more + 0.05) / (less + 0.05)


def test_ratios_are_those_of_the_standard() -> None:
    """Black on white is 21; #767676 is the lightest gray that does for words."""
    assert contrast("black") == pytest.approx(21.0)
    assert contrast("#767676") >= 4.5 > contrast("#777777")
    assert palette.contrast("#767676", "white") == pytest.approx(contrast("#767676"))


def test_pages_turn_drawings_over_by_that_filter() -> None:
    assert "--drawing: invert(.91) hue-rotate(180deg)" in COLORS_CSS


@pytest.mark.parametrize("scheme", SCHEMES)
def test_lines_of_every_kind_stand_out(scheme: str) -> None:
    lines = [color for name, color in palette.COLORS.items() if name != "sound"]
    lines += [*palette.ROBOT_COLORS, *palette.SERIES_COLORS]
    assert not [c for c in lines if contrast(c, scheme) < 3.0]


#: Linear RGB as who lacks one kind of cones sees it (Machado, Oliveira and Fernandes
#: 2009, severity 1).
NO_GREEN = [
    [0.367322, 0.860646, -0.227968],
    [0.280085, 0.672501, 0.047413],
    [-0.011820, 0.042940, 0.968881],
]
NO_RED = [
    [0.152286, 1.052583, -0.204868],
    [0.114503, 0.786281, 0.099216],
    [-0.003882, -0.048116, 1.051998],
]


def seen(color: str, cones: Any) -> NDArray[np.float64]:
    """CIE L*a*b* of a color, under the light that white has."""
    rgb = np.array(to_rgba(color)[:3])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    xyz = to_xyz @ np.clip(np.array(cones) @ linear, 0.0, 1.0) / to_xyz.sum(axis=1)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


@pytest.mark.parametrize("cones", [np.eye(3), NO_GREEN, NO_RED])
def test_what_stands_side_by_side_is_told_apart_by_any_eyes(cones: Any) -> None:
    """A difference of 2.3 is just noticed; Okabe and Ito's own with a gray has 7.1."""
    names = [
        ("source", "echo"),
        ("left", "right"),
        ("robot", "left"),
        ("echo", "empty"),
    ]
    names += [("passed", "lessened"), ("lessened", "hit"), ("robot", "estimate")]
    names += [("source", "estimate"), ("attraction", "repulsion")]
    pairs = [(palette.COLORS[a], palette.COLORS[b]) for a, b in names]
    pairs += combinations(palette.SERIES_COLORS, 2)
    alike = [
        pair
        for pair in pairs
        if np.linalg.norm(seen(pair[0], cones) - seen(pair[1], cones)) < 9.0
    ]
    assert not alike


@pytest.mark.parametrize("scheme", SCHEMES)
def test_words_in_those_colors_do_too(scheme: str) -> None:
    for color in {*palette.COLORS.values(), *palette.ROBOT_COLORS}:
        assert contrast(palette.text_color(color), scheme) >= 4.5
    assert palette.text_color("#0072B2") == "#0072b2"


def literals() -> Iterator[tuple[str, str]]:
    """Colors that product code names, with their files."""
    for path in sorted((ROOT / "analysis").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                for color in re.findall(r"#[0-9A-Fa-f]{6}\b", node.value):
                    yield color.upper(), path.name


def test_colors_named_elsewhere_stand_out_or_lie_below() -> None:
    found = [*literals()]
    assert len(found) > 40
    faint = {
        each
        for each in found
        if each[0] not in GROUNDS and min(contrast(each[0], s) for s in SCHEMES) < 3.0
    }
    assert not faint
    assert {color for color, _ in found} >= GROUNDS.keys()


def _texts(figure: Figure) -> Iterator[Text]:
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if text.get_visible() and text.get_text().strip():
            yield text


def faint(figure: Figure, scheme: str) -> list[tuple[str, float]]:
    """Words, lines and edges of a figure that do not stand out from white."""
    found = [
        (text.get_text(), contrast(text.get_color(), scheme) / 4.5)
        for text in _texts(figure)
    ]
    for axes in figure.axes:
        grid = {*axes.get_xgridlines(), *axes.get_ygridlines()}
        found += [
            (str(line.get_label()), contrast(line.get_color(), scheme) / 3.0)
            for line in {*axes.get_lines()} - grid
        ]
        found += [*_edges(axes, scheme)]
    return [(what, share) for what, share in found if share < 1.0]


def _edges(axes: Axes, scheme: str) -> Iterator[tuple[str, float]]:
    for patch in axes.patches:
        if patch.get_fill() and patch.get_alpha() is not None:
            continue  # a shade
        kind = "cone" if isinstance(patch, Wedge) else str(patch.get_gid())
        edge = contrast(patch.get_edgecolor(), scheme)
        # A filled body stands out by either.
        inner = contrast(patch.get_facecolor(), scheme) if patch.get_fill() else 1.0
        yield kind, max(edge, inner) / 3.0
    for marks in axes.collections:
        colors = np.asarray(marks.get_edgecolor())
        if len(colors) and np.size(np.asarray(marks.get_offsets())):
            yield str(marks.get_label()), contrast(colors[-1], scheme) / 3.0


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("run", ["crossing_run", "collision_run", "guarded_run"])
def test_pictures_of_runs(
    run: str, scheme: str, request: pytest.FixtureRequest
) -> None:
    result = request.getfixturevalue(run)
    assert not faint(plot_trajectory(result), scheme)
    assert not faint(plot_time_series(result, np.ones(len(result.time))), scheme)


def test_something_faint_would_be_seen() -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.plot([0.0, 1.0], color="#E69F00", label="pale")
    axes.text(0.5, 0.5, "words", color="#D55E00")
    assert {what for what, _ in faint(figure, "light")} == {"pale", "words"}


def test_the_faintest_estimate_can_be_seen(crossing_run) -> None:
    crosses = plot_trajectory(crossing_run).axes[0].collections[0]
    assert min(contrast(c) for c in np.asarray(crosses.get_edgecolor())) >= 3.0


@pytest.mark.parametrize("scheme", SCHEMES)
def test_words_and_rules_of_pages(scheme: str) -> None:
    """Pairs of the pages' own colors, by day and by night."""
    day, _, night = COLORS_CSS.partition("@media")
    told = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6})", day))
    if scheme == "dark":
        told |= dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6})", night))
    words = [(ink, paper) for ink in ("ink", "soft", "link") for paper in ("paper",)]
    words += [("ink", "shade"), ("soft", "shade"), ("ink", "field")]
    words += [(f"{kind}-ink", kind) for kind in ("pass", "fail", "none")]
    for ink, paper in words:
        assert contrast(told[ink], behind=told[paper]) >= 4.5, (ink, paper)
    for edge, paper in (("edge", "paper"), ("accent", "paper"), ("edge", "field")):
        assert contrast(told[edge], behind=told[paper]) >= 3.0, (edge, paper)
