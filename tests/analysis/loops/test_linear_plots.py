"""Pictures of linear stability: drawn from data objects, with what they say."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from analysis.loops import linear_plots
from analysis.loops.contact_mode import contact_limits
from analysis.loops.delayed_run import check_delay_margin
from analysis.loops.equilibria import find_equilibria
from analysis.loops.gang_of_four import gang_of_four
from analysis.loops.loop_margins import all_margins
from analysis.loops.step_response import check_step
from diagrams.scenario.scenario import Scenario
from tests.operating_points import follow_point


@pytest.fixture(scope="module")
def scenario():
    return Scenario(law="active")


@pytest.fixture(scope="module")
def point(scenario):
    return follow_point(scenario)


@pytest.fixture(scope="module")
def loops(point):
    return [found.margins for found in all_margins(point)]


def drawn(figure: Figure) -> Figure:
    figure.canvas.draw()
    return figure


def test_bode_nyquist_and_nichols_show_every_loop(loops):
    names = [loop.name for loop in loops]
    bode = drawn(linear_plots.plot_bode(loops))
    assert bode.axes[0].get_legend_handles_labels()[1] == names
    nyquist = drawn(linear_plots.plot_nyquist(loops))
    assert [axes.get_title() for axes in nyquist.axes[: len(names)]] == names
    nichols = drawn(linear_plots.plot_nichols(loops))
    assert nichols.axes[0].get_legend_handles_labels()[1] == names


def test_nyquist_curves_stay_out_of_the_disk(loops):
    """The disk's ends on the real axis are the disk gain margins."""
    for loop in loops:
        low, high = linear_plots._disk_ends(loop.disk.alpha)
        center, radius = (low + high) / 2, (high - low) / 2
        assert np.abs(loop.response.L - center).min() >= radius * (1 - 1e-6)
        if loop.disk.alpha < 2.0:
            margin = 10 ** (loop.disk.gain_margin_db / 20)
            assert min(-low, -1 / high) == pytest.approx(margin, rel=1e-6)


def test_gang_of_four_has_four_panels(point):
    assert len(drawn(linear_plots.plot_gang_of_four(gang_of_four(point))).axes) == 4


def test_contact_limits_mark_the_scenario(scenario):
    limits = contact_limits(scenario)
    for axes in drawn(linear_plots.plot_contact_limits(limits)).axes:
        (text,) = axes.texts
        assert isinstance(text, Annotation)
        assert text.get_text() == "current"
        assert text.xy[0] == limits.today[0]


def test_delay_check_shows_both_runs(point):
    check = check_delay_margin(point, "wheels", duration_s=20.0)
    figure = drawn(linear_plots.plot_delay_check(check))
    assert [axes.get_title()[:4] for axes in figure.axes] == ["0.95", "1.05"]


def test_equilibria_are_all_in_the_picture(scenario):
    search = find_equilibria(scenario)
    axes = drawn(linear_plots.plot_equilibria(search)).axes[0]
    places = {tuple(np.asarray(line.get_xydata())[0]) for line in axes.lines}
    for found in search.points:
        assert tuple(found.p_WP) in places


def test_step_shows_the_ideal_run_and_the_prediction(scenario):
    figure = drawn(linear_plots.plot_step(check_step(scenario)))
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert labels == ["exact sensors", "linear model"]
