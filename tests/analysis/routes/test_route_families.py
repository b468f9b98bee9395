"""Reduced loops of a robot on a route, against the linearized blocks."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from analysis.loops.heading_families import (
    heading_families,
    heading_poles,
    heading_uncertainty,
)
from analysis.loops.heading_loop import heading_loop_margins
from analysis.loops.loop_bound import bound_loop
from analysis.loops.loop_margins import loop_margins
from analysis.loops.robustness import pole_cloud
from analysis.routes.frozen_gains import frozen_gains
from analysis.routes.route_families import (
    lateral_loop,
    nominal_difference,
    route_families,
    route_poles,
    route_uncertainty,
)
from diagrams import load_scenario
from systems.framework.input_error import InputError


@pytest.fixture(scope="module")
def filtered():
    return load_scenario("known_u", ["law=trajectory_filtered"])


def test_reduced_loops_are_those_of_the_blocks(filtered):
    points = frozen_gains(filtered)
    assert nominal_difference(filtered, points) < 1e-5
    # On the route, the block model has the poles along and across the route.
    own, of = filtered.router.gains, filtered.only
    across = lateral_loop(
        filtered,
        of.robot.mass_kg,
        of.plant.motor_lag_s,
        own.damping_n_s_m,
        own.stiffness_n_m,
    )
    (driving,) = (point for point in points if point.at.speed_m_s)
    for pole in np.linalg.eigvals(across.A):
        assert np.abs(driving.model.poles - pole).min() < 1e-6


def test_reduced_loops_have_the_margins_of_the_blocks(filtered):
    nominal = {p.name: (p.nominal, p.nominal) for p in route_uncertainty(filtered)}
    rest, lateral, *_ = route_families(filtered)(nominal)
    for point in frozen_gains(filtered):
        if point.at.wall_m is not None:
            continue
        across = lateral if point.at.speed_m_s else rest
        for axis, family in (("along", rest), ("across", across)):
            found = loop_margins(family.opened.model_of(np.empty(0)))
            blocks = point.margins[axis]
            assert found.disk.alpha == pytest.approx(blocks.disk.alpha, rel=1e-4)
            assert found.delay_margin_s == pytest.approx(
                blocks.delay_margin_s, rel=1e-4
            )


def test_no_corner_of_a_route_is_worse_than_proven(filtered):
    box, poles = route_uncertainty(filtered), route_poles(filtered)
    cloud = pole_cloud(poles, box, period=filtered.tick_s, samples=20, seed=1)
    bound = bound_loop(route_families(filtered), cloud, known_error_per_s=1e-6)
    found = cloud.worst_growth_per_s
    assert found < bound.proven_growth_per_s < 0.99 * found < 0.0
    ends = [(p.low, p.high) for p in box]
    corners = [
        np.log(np.abs(poles(dict(zip([p.name for p in box], row, strict=True)))).max())
        for row in itertools.product(*ends)
    ]
    assert max(corners) / filtered.tick_s <= bound.proven_growth_per_s
    # The margins of the corners, by the loops themselves.
    margins = [
        loop_margins(family.opened.model_of(np.empty(0)))
        for row in itertools.islice(itertools.product(*ends), 0, None, 17)
        for family in route_families(filtered)(
            {p.name: (value, value) for p, value in zip(box, row, strict=True)}
        )
    ]
    for worst, values in (
        (bound.disk_margin, [each.disk.alpha for each in margins]),
        (bound.delay_margin_s, [each.delay_margin_s for each in margins]),
    ):
        assert 0.97 * worst.found < worst.proven < worst.found
        assert worst.proven < min(values) < 1.5 * worst.found


def test_a_late_object_sensor_has_no_reduced_loop(filtered):
    late = load_scenario(
        "known_u", ["law=trajectory_filtered", "objects.latency_s=0.1"]
    )
    with pytest.raises(InputError, match=r"latency_s: is 0\.1 s.*set objects"):
        route_families(late)


def test_the_heading_becomes_unstable_at_its_gain_margin():
    scenario = load_scenario("sound_search")
    box = heading_uncertainty(scenario)
    nominal = {p.name: p.nominal for p in box}
    margins = heading_loop_margins(
        scenario.searcher.motor_driver,
        scenario.only.robot,
        scenario.only.plant.motor_lag_s,
        scenario.tick_s,
    )
    limit = 10.0 ** (margins.gain_margin_db / 20.0)
    for share, stable in ((0.999, True), (1.001, False)):
        poles = heading_poles(scenario)(nominal | {"motor_strength": share * limit})
        assert (np.abs(poles).max() < 1.0) == stable
    cloud = pole_cloud(
        heading_poles(scenario), box, period=scenario.tick_s, samples=20, seed=1
    )
    bound = bound_loop(heading_families(scenario), cloud)
    found = cloud.worst_growth_per_s
    assert found < bound.proven_growth_per_s < 0.99 * found < 0.0
