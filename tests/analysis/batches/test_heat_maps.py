"""Heat maps can be read: a bar, the same colors on every map, numbers in sight."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb

from analysis.batches.plan import SweepPlan
from analysis.batches.plots import plot_heat_maps
from analysis.report.palette import luminance

SPEEDS, HEADINGS, LAWS = [0.1, 0.2, 0.3], [0.0, 90.0], ["none", "active"]
GRID = {"source.speed_m_s": SPEEDS, "source.heading_deg": HEADINGS, "law": LAWS}


def _plan(**grid) -> SweepPlan:
    return SweepPlan.model_validate(
        {"name": "s", "scenario": "default", "grid": grid or GRID, "runs": 1, "seed": 1}
    )


def _results(plan: SweepPlan) -> pd.DataFrame:
    """Clearance 0, 1, 2, ... from cell to cell; the last cell has no run."""
    rows = [
        {
            "cell": k,
            "cause": "reached" if k % 2 else "collision",
            "minimum_clearance_m": float(k),
            "following_error_rms_m": 0.5,
        }
        for k in range(len(plan.cells()) - 1)
    ]
    return pd.DataFrame(rows)


@pytest.fixture(scope="module")
def figures():
    plan = _plan()
    results = _results(plan)
    axes = "source.speed_m_s", "source.heading_deg"
    return [plot_heat_maps(plan, results, *axes, {"law": law}) for law in LAWS]


def _maps(figure):
    return [axes for axes in figure.axes if axes.get_images()]


def test_every_map_has_a_bar(figures):
    for figure in figures:
        assert len(_maps(figure)) == 4
        for axes in _maps(figure):
            assert axes.get_images()[0].colorbar is not None


def test_a_color_means_the_same_on_every_map(figures):
    for first, second in zip(*map(_maps, figures), strict=True):
        limits = [axes.get_images()[0].get_clim() for axes in (first, second)]
        assert limits[0] == limits[1]
    rates, clearance = _maps(figures[0])[:2], _maps(figures[0])[2]
    assert [axes.get_images()[0].get_clim() for axes in rates] == [(0.0, 1.0)] * 2
    assert clearance.get_images()[0].get_clim() == (0.0, 10.0)


def test_lighter_is_more(figures):
    image = _maps(figures[0])[2].get_images()[0]
    lights = [luminance(image.to_rgba(value)) for value in np.linspace(0.0, 10.0, 50)]
    assert all(low < high for low, high in itertools.pairwise(lights))


def test_numbers_stand_out_and_what_nobody_knows_is_a_dash(figures):
    texts = [text for axes in _maps(figures[1]) for text in axes.texts]
    assert "-" in {text.get_text() for text in texts}
    for axes in _maps(figures[0]):
        image = axes.get_images()[0]
        for text in axes.texts:
            column, row = text.get_position()
            value = image.get_array()[int(row), int(column)]
            if np.ma.is_masked(value):
                continue
            cell = luminance(image.to_rgba(value))
            letters = luminance(text.get_color())
            light, dark = max(cell, letters), min(cell, letters)
            assert (light + 0.05) / (dark + 0.05) >= 4.5


def test_a_large_map_has_a_bar_in_place_of_numbers():
    grid = {"source.speed_m_s": [0.01 * k for k in range(1, 31)], "law": LAWS}
    plan = _plan(**grid)
    figure = plot_heat_maps(plan, _results(plan), "source.speed_m_s", "law", {})
    for axes in _maps(figure):
        assert len(axes.texts) == 0
        assert len(axes.get_xticks()) <= 20


@pytest.mark.parametrize(
    ("color", "light"),
    [("black", 0.0), ("white", 1.0), ("#FF0000", 0.2126), ("#777777", 0.1845)],
)
def test_luminance_is_that_of_the_standard(color, light):
    """#777777 against white is 4.48 to 1, as W3C's examples say."""
    assert luminance(to_rgb(color)) == pytest.approx(light, abs=2e-4)
    assert 1.05 / (luminance("#777777") + 0.05) == pytest.approx(4.48, abs=0.01)
