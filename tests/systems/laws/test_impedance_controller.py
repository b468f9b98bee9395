"""What the laws share: attraction, s, and the sum of forces, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from phonotaxis.testing import Bench, evaluate
from systems.laws.active import ACTIVE
from systems.laws.impedance_controller import (
    ActiveImpedanceController,
    ImpedanceController,
    RadialLawController,
    attraction_force,
    obstacle_speed,
    repulsion_force,
)
from systems.laws.parameters import AttractionParameters

T = 0.025
PRINTED = AttractionParameters(follow_distance_m=0.0)
angle = st.floats(-math.pi, math.pi)
length = st.floats(0.1, 10.0)


def test_attraction_as_printed():
    """K_r = 2, D_r = 1 (Han 2019, section 5), with the sign of eq. 19."""
    force = attraction_force((1.0, 1.0), (0.3, -0.2), (2.0, 3.0), True, PRINTED, 3.94)
    assert force == pytest.approx((2.0 - 0.3, 4.0 + 0.2))


@given(angle, length)
def test_attraction_rests_at_the_follow_distance(direction, distance):
    """At rest: pull outside of d_f, none at d_f, push inside."""
    attraction = AttractionParameters(follow_distance_m=1.2, stiffness_n_m=2.0)
    toward = np.array([math.cos(direction), math.sin(direction)])
    p_WS = np.array([0.4, -0.7])
    p_WP = p_WS - distance * toward
    force = attraction_force(p_WP, (0.0, 0.0), p_WS, True, attraction, 3.94)
    np.testing.assert_allclose(force, 2.0 * (distance - 1.2) * toward, atol=1e-9)


def test_without_a_target_the_mass_brakes_with_its_time_constant():
    force = attraction_force((0, 0), (0.4, -0.2), (9, 9), False, PRINTED, 4.0)
    assert force == pytest.approx((-4.0 / 0.5 * 0.4, 4.0 / 0.5 * 0.2))


def test_obstacle_speed_of_a_sliding_surface():
    """C turns from (1, 0) to (1, 0.01): 0.4 m/s printed, receding: not closing."""
    now, before = (1.0, 0.01), (1.0, 0.0)
    assert obstacle_speed(now, before, False, T) == pytest.approx(0.4)
    assert obstacle_speed(now, before, True, T) == 0.0


@given(angle, st.floats(0.2, 3.0), st.floats(-0.1, 0.1))
def test_on_the_line_of_sight_the_printed_speed_is_the_magnitude(
    direction, distance, change
):
    u = np.array([math.cos(direction), math.sin(direction)])
    now, before = (distance + change) * u, distance * u
    printed = obstacle_speed(now, before, False, T)
    closing = obstacle_speed(now, before, True, T)
    assert printed == pytest.approx(abs(change) / T, abs=1e-9)
    assert closing == pytest.approx(max(0.0, -change) / T, abs=1e-9)


@given(angle, angle, st.floats(0.2, 3.0), st.floats(0.2, 3.0))
def test_closing_speed_is_never_above_the_printed(a, b, r, q):
    now, before = (r * math.cos(a), r * math.sin(a)), (q * math.cos(b), q * math.sin(b))
    closing = obstacle_speed(now, before, True, T)
    assert 0.0 <= closing <= obstacle_speed(now, before, False, T) + 1e-9


@given(angle, length)
def test_repulsion_points_away(direction, distance):
    C = (distance * math.cos(direction), distance * math.sin(direction))
    force = repulsion_force(C, 0.0, lambda c, s: 5.0 / c)
    expected = [-5.0 / distance * x / distance for x in C]
    np.testing.assert_allclose(force, expected, rtol=1e-9, atol=1e-12)


def test_forces_of_several_vectors_add():
    block = RadialLawController(law=lambda c, s, _: 1.0 / c)
    at = on_bench(block)
    see(at, (1.0, 1.0, 0.0), (2.0, 0.0, 0.5))
    np.testing.assert_allclose(at.output("forces_W")[2:], [-1.0, -2.0])
    np.testing.assert_array_equal(at.output("obstacle_speeds"), np.zeros(3))


def make_bench(velocity_term="printed", *, pose=(0.0, 0.0, 0.0)):
    """A controller whose force is s itself, so that s shows everywhere."""
    block = RadialLawController(velocity_term=velocity_term, law=lambda c, s, _: s)
    return on_bench(block, pose=pose)


def on_bench(block, *, pose=(0.0, 0.0, 0.0)):
    """A controller that sees nothing, 5 m from its target."""
    return Bench(
        block,
        p_WS_estimated=[5.0, 0.0],
        target_valid=[1.0],
        collision_vectors_B=[0.0] * 6,
        features=[0.0] * 3,
        pose_WB_estimated=pose,
        v_WP=[0.0, 0.0],
    )


def see(at, *vectors, pose=None):
    """Sets what the controller sees: (feature, x, y) a slot, in B."""
    C, features = np.zeros(6), np.zeros(3)
    for slot, (feature, x, y) in enumerate(vectors):
        C[2 * slot : 2 * slot + 2] = x, y
        features[slot] = feature
    values = {"collision_vectors_B": C, "features": features}
    if pose is not None:
        values["pose_WB_estimated"] = pose
    at.set(**values)


@pytest.mark.parametrize(
    ("velocity_term", "approach", "retreat"),
    [("printed", 0.4, 0.4), ("closing", 0.4, 0.0)],
)
def test_speed_over_a_tick(velocity_term, approach, retreat):
    at = make_bench(velocity_term)
    speeds = []
    for x in (1.0, 0.99, 1.0):
        see(at, (2, x, 0.0))
        speeds.append(at.output("obstacle_speeds")[0])
        at.tick()
    assert speeds == pytest.approx([0.0, approach, retreat], abs=1e-9)


def test_speed_is_zero_at_the_first_echo_and_after_a_lost_one():
    at = make_bench()
    speeds = []
    for vectors in ([(2, 1.0, 0.0)], [], [(2, 0.5, 0.0)], [(2, 0.49, 0.0)]):
        see(at, *vectors)
        speeds.append(at.output("obstacle_speeds")[0])
        at.tick()
    assert speeds == pytest.approx([0.0, 0.0, 0.0, 0.4], abs=1e-9)


def test_speed_is_zero_where_the_feature_changes():
    """C jumps by 0.5 m in a tick: a change of sensor, not 20 m/s."""
    at = make_bench()
    see(at, (2, 1.0, 0.0))
    at.tick()
    see(at, (4, 0.5, 0.0))
    assert at.output("obstacle_speeds")[0] == 0.0
    at.tick()
    see(at, (4, 0.5, 0.01))
    assert at.output("obstacle_speeds")[0] == pytest.approx(0.4)


def test_features_are_followed_from_slot_to_slot():
    at = make_bench()
    see(at, (1, 1.0, 0.0), (3, 0.0, -2.0))
    at.tick()
    see(at, (3, 0.0, -1.98), (1, 0.99, 0.0))
    speeds = at.output("obstacle_speeds")
    np.testing.assert_allclose(speeds, [0.8, 0.4, 0.0], atol=1e-9)


def test_turning_on_the_spot_is_no_motion_of_the_obstacle():
    """s is taken in the axes of W: the same C_W seen from a turned robot."""
    at = make_bench()
    see(at, (2, 1.0, 0.0), pose=[0.0, 0.0, 0.0])
    at.tick()
    see(at, (2, math.cos(0.2), -math.sin(0.2)), pose=[0.0, 0.0, 0.2])
    assert at.output("obstacle_speeds")[0] == pytest.approx(0.0, abs=1e-9)


def test_collision_vector_is_only_rotated():
    """Eq. 16 adds the robot's place; |C| would then be measured from W's origin."""
    block = RadialLawController(law=lambda c, s, _: 1.0 / c)
    pose = [100.0, -50.0, math.pi / 2]
    outputs = evaluate(
        block,
        p_WS_estimated=[0.0, 0.0],
        target_valid=[1.0],
        collision_vectors_B=[0.5, 0, 0, 0, 0, 0],
        features=[2, 0, 0],
        pose_WB_estimated=pose,
        v_WP=[0.0, 0.0],
    )
    np.testing.assert_allclose(outputs["forces_W"][2:], [0.0, -2.0], atol=1e-9)


def test_acceleration_is_the_sum_over_the_mass():
    at = make_bench()
    see(at, (2, 1.0, 0.0))
    at.tick()
    see(at, (2, 0.99, 0.0))
    forces = at.output("forces_W")
    # P is 4.825 m from the target; the follow distance is 1.2 m.
    np.testing.assert_allclose(forces, [2 * 3.625, 0.0, -0.4, 0.0], atol=1e-9)
    np.testing.assert_allclose(
        at.output("acceleration_W"), [(2 * 3.625 - 0.4) / 3.94, 0.0], atol=1e-9
    )


def test_a_law_of_the_catalog_and_its_name_are_one_block():
    named, general = ActiveImpedanceController(), ImpedanceController(law=ACTIVE)
    pushes = []
    for block in (named, general):
        at = on_bench(block)
        see(at, (2, 0.4, 0.1))
        pushes.append(at.output("forces_W"))
    np.testing.assert_array_equal(*pushes)
    assert pushes[0][2] < 0.0
    assert named.get_name() == "active_impedance_controller"
    assert isinstance(named, ImpedanceController)


def test_a_named_law_takes_no_other():
    with pytest.raises(TypeError, match="law"):
        ActiveImpedanceController(law=ACTIVE)


def test_unseen_slots_push_nothing():
    """And leave the pull: 2 N/m times 3.625 m, as above."""
    at = make_bench()
    np.testing.assert_allclose(at.output("forces_W"), [7.25, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(at.output("acceleration_W"), [7.25 / 3.94, 0.0])
    np.testing.assert_array_equal(at.output("obstacle_speeds"), np.zeros(3))
