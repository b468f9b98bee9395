"""Charts of sampled loops show the data objects, and mark the scenario's values."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from diagrams.scenario.scenario import Scenario
from studies.linear import charts
from studies.linear.burst_gaps import GapChart
from studies.linear.root_locus import root_loci
from studies.linear.sampled_stability import gain_chart, poles_against_period


@pytest.fixture(scope="module")
def scenario():
    return Scenario(law="active")


def drawn(figure: Figure) -> Figure:
    figure.canvas.draw()
    return figure


def test_charts_mark_todays_design(scenario):
    chart = gain_chart(
        scenario, stiffnesses_n_m=[1.0, 2.0, 30.0], dampings_n_s_m=[0.5, 1.0, 2.0]
    )
    texts = drawn(charts.plot_chart(chart)).axes[0].texts
    assert [text.get_text() for text in texts] == ["current"]
    periods = poles_against_period(scenario, periods_s=[0.01, 0.025, 0.5])
    assert drawn(charts.plot_poles_against_period(periods))


def test_gap_chart_has_a_line_for_each_hold():
    chart = GapChart(
        on_s=0.5,
        gaps_s=np.array([0.0, 1.5, 3.0]),
        holds=("world", "robot"),
        multiplier=np.array([[0.9, 0.8, 0.7], [0.9, 1.02, 1.5]]),
        today=(1.5, "world"),
    )
    figure = drawn(charts.plot_gap_chart(chart))
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert labels == ["hold: world", "hold: robot", "current"]


def test_root_loci_have_a_panel_each(scenario):
    loci = root_loci(scenario)
    figure = drawn(charts.plot_root_loci(loci))
    titles = [axes.get_title() for axes in figure.axes[: len(loci)]]
    assert titles == [f"{locus.parameter}\n({locus.loop})" for locus in loci]
