"""Proven bounds of the scenario's loops, against the loops and closed forms."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.loops.equilibria import nearest_equilibrium
from analysis.loops.force_field import ForceField
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.ideal_scenarios import ideal_scenario
from analysis.loops.loop_bound import bound_loop
from analysis.loops.motion_families import contact_families, following_families
from analysis.loops.operating_points import resting_equilibrium
from analysis.loops.robustness import (
    contact_poles,
    contact_uncertainty,
    following_poles,
    following_uncertainty,
    pole_cloud,
)
from diagrams import load_scenario
from systems.framework.input_error import InputError
from systems.laws.trajectory.sampled_bounds import SampledMass, stiffness_bound

T = 0.025
SOFT = ["law=conventional", "laws.conventional.stiffness_n_m=5"]


def contact(settings=SOFT, samples=12):
    scenario = load_scenario("default", settings)
    box = contact_uncertainty(scenario)
    poles = contact_poles(scenario)
    cloud = pole_cloud(poles, box, period=T, samples=samples, seed=2)
    return scenario, cloud


def unstable_corner(box, scale):
    """Whether a corner of the scaled box is stiffer than the closed-form bound."""
    for share in itertools.product((-1.0, 1.0), repeat=len(box)):
        v = {
            p.name: p.high
            if p.whole
            else p.nominal + scale * sign * (p.high - p.nominal)
            for p, sign in zip(box, share, strict=True)
        }
        mass = SampledMass(v["robot.mass_kg"], v["plant.motor_lag_s"], T, late_ticks=1)
        stiffness = v["attraction.stiffness_n_m"] + v["law_stiffness_n_m"]
        stiffness *= v["wheel_radius_share"]
        if stiffness > stiffness_bound(v["attraction.damping_n_s_m"], mass):
            return True
    return False


def test_contact_is_bounded_from_both_sides():
    scenario, cloud = contact()
    bound = bound_loop(contact_families(scenario), cloud)
    found = cloud.worst_growth_per_s
    assert found < bound.proven_growth_per_s < found + 0.005 * abs(found)
    assert bound.model_error_per_s < 1e-9
    # The scale is where the softest damper cannot hold the stiffest spring.
    assert bound.scale_proven < bound.scale_unstable <= bound.scale_proven * 1.021
    assert not unstable_corner(cloud.parameters, bound.scale_proven)
    assert unstable_corner(cloud.parameters, bound.scale_unstable)


def test_a_stiff_law_has_no_stable_scale():
    scenario, cloud = contact(["law=conventional"], samples=3)
    bound = bound_loop(contact_families(scenario), cloud)
    assert bound.proven_growth_per_s > cloud.worst_growth_per_s > 0.0
    assert (bound.scale_proven, bound.scale_unstable) == (0.0, 1e-3)


def test_following_is_bounded_where_the_equilibrium_moves():
    # The active law's push by the source moves the equilibrium with K_r.
    base = load_scenario(
        "default", ["law=active", "obstacles=[]", "source.waypoints_m=[[2, 0]]"]
    )
    loop = ideal_loop(ideal_scenario(base))
    place = nearest_equilibrium(ForceField(loop), np.array([0.5, 0.1]))
    assert place is not None
    at = resting_equilibrium(loop, place)
    poles, box = following_poles(at), following_uncertainty(base)
    cloud = pole_cloud(poles, box, period=T, samples=4, seed=1)
    bound = bound_loop(following_families(at), cloud)
    found = cloud.worst_growth_per_s
    assert found < bound.proven_growth_per_s < 0.99 * found < 0.0
    assert bound.model_error_per_s < 2e-6
    # With all these parameters, scaling ends where the lag is 5 % of its nominal value.
    assert bound.scale_proven == bound.scale_largest == pytest.approx(0.95 / 0.4)
    assert math.isinf(bound.scale_unstable)


def test_another_loop_is_not_bounded():
    scenario, cloud = contact(samples=3)
    faster = replace(cloud, poles=tuple(0.99 * each for each in cloud.poles))
    with pytest.raises(InputError, match="no reduced loop has the poles of this loop"):
        bound_loop(contact_families(scenario), faster)
    assert np.isfinite(cloud.worst_growth_per_s)
