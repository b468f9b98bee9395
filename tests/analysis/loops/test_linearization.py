"""Models at operating points: two routes, and closed forms."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.loops import linearization
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.linearization import (
    blockwise_model,
    check_gradient,
    compare_routes,
    continuous_model,
    sampled_model,
)
from analysis.loops.operating_points import moving_equilibrium, resting_equilibrium
from diagrams.scenario.scenario import Scenario
from tests.operating_points import follow_point

pytestmark = pytest.mark.drake

LAWS = ["none", "conventional", "active", "conventional2017", "active2017"]


def made(**fields: Any) -> Any:
    return SimpleNamespace(**fields)


@cache
def points(law):
    scenario = Scenario(law=law)
    return [follow_point(scenario), moving_equilibrium(scenario)]


@pytest.mark.parametrize("law", LAWS)
def test_two_routes_agree_at_rest_and_on_the_move(law):
    for point in points(law):
        found = compare_routes(point)
        assert found.matrix_difference < 1e-8
        assert found.pole_difference < 1e-8
        assert len(found.simple_poles) >= 5


def test_signals_of_both_routes_are_the_same():
    (point, _) = points("active")
    whole, joined = sampled_model(point), blockwise_model(point)
    assert whole.input_names == joined.input_names
    assert whole.output_names == joined.output_names
    np.testing.assert_allclose(whole.D, joined.D, atol=1e-8)


def test_P_lies_175_mm_ahead_of_a_robot_that_looks_aside():
    aside = {"law": "none", "source": {"waypoints_m": [[1.5, 1.5]]}}
    point = follow_point(Scenario.model_validate(aside))
    pose = point.loop.indices("plant")[:3]
    across = 0.175 * np.array([-np.sin(point.theta_WB), np.cos(point.theta_WB)])
    expected = [[1.0, 0.0, across[0]], [0.0, 1.0, across[1]], [0.0, 0.0, 1.0]]
    assert abs(across).min() > 0.05
    for model in (sampled_model(point), blockwise_model(point)):
        np.testing.assert_allclose(model.C[:3, pose], expected, atol=1e-9)
    continuous = continuous_model(point).C[:, :3]
    np.testing.assert_allclose(continuous, expected, atol=1e-9)


def test_routes_that_differ_are_told_by_how_much(monkeypatch):
    """All of A 1 % off, which moves the poles by as much, and an element of D."""
    (point, _) = points("active")
    true = blockwise_model(point)
    D = true.D.copy()
    D[2, 1] -= 40.0
    off = replace(true, A=1.01 * true.A, D=D)
    monkeypatch.setattr(linearization, "blockwise_model", lambda _: off)
    found = compare_routes(point)
    assert found.matrix_difference == pytest.approx(40.0)
    moved = [min(abs(1.01 * true.poles - pole)) for pole in found.simple_poles]
    assert found.pole_difference == pytest.approx(max(moved), rel=1e-5)
    assert max(moved) > 1.1 * min(moved)
    assert found.states == len(true.A)


def test_gradient_of_a_made_up_map_with_a_corner():
    """4 |x| in the last element; what is no state to step does not count."""
    names = ("plant.x", "controller.feature_1", "tracker.P_1", "tracker.pose_x")

    def step(x, _):
        return np.array([3 * x[0] + 90 * x[1], 0, 90 * x[2], 2 * x[3] + 4 * abs(x[0])])

    A = np.diag([3.0, 0.0, 0.0, 2.0])
    A[0, 3] = -0.25
    loop = made(
        state_names=names, period_map=step, period_derivatives=lambda *_: made(A=A)
    )
    found = check_gradient(made(loop=loop, state=np.zeros(4), time_s=0.0), step=0.5)
    assert (found.step, found.largest_difference, found.kink) == (0.5, 0.25, 8.0)
    assert found.largest_at == ("plant.x", "tracker.pose_x")
    assert found.kink_at == ("tracker.pose_x", "plant.x")


def test_autodiff_is_the_slope_of_the_float_diagram():
    for point in points("conventional"):
        check = check_gradient(point)
        assert check.largest_difference < 1e-5
        assert check.kink < 1e-3  # no obstacle within reach: no corner


def test_the_corner_of_the_printed_velocity_term_is_found():
    """f goes with |dC|, so the slopes to both sides differ by twice its own."""
    (point, _) = points("active")
    check = check_gradient(point)
    assert check.largest_difference < 1e-4
    assert check.kink > 1.0
    assert check.kink_at[0].startswith("command.")


def test_continuous_target_loop_has_the_closed_forms_poles():
    """M s^2 (1 + lag s) + D_r s (1 + lag s)... along; the sensor's lag apart."""
    (point, _) = points("none")
    poles = continuous_model(point).poles
    # v' = -(K p + D v)/M and p' = w, w' = (v - w)/lag.
    along = np.roots([3.94 * 0.05, 3.94 + 0.05, 1.0, 2.0])
    across = np.roots([3.94 * 0.05, 3.94 + 0.05, 1.0, 0.0])
    for pole in (*along, *across):
        assert np.abs(poles - pole).min() < 1e-9


@pytest.mark.parametrize("law", LAWS)
def test_sampled_poles_approach_the_continuous_ones(law):
    """ln(z)/T is within a tick's worth of the continuous pole."""
    for point in points(law):
        continuous = continuous_model(point).poles
        slow = [mode.eigenvalue for mode in point.modes if abs(mode.eigenvalue) < 1.5]
        for pole in slow:
            assert np.abs(continuous - pole).min() < 0.025 * abs(pole) ** 2 + 0.001


def test_a_linearization_takes_less_than_a_tenth_of_a_second():
    """The build and its twin are there already."""
    (point, _) = points("active")
    loop = ideal_loop(point.loop.scenario)
    spent = []
    for _ in range(5):
        start = time.process_time()
        again = resting_equilibrium(loop, point.p_WP)
        sampled_model(again)
        spent.append(time.process_time() - start)
    assert min(spent) < 0.1
