"""Equilibria against closed forms; the search against what it must find."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from analysis.loops.equilibria import find_equilibria, follow_equilibrium
from analysis.loops.force_field import ForceField
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.ideal_scenarios import frozen_scenario, ideal_scenario
from analysis.loops.operating_points import moving_equilibrium, resting_equilibrium
from diagrams import load_scenario
from diagrams.scenario.scenario import Scenario

K_R, K_0, RHO_0, M, D_R = 2.0, 16.0, 0.8, 3.94, 1.0
REPULSION = {
    "conventional": {"stiffness_n_m": K_0, "reach_m": RHO_0},
    "active": {
        "reference_stiffness_n_m": 64.0,
        "reference_damping_n_s_m": 0.2,
        "matched_stiffness_n_m": 16.0,
        "reach_m": RHO_0,
        "speed_limit_m_s": 0.72,
    },
}
POINT = {"length_m": 1e-3, "width_m": 1e-3}
#: What lies before the source. About a source as small as this P rests nearly anywhere
#: on a circle, more weakly than a search can tell from a true circle of equilibria.
BEFORE = (-1.0, 2.1, -1.0, 1.0)


def one_obstacle(law: str, behind: float, **data) -> Scenario:
    """P is pulled onto a point source; a corner points at it ``behind`` m before."""
    return Scenario.model_validate(
        {
            "law": law,
            "source": {"waypoints_m": [[3.0, 0.0]]} | POINT,
            "attraction": {"follow_distance_m": 0.0},
            "laws": REPULSION,
            "obstacles": [
                {
                    "name": "pin",
                    "waypoints_m": [[3.0 - behind, 0]],
                    "size_m": [1e-6] * 2,
                    "heading_deg": 45.0,
                }
            ],
        }
        | data
    )


@pytest.mark.parametrize("behind", [1.5, 2.0, 2.5])
def test_one_obstacle_makes_the_saddle_of_the_closed_form(behind):
    """K_r (L + c) = K_0 (rho_0 - c); radially K_r + K_0, tangentially -K_r L/c."""
    search = find_equilibria(one_obstacle("conventional", behind), area_m=BEFORE)
    assert not search.unresolved
    c = (K_0 * RHO_0 - K_R * behind) / (K_0 + K_R)
    place = [3.0 - behind - c, 0.0]
    (point,) = [p for p in search.points if np.allclose(p.p_WP, place, atol=1e-6)]
    stiffness = np.diag([K_0 + K_R, -K_R * behind / c])
    np.testing.assert_allclose(point.stiffness_n_m, stiffness, atol=1e-3)
    assert point.kind == "saddle"
    assert not point.stable
    # The exponential growth of p'' = (K_r L/c p - D_r p') / M, nearly (motor lag).
    growth = np.roots([M, D_R, -K_R * behind / c]).max()
    assert point.eigenvalues.real.max() == pytest.approx(growth, rel=0.1)


@settings(max_examples=5)
@given(st.floats(0.6, 2.5), st.sampled_from(["conventional", "active", "active2017"]))
def test_one_small_obstacle_is_never_a_local_minimum(behind, law):
    """Exact nearest-point sensing: whatever lies before the obstacle is no sink."""
    area = (-1.0, 2.99 - behind, -1.0, 1.0)
    search = find_equilibria(one_obstacle(law, behind), area_m=area)
    assert not search.unresolved
    assert all(p.kind != "sink" for p in search.points)


def test_a_flat_face_across_the_line_is_a_trap_as_wide_as_the_face():
    """Its nearest point slides along with P: no push to the side, but K_r's pull."""
    box = {"name": "box", "waypoints_m": [[1.05, 0.0]], "size_m": [0.1, 0.05]}
    scene = one_obstacle("conventional", 2.0, obstacles=[box])
    search = find_equilibria(scene, area_m=BEFORE)
    assert not search.unresolved
    c = (K_0 * RHO_0 - K_R * 2.0) / (K_0 + K_R)
    before = [p for p in search.points if p.p_WP[0] < 1.0]
    assert sorted(p.kind for p in before) == ["saddle", "saddle", "sink"]
    (trap,) = [p for p in before if p.kind == "sink"]
    np.testing.assert_allclose(trap.p_WP, [1.0 - c, 0.0], atol=1e-6)
    np.testing.assert_allclose(trap.stiffness_n_m, np.diag([K_0 + K_R, K_R]), atol=1e-6)
    for saddle in before:
        if saddle is not trap:  # it stands off a corner of the face
            assert 0.025 < abs(saddle.p_WP[1]) < 0.05


def test_a_stiff_obstacle_oscillates_and_is_a_source():
    """At K_0 = 30 the radial mode grows, past the contact limit of 18.2 N/m."""
    gains = {"conventional": {"stiffness_n_m": 30.0}}
    scene = one_obstacle("conventional", 2.0, laws=gains)
    search = find_equilibria(scene, area_m=BEFORE)
    (point,) = [p for p in search.points if p.p_WP[0] < 0.9]
    assert point.kind == "source"


def test_far_from_obstacles_p_rests_anywhere_round_the_source():
    """One of a circle of equilibria: a flat direction, no unstable one."""
    search = find_equilibria(Scenario(law="none"))
    (point,) = search.points
    assert search.complete
    assert point.continuum
    assert point.kind == "sink"
    assert point.offset_m == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(point.p_WP, [0.8, 0.0], atol=2e-3)


