"""Pictures of a comparison show its numbers."""

from __future__ import annotations

from typing import Any

import pytest

from analysis.comparison.cells import (
    EXAMPLES,
    ExampleRun,
    LawCell,
    Mean,
    Median,
)
from analysis.comparison.laws_in_pairs import Comparison
from analysis.comparison.plots import plot_examples, plot_rates


def cell(law: str, success: float) -> LawCell:
    return LawCell(
        scenario="here",
        law=law,
        fields={"hearing": "ideal"},
        runs=50,
        causes={"completed": 50},
        mechanisms={},
        success=Mean(success, success - 0.1, success + 0.1),
        collision=Mean(0.2, 0.1, 0.4),
        spl=None,
        metrics={"jerk_rms_m_s3": Median(1.5, 1.0, 2.5, 40)},
        examples=tuple(ExampleRun(kind, 0, "completed") for kind in EXAMPLES),
    )


def test_rates_are_drawn_with_their_intervals():
    figure = plot_rates([Comparison([cell("none", 0.3), cell("active", 0.6)], [])])
    axes: list[Any] = figure.axes
    success, collision, jerk = axes
    assert [bar.get_width() for bar in success.patches] == pytest.approx([30.0, 60.0])
    labels = [label.get_text() for label in success.get_yticklabels()]
    assert labels == ["none, ideal", "active, ideal"]
    ends = collision.collections[0].get_segments()[0][:, 0]
    assert ends == pytest.approx([10.0, 40.0])
    assert jerk.lines[0].get_xdata() == pytest.approx([1.0, 2.5])
    assert jerk.lines[1].get_xdata() == pytest.approx([1.5])


def test_examples_are_a_row_a_law(crossing_run, collision_run):
    rows = [
        (cell("none", 0.5), [collision_run, crossing_run, crossing_run]),
        (cell("active", 0.5), [crossing_run, crossing_run]),
    ]
    figure = plot_examples(rows)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[0].startswith("none, ideal, worst: collision with box")
    assert titles[4].startswith("active, ideal, typical: completed")
    assert titles[5] == ""
    x_low, x_high = figure.axes[0].get_xlim()
    assert x_low < min(crossing_run.columns["p_WB_x"]) - 0.4
    assert x_high > max(crossing_run.columns["p_WS_x"]) + 0.3
