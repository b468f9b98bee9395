"""Where the laws jam: exact minima, boxes, and the ratio's fold."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.loops.equilibria import find_equilibria
from analysis.loops.point_mass import point_mass
from studies.nonlinear.equilibrium_maps import (
    boxes_scenario,
    gap_map,
    local_minima,
    offset_map,
)
from studies.nonlinear.stiffness_ratio import stiffness_ratio_map
from studies.support.trap_stiffness import trap_stiffness


def stiff(law):
    """The gains of the design note: K_0 = 20, r = 4."""
    return (
        law,
        "laws.conventional.stiffness_n_m=20",
        "laws.active.matched_stiffness_n_m=20",
        "laws.active.reference_stiffness_n_m=80",
    )


@pytest.mark.parametrize(
    ("law", "gap", "free"), [("conventional", 0.8, 1.4), ("active", 1.2, 2.2)]
)
def test_the_sum_of_two_pushes_traps_between_boxes(two_boxes, law, gap, free):
    found = gap_map(two_boxes(*stiff(law)), (gap, free), sensing="exact sum")
    assert found.jams == (gap,)


def test_minima_have_no_force(two_boxes):
    """The sum of pushes is smooth there: the blocks' force vanishes."""
    case = boxes_scenario(
        two_boxes(*stiff("active")), [(2.0, 0.65), (2.0, -0.65)], "exact sum"
    )
    model = point_mass(case)
    found = gap_map(two_boxes(*stiff("active")), (1.2,), sensing="exact sum")
    for point in found.points:
        force = model.force([[point.x_m, point.y_m, 0.0, 0.0]], "none")[0]
        assert np.hypot(*force) < 0.01
    coarse = local_minima(model, cell_m=0.05)
    jams = [p for p in found.points if p.outcome == "jam"]
    jam = min(jams, key=lambda p: abs(p.y_m))
    assert np.hypot(*(coarse - [jam.x_m, jam.y_m]).T).min() < 0.05


@pytest.mark.slow
def test_jams_are_the_sinks_of_the_global_search(two_boxes):
    """Two ways: minima of the energy, zeros of the blocks' force."""
    scenario = two_boxes(*stiff("active"))
    found = gap_map(scenario, (1.2,), sensing="exact sum")
    case = boxes_scenario(scenario, [(2.0, 0.65), (2.0, -0.65)], "exact sum")
    search = find_equilibria(case, area_m=(0.5, 2.5, -1.5, 1.5), smallest_m=0.01)
    sinks = [p.p_WP for p in search.points if p.kind == "sink"]
    jams = [(p.x_m, p.y_m) for p in found.points if p.outcome == "jam"]
    np.testing.assert_allclose(sorted(map(tuple, sinks)), sorted(jams), atol=1e-3)


@pytest.mark.parametrize("law", ["conventional", "active"])
def test_a_face_traps_as_far_as_it_is_wide(two_boxes, law):
    """A box 0.1 m wide: held while the line to the source meets its face."""
    found = offset_map(
        two_boxes(*stiff(law)), (0.0, 0.03, 0.07, 0.1), sensing="exact nearest"
    )
    assert found.jams == (0.0, 0.03)


def test_ends_of_runs_with_cones(two_boxes):
    found = offset_map(two_boxes(*stiff("active")), (0.0, 0.6), sensing="cones")
    assert [p.outcome for p in found.points] == ["jam", "goal"]


@pytest.mark.parametrize("law", ["conventional", "active", "active2017"])
def test_exact_sensing_makes_a_saddle_and_cones_a_trap(two_boxes, law):
    """Across the line, by hand: K_r x/r - F/c exactly, K_r x/r + F/epsilon with cones.

    F = K_r x is the pull, x the stretch, r the distance from the source.
    """
    exact, cones = (trap_stiffness(two_boxes(law), s) for s in ("exact", "cones"))
    c = exact.equilibrium_m
    stretch = 2.0 + c
    pull, attraction = 2.0 * stretch, 2.0 * stretch / (stretch + 1.2)
    assert exact.across_n_m == pytest.approx(attraction - pull / c, rel=1e-3)
    assert cones.across_n_m == pytest.approx(attraction + pull / 0.175, rel=1e-3)
    assert exact.along_n_m > 0.0
    assert not exact.trap
    assert cones.trap


def test_outer_equilibrium_of_the_active_law_by_hand(two_boxes):
    """With nothing to go behind, and hardly any push by the velocity term."""
    scenario = two_boxes("active", "laws.active.reference_damping_n_s_m=1e-9")
    found = stiffness_ratio_map(scenario, (4.0, 16.0), to_go_m=0.0)
    for ratio, outer in zip(found.ratios, found.outer_m, strict=True):
        alpha = 0.8 / (2.0 * math.log(ratio))
        # k_ref exp(-c/alpha) = K_r beside c = 0.
        assert outer == pytest.approx(alpha * math.log(ratio * 16.0 / 2.0), abs=2e-3)


def test_no_equilibrium_where_the_pull_is_too_strong(two_boxes):
    found = stiffness_ratio_map(two_boxes("active"), (1.5, 4.0), to_go_m=6.0)
    assert np.isnan(found.outer_m).all()


def test_unknown_words_are_refused(two_boxes):
    with pytest.raises(ValueError, match="sensing: 'sonar' is unknown"):
        gap_map(two_boxes("active"), (1.0,), sensing="sonar")
    with pytest.raises(ValueError, match="sensing: 'sonar' is neither"):
        trap_stiffness(two_boxes("active"), "sonar")
    with pytest.raises(ValueError, match="body: 'ball' is neither"):
        trap_stiffness(two_boxes("active"), "exact", "ball")