def test_pushed_off_the_source_by_the_closed_form_of_the_active_law():
    """On the line K_r (d - d_f) = f(d - half the source's length)."""
    scenario = {"law": "active", "laws": REPULSION}
    point = follow_equilibrium(Scenario.model_validate(scenario))
    alpha = RHO_0 / (2 * math.log(64 / 16))
    c = point.clearance_m
    push = 64 * math.exp(-c / alpha) * c + 0.2 * 0.72
    assert K_R * point.offset_m == pytest.approx(push, rel=1e-9)
    assert point.nearest_body == "source"
    assert point.stable


@pytest.mark.parametrize("law", ["conventional", "active", "active2017"])
def test_force_field_is_what_the_diagram_does(law):
    scenario = ideal_scenario(load_scenario("two_static_obstacles", [f"law={law}"]))
    loop = ideal_loop(frozen_scenario(scenario))
    field = ForceField(loop)
    for p in ([0.9, 0.4], [2.2, -0.6], [4.0, 1.0]):
        state, time_s = loop.settled_state((p[0] - 0.175, p[1], 0.0))
        read = [("controller", "acceleration_W")]
        acceleration = loop.period_derivatives(state, time_s, outputs=read).y
        np.testing.assert_allclose(field.force(p), M * acceleration, atol=1e-12)


@pytest.mark.parametrize("law", ["conventional", "active", "active2017"])
def test_every_root_of_a_blind_search_is_found(law):
    """scipy from 200 random starts finds nothing that the search does not list."""
    from scipy.optimize import root

    scenario = load_scenario("two_static_obstacles", [f"law={law}"])
    search = find_equilibria(scenario)
    assert search.complete, search.statement
    field = ForceField(ideal_loop(search.scenario))
    known = np.array([p.p_WP for p in search.points if not p.continuum])
    source = field.p_WS
    rng = np.random.default_rng(1)
    x0, x1, y0, y1 = search.area_m
    roots = 0
    for start in rng.uniform([x0, y0], [x1, y1], (200, 2)):
        found = root(field.force, start, tol=1e-12)
        at = found.x
        inside = x0 < at[0] < x1 and y0 < at[1] < y1
        if not found.success or not inside or np.linalg.norm(field.force(at)) > 1e-9:
            continue
        roots += 1
        on_circle = abs(np.linalg.norm(at - source) - 1.2) < 1e-6
        assert on_circle or np.linalg.norm(known - at, axis=1).min() <= 1e-5
    assert roots >= 10


def test_following_lags_by_the_damping_over_the_stiffness():
    """Behind a source at v, P is D_r v / K_r farther than the follow distance."""
    point = moving_equilibrium(Scenario(law="none"), (0.3, 0.0))
    assert point.offset_m == pytest.approx(D_R * 0.3 / K_R, abs=1e-4)
    after = point.loop.period_map(point.state, point.time_s)
    step = after - point.state
    names = point.loop.state_names
    assert step[names.index("plant.x")] == pytest.approx(0.3 * 0.025, abs=1e-12)
    assert step[names.index("command.v_WP_x")] == pytest.approx(0.0, abs=1e-12)
    assert point.kind == "sink"
    # Heading: theta' = -(v / epsilon) theta, through the motors' lag of 50 ms.
    rate = np.roots([0.05, 1.0, 0.3 / 0.175]).real.max()
    assert np.abs(point.eigenvalues - rate).min() < 0.06


def test_following_in_any_direction_is_the_same():
    along, oblique = (
        moving_equilibrium(Scenario(law="active"), v)
        for v in ((0.2, 0.0), (0.12, -0.16))
    )
    assert oblique.offset_m == pytest.approx(along.offset_m, abs=1e-6)
    # How often a pole occurs in a minimal realization depends on rounding.
    distances = np.abs(np.subtract.outer(oblique.eigenvalues, along.eigenvalues))
    assert len(along.eigenvalues) >= 8
    assert distances.min(axis=0).max() < 1e-3
    assert distances.min(axis=1).max() < 1e-3


def test_moving_bodies_need_a_moment():
    moving = Scenario.model_validate({"source": {"waypoints_m": [[2, 0], [5, 0]]}})
    with pytest.raises(ValueError, match=r"source: moves.*frozen_scenario"):
        ForceField(ideal_loop(ideal_scenario(moving)))


def test_a_place_where_a_force_acts_is_no_equilibrium():
    loop = ideal_loop(ideal_scenario(Scenario(law="none")))
    with pytest.raises(ValueError, match=r"force of .* N acts.*find_equilibria"):
        resting_equilibrium(loop, np.array([0.0, 0.0]))


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (0.72, 0.0), (1.0, 1.0)])
def test_a_source_that_cannot_be_followed_is_refused(velocity):
    with pytest.raises(ValueError, match="top_speed_m_s"):
        moving_equilibrium(Scenario(), velocity)


def test_without_a_stable_point_the_error_says_what_there_is():
    undamped = Scenario.model_validate({"attraction": {"damping_n_s_m": 0.0}})
    with pytest.raises(ValueError, match=r"no stable equilibrium.*damping_n_s_m"):
        follow_equilibrium(undamped)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [({"area_m": (1, 0, 0, 1)}, "area_m"), ({"smallest_m": 0.0}, "smallest_m")],
)
def test_an_empty_search_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        find_equilibria(Scenario(), **arguments)
