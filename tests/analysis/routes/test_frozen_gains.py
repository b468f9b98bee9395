"""Frozen gains against the diagram that simulates, and against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator

from analysis.loops.diagram_state import get_state, run_periods, set_state
from analysis.loops.loop_margins import loop_margins
from analysis.routes.frozen_gains import (
    axis_damping_ratio,
    damped_stiffness,
    gain_bounds,
)
from analysis.routes.route_loop import (
    RoutePoint,
    acceleration_loop,
    contact_gains,
    frozen_model,
    route_law,
    route_points,
    whole_route_model,
)
from diagrams import build_sound_follower, load_scenario
from diagrams.running.simulation import simulator_config
from systems.framework.input_error import InputError
from systems.laws.trajectory.sampled_bounds import SampledMass, sampled_matrix

#: The wall's face is 0.5 m before P, which is 0.08 m ahead of the axle.
WALL = "obstacles=[{size_m: [0.2, 40], waypoints_m: [[0.68, 0]], known: false}]"
T = 0.025


def scenario(law="trajectory_conventional", *fields):
    return load_scenario("unknown_block", [f"law={law}", *fields])


def differences(where, point):
    """d next/d state over a tick of the diagram that simulates, target held."""
    follower = build_sound_follower(where)
    simulator = Simulator(follower.diagram)
    ApplySimulatorConfig(simulator_config(where), simulator)
    context = simulator.get_mutable_context()
    blocks = follower.only.blocks
    own = route_law(where)
    speed, ahead = point.speed_m_s, 0.0
    if point.wall_m is not None:
        push = own.contact_stiffness_n_m * (own.security_zone_m - point.wall_m)
        ahead = push / own.stiffness_n_m
    wheel = speed / where.only.robot.wheel_radius_m
    rest = {
        "plant": [0.0] * 5 + [wheel] * 2,
        "odometry": [-speed * T, 0.0, 0.0, -wheel * T, -wheel * T],
        "command": [speed, 0.0, wheel, wheel],
    }
    if where.only.law == "trajectory_filtered":  # its wheels come first
        rest["command"] = [wheel, wheel, speed, 0.0, 0.0, 0.0]
    law = blocks["controller"].GetMyMutableContextFromRoot(context)
    target = [where.only.robot.control_point_m + ahead, 0.0, speed, 0.0]
    blocks["controller"].GetInputPort("target_state").FixValue(law, target)
    numbered = np.arange(len(get_state(context)), dtype=float)
    # A state of numbers tells where each block's own states are.
    set_state(context, numbered)
    places = []
    for name in rest:
        inner = blocks[name].GetMyContextFromRoot(context)
        groups = [inner.get_continuous_state_vector().CopyToVector()]
        groups += [
            inner.get_discrete_state(k).CopyToVector()
            for k in range(inner.num_discrete_state_groups())
        ]
        places += np.concatenate(groups).astype(int).tolist()
    begin = get_state(Simulator(follower.diagram).get_context())
    begin[places] = [value for values in rest.values() for value in values]

    def after(k, step):
        state = begin.copy()
        state[places[k]] += step
        run_periods(simulator, state, 0.0, 1, T)
        return get_state(context)[places]

    step = 1e-6
    columns = [
        (after(k, step) - after(k, -step)) / (2.0 * step) for k in range(len(places))
    ]
    return np.array(columns).T


@pytest.mark.parametrize(
    ("law", "point"),
    [
        ("trajectory_conventional", RoutePoint("moving", speed_m_s=0.15)),
        ("trajectory_filtered", RoutePoint("wall", wall_m=0.5)),
        ("trajectory_adaptive", RoutePoint("wall", wall_m=0.5)),
    ],
)
def test_the_linear_model_is_that_of_the_diagram(law, point):
    """Law, sensor, filter, odometry and plant as they simulate, by differences."""
    wall = WALL if point.wall_m else "obstacles=[]"
    where = scenario(
        law, wall, "plant.pulses_per_revolution=null", "route.goal_m=[-6, 0]"
    )
    model = whole_route_model(where, point)
    order = [
        k
        for part in ("plant", "odometry", "command")
        for k, name in enumerate(model.state_names)
        if name.startswith(f"{part}.")
    ]
    expected = differences(where, point)
    if law == "trajectory_filtered":
        # What the filter reports, at rest nothing, moves nothing.
        swapped = [*range(12), 14, 15, 12, 13]
        expected = expected[np.ix_(swapped, swapped)]
    np.testing.assert_allclose(model.A[np.ix_(order, order)], expected, atol=2e-6)


@pytest.mark.parametrize("law", ["trajectory_conventional", "trajectory_filtered"])
def test_poles_are_those_of_the_closed_form(law):
    """Each axis at rest; before a wall K_e, and D_e as far as it is felt, are added.

    The closed form is exact; the plant's integrator is not: 0.003 in its motors.
    """
    where = scenario(law)
    own = route_law(where)
    of = SampledMass(where.only.robot.mass_kg, where.only.plant.motor_lag_s, T)
    for point in route_points(where)[1:]:
        k, d = own.stiffness_n_m, own.damping_n_s_m
        share = 0.0
        if point.wall_m is not None:
            share = 1.0 - point.wall_m / own.security_zone_m
            share = share if own.damping_fades else 1.0
            k, d = k + own.contact_stiffness_n_m, d + share * own.contact_damping_n_s_m
        along = np.linalg.eigvals(sampled_matrix(k, d, of))
        across = np.linalg.eigvals(
            sampled_matrix(
                own.stiffness_n_m,
                own.damping_n_s_m + share * own.contact_damping_n_s_m,
                of,
            )
        )
        expected = np.sort_complex(np.concatenate([along, across]))
        found = np.sort_complex(frozen_model(where, point).poles)
        np.testing.assert_allclose(found, expected, atol=0.004)


def test_a_contact_that_is_late_acts_on_an_old_place():
    """K_e on the place two ticks ago and K on the present one, in closed form."""
    where = scenario("trajectory_filtered", "objects.latency_s=0.05")
    of = SampledMass(
        where.only.robot.mass_kg, where.only.plant.motor_lag_s, T, late_ticks=2
    )
    along = sampled_matrix(8.0, 4.0 + 2.0, of)
    kept = math.exp(-T / of.motor_lag_s)
    pull = -T * 3.0 / of.mass_kg
    ways = T - of.motor_lag_s * (1.0 - kept), 1.0 - kept, 1.0
    along[:3, 0] += pull * np.array(ways)
    expected = np.abs(np.linalg.eigvals(along))
    found = np.abs(frozen_model(where, RoutePoint("wall", wall_m=0.4)).poles)
    for radius in expected[expected > 0.01]:
        assert np.abs(found - radius).min() < 0.004


def test_the_delay_margin_is_what_the_loop_stands():
    """Whole ticks of delay at the acceleration, below and above it."""
    where = scenario("trajectory_filtered")
    loop = acceleration_loop(where, RoutePoint("edge", wall_m=0.799), "along")
    margin = loop_margins(loop).delay_margin_s
    below = int(margin / T)
    radii = []
    for ticks in (below, below + 1):
        n, size = len(loop.A), len(loop.A) + ticks
        closed = np.zeros((size, size))
        closed[:n, :n] = loop.A
        closed[:n, [size - 1]] = loop.B
        closed[[n], :n] = -loop.C
        closed[n + 1 :, n:-1] = np.eye(ticks - 1)
        radii.append(np.abs(np.linalg.eigvals(closed)).max())
    assert radii[0] < 1.0 < radii[1]


def test_bounds_are_those_of_the_design():
    """60.9 N/m and 6.25 N/m for a ratio of 0.7, D = 4, lag 50 ms, a tick late."""
    where = scenario()
    bounds = gain_bounds(where)
    assert bounds.stable_today_n_m[1] == pytest.approx(60.9, abs=0.05)
    assert bounds.stable_today_n_m == pytest.approx(bounds.closed_form_n_m, rel=1e-9)
    assert (
        axis_damping_ratio(where, 6.25, 4.0, 1)
        >= 0.7
        > axis_damping_ratio(where, 6.5, 4.0, 1)
    )
    assert damped_stiffness(where, 8.0, 1) == pytest.approx(21.0, abs=0.5)
    assert bounds.damped_today_n_m[1] < bounds.damped_today_n_m[0] < 8.17
    assert bounds.most_damping_n_s_m == pytest.approx(80.0, rel=1e-9)
    assert bounds.contacts == 18.0


def test_nothing_near_has_no_gains():
    own = route_law(scenario("trajectory_filtered"))
    assert contact_gains(own, own.security_zone_m) == (0.0, 0.0)
    assert contact_gains(own, 0.4) == pytest.approx((8.0, 2.0))


def test_a_law_that_follows_a_sound_is_refused():
    with pytest.raises(InputError, match="law: is 'active', but frozen gains"):
        route_points(load_scenario())
