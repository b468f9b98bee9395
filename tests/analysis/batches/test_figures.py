"""Pictures of one quantity over a field: values, intervals, words and files."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from analysis.batches.field_words import field_label
from analysis.batches.plan import SweepPlan
from analysis.batches.plots import numbers_of, plot_over
from systems.framework.input_error import InputError

SPEED = "obstacles.0.speed_m_s"
PLAN = SweepPlan.model_validate(
    {
        "grid": {"law": ["none", "active"], "source.speed_m_s": [0.2, 0.4]},
        "draw": {SPEED: {"uniform": [0.1, 0.5]}},
        "runs": 20,
    }
)


def rows() -> pd.DataFrame:
    """80 runs; the law none collides with faster obstacles, the active law never."""
    points = PLAN.points()
    frame = pd.DataFrame(
        {
            "index": [point.index for point in points],
            "cell": [point.cell for point in points],
            SPEED: [point.fields[SPEED] for point in points],
        }
    )
    none = [PLAN.cells()[cell]["law"] == "none" for cell in frame["cell"]]
    hits = np.array(none) & (frame[SPEED] > 0.3)
    frame["cause"] = np.where(hits, "collision", "completed")
    return frame


def test_rates_over_a_drawn_number_have_four_bins_and_wilson_intervals():
    table = rows()
    figure = plot_over(PLAN, table, "collision", SPEED, "law")
    (axes,) = figure.axes
    assert axes.get_xlabel() == "speed of box (m/s)"
    assert axes.get_ylabel() == "collision (%)"
    curves: list[Any] = list(axes.containers)
    assert len(curves) == 2
    for curve, law in zip(curves, ("none", "active"), strict=True):
        x, y = curve.lines[0].get_data()
        cells = [PLAN.cells()[cell]["law"] == law for cell in table["cell"]]
        own = table[cells].sort_values(SPEED)
        assert len(x) == 4
        left, right = axes.get_xlim()
        assert left < x.min() < x.max() < right < left + 0.5
        for k, part in enumerate(np.array_split(np.arange(len(own)), 4)):
            group = own.iloc[part]
            hits = int((group["cause"] == "collision").sum())
            assert x[k] == pytest.approx(group[SPEED].median())
            assert y[k] == pytest.approx(hits / len(group))
            known = binomtest(hits, len(group)).proportion_ci(method="wilson")
            low, high = curve.lines[2][0].get_segments()[k][:, 1]
            assert low == pytest.approx(known.low, abs=1e-9)
            assert high == pytest.approx(known.high, abs=1e-9)


@pytest.mark.parametrize(
    ("over", "by", "joined", "points"),
    [("law", "", False, 2), ("source.speed_m_s", "law", True, 2)],
)
def test_no_line_joins_categories(over, by, joined, points):
    figure = plot_over(PLAN, rows(), "success", over, by)
    curves: list[Any] = list(figure.axes[0].containers)
    for curve in curves:
        assert len(curve.lines[0].get_xdata()) == points
        assert (curve.lines[0].get_linestyle() != "None") is joined


def test_what_varies_as_a_number():
    assert numbers_of(PLAN) == ["source.speed_m_s", SPEED]


@pytest.mark.parametrize(
    ("quantity", "over", "by", "message"),
    [
        ("colision", SPEED, "", "quantity: 'colision' .*did you mean 'collision'"),
        ("collision", "source.speed", "", "over: .*did you mean 'source.speed_m_s'"),
        ("collision", SPEED, "laws", "by: .*did you mean 'law'"),
    ],
)
def test_a_wrong_name_is_refused(quantity, over, by, message):
    with pytest.raises(InputError, match=message):
        plot_over(PLAN, rows(), quantity, over, by)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("source.speed_m_s", "speed of source (m/s)"),
        ("obstacles.1.speed_m_s", "speed of obstacle 2 (m/s)"),
        ("obstacles.cart.speed_m_s", "speed of cart (m/s)"),
        ("obstacles.0.waypoints_m.1.0", "x of waypoint 2 of obstacle 1 (m)"),
        ("obstacles.0.size_m.1", "width of obstacle 1 (m)"),
        ("laws.active.reach_m", "reach of law active (m)"),
        ("attraction.damping_n_s_m", "damping of attraction (N s/m)"),
        ("robots.second.robot.mass_kg", "mass of robot of second (kg)"),
        ("own_gains.reach_m", "gain reach_m"),
        ("law", "law"),
        ("no.such.field", "no.such.field"),
    ],
)
def test_fields_in_words(path, words):
    assert field_label(path) == words
