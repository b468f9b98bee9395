"""The pictures of the nonlinear analyses show what their objects hold."""

from __future__ import annotations

import re

import numpy as np
import pytest

from studies.nonlinear.contact_oscillation import contact_oscillation
from studies.nonlinear.equilibrium_maps import gap_map
from studies.nonlinear.phase_portrait import phase_portrait
from studies.nonlinear.plots import (
    plot_contact_oscillation,
    plot_equilibrium_maps,
    plot_phase_portrait,
    plot_ratio_map,
    plot_velocity_terms,
)
from studies.nonlinear.stiffness_ratio import stiffness_ratio_map
from studies.nonlinear.velocity_terms import velocity_term_analysis


def curves(axes):
    """Data of the labeled lines, by label."""
    return {
        line.get_label(): line.get_xydata()
        for line in axes.get_lines()
        if not str(line.get_label()).startswith("_")
    }


def test_velocity_terms(two_boxes):
    analysis = velocity_term_analysis(two_boxes("conventional"))
    plane, bias, damping = plot_velocity_terms(analysis).axes
    describing = analysis.variants["closing"].describing
    np.testing.assert_allclose(curves(bias)["closing"][:, 1], describing.bias_n)
    np.testing.assert_allclose(
        curves(damping)["closing"][:, 1], describing.damping_n_s_m
    )
    assert len(curves(plane)) == 4


def test_contact_oscillation(two_boxes):
    found = contact_oscillation(two_boxes("conventional"), duration_s=6.0)
    _, growth, center = plot_contact_oscillation(found).axes
    predicted = found.predictions["printed"]
    np.testing.assert_allclose(curves(center)["printed"][:, 1], predicted.centers_m)
    np.testing.assert_allclose(curves(growth)["printed"][:, 1], predicted.growth_per_s)


def test_phase_portrait(two_boxes):
    portrait = phase_portrait(two_boxes("active"), points=11)
    axes = plot_phase_portrait(portrait).axes[0]
    filled = [
        line
        for line in axes.get_lines()
        if line.get_marker() == "o" and line.get_color() == "#4D4D4D"
    ]
    places = sorted(float(np.asarray(line.get_xdata())[0]) for line in filled)
    assert places == pytest.approx(sorted(portrait.contact.equilibria_m))


def test_maps(two_boxes):
    scenario = two_boxes("active")
    found = gap_map(scenario, (0.5, 2.0))
    axes = plot_equilibrium_maps([found]).axes[0]
    assert sum(len(data) for data in curves(axes).values()) == len(found.points)
    ratios = stiffness_ratio_map(scenario, (2.0, 4.0, 8.0))
    drawn = curves(plot_ratio_map(ratios).axes[0])
    assert any(np.allclose(data[:, 1], ratios.outer_m) for data in drawn.values())


def test_axes_state_units(two_boxes):
    scenario = two_boxes("active")
    for figure in (
        plot_phase_portrait(phase_portrait(scenario, points=5)),
        plot_velocity_terms(velocity_term_analysis(scenario)),
        plot_ratio_map(stiffness_ratio_map(scenario, (2.0, 4.0))),
    ):
        for axes in figure.axes:
            if axes.get_xlabel() and "ref" not in axes.get_xlabel():
                assert re.search(r"\((m|s|m/s|1/s)\)", axes.get_xlabel())
