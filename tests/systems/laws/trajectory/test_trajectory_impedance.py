"""The law of robots on routes against closed forms, and its two forms to each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from phonotaxis.testing import evaluate
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)
from systems.laws.trajectory.trajectory_filtered import FilteredTrajectoryParameters
from systems.laws.trajectory.trajectory_impedance import (
    ContactNumbers,
    contact_force,
    contact_numbers,
    contacts_of_objects,
    step_is_blocked,
    target_force,
)
from systems.laws.trajectory.trajectory_impedance_controller import (
    TrajectoryImpedanceController,
)
from tests.systems.laws.trajectory.point_robot import ROBOT, TICK_S, along, run
from tests.systems.laws.trajectory.state_space import state_matrices

#: The law of the paper with restored signs: K_e = K and S of table 1. The gains are
#: constant.
CONVENTIONAL = AdaptiveTrajectoryParameters(rate=0.0)
#: The same with damping that fades.
FADING = CONVENTIONAL.model_copy(update={"rule": "sensitivity"})


def objects_of(*slots):
    flat = np.zeros(64)
    for k, slot in enumerate(slots):
        flat[8 * k : 8 * k + len(slot)] = slot
    return flat


def test_force_and_state_space_are_one_law():
    """Eq. 4, 5 and 11 to 18, with the envelope point q + S n for x_e; 1000 cases."""
    draw = np.random.default_rng(1)
    for _ in range(1000):
        count = int(draw.integers(1, 8))
        p, v, p_d, v_d = draw.uniform(-2.0, 2.0, (4, 2))
        mass, k, d = draw.uniform(0.5, 5.0, 3)
        own = TrajectoryImpedanceParameters(
            stiffness_n_m=k,
            damping_n_s_m=d,
            contact_stiffness_n_m=draw.uniform(0.0, 10.0),
            contact_damping_n_s_m=draw.uniform(0.0, 10.0),
        )
        bearing, far = draw.uniform(0, math.tau, count), draw.uniform(0.05, 0.95, count)
        offset = np.stack([far * np.cos(bearing), far * np.sin(bearing)], axis=1)
        v_o = draw.uniform(-1.0, 1.0, (count, 2))
        objects = objects_of(*([1, *offset[j], *v_o[j], 1] for j in range(count)))
        contacts = contacts_of_objects(objects, v, contact_numbers(own))
        gains = own.contact_stiffness_n_m, own.contact_damping_n_s_m
        target = *p_d, *v_d
        by_force = np.add(
            target_force(p, v, target, k, d), contact_force(contacts, *gains)
        )
        a, b1, b2 = state_matrices(mass, (k, d), [gains] * count)
        for axis in range(2):
            n = -offset[:, axis] / far
            x_e = p[axis] + offset[:, axis] + 1.0 * n
            x = a @ [p[axis], v[axis]] + b1 @ [p_d[axis], v_d[axis]]
            for j in range(count):
                x = x + b2[j] @ [x_e[j], v_o[j, axis]]
            assert x[0] == v[axis]
            assert mass * x[1] == pytest.approx(by_force[axis], abs=1e-12 * 50)


@pytest.mark.parametrize("zone", ["security", "envelope", "jump"])
def test_three_readings_of_the_zone(zone):
    numbers = {
        "security": contact_numbers(CONVENTIONAL),
        "envelope": ContactNumbers(2.0, 2.0, False),
        "jump": ContactNumbers(1.0, 2.0, False),
    }[zone]
    for distance in (0.4, 0.999, 1.001, 1.9, 2.1):
        contacts = contacts_of_objects(
            objects_of([1, distance, 0.0, 0, 0, 1]), (0.0, 0.0), numbers
        )
        force = contact_force(contacts, 3.0, 4.0)
        expected = {
            "security": 3.0 * max(1.0 - distance, 0.0),
            "envelope": 3.0 * max(2.0 - distance, 0.0),
            "jump": 3.0 * (2.0 - distance) if distance < 1.0 else 0.0,
        }[zone]
        assert force[0] == pytest.approx(-expected, abs=1e-9)
        assert force[1] == 0.0


def test_damping_fades_in_from_the_edge_of_the_zone():
    numbers = contact_numbers(FADING)
    for distance, share in ((0.999999, 0.0), (0.5, 0.5), (0.25, 0.75)):
        contacts = contacts_of_objects(
            objects_of([1, distance, 0.0, 0.1, 0.0, 1]), (0.3, 0.2), numbers
        )
        force = contact_force(contacts, 0.0, 4.0)
        assert force == pytest.approx(
            (-4.0 * share * 0.2, -4.0 * share * 0.2), abs=1e-5
        )


def test_the_damping_fades_where_the_force_must_not_jump():
    """In the filtered law, and where sensitivities are computed."""
    laws = CONVENTIONAL, FADING, FilteredTrajectoryParameters()
    assert [law.damping_fades for law in laws] == [False, True, True]
    assert not TrajectoryImpedanceParameters().damping_fades


def test_lag_behind_a_target_that_moves():
    """Velocity feedforward: no lag but in a contact, then D_e v/K."""
    speed = 0.15
    targets = along(speed, 60.0)
    free = run(targets, law=CONVENTIONAL)
    assert abs(free[-1, 0] - targets[-1, 0]) < 0.005
    # A row of walls beside the way: a point that goes along abreast, at rest in W.
    beside = np.zeros((len(targets), 1, 4))
    beside[:, 0, 0], beside[:, 0, 1] = free[:, 0], -0.6
    held = run(targets, beside, law=CONVENTIONAL)
    lag = targets[-1, 0] - held[-1, 0]
    beside[:, 0, 0] = held[:, 0]
    for _ in range(6):  # until the point is abreast of where P then is
        held = run(targets, beside, law=CONVENTIONAL)
        beside[:, 0, 0] = held[:, 0]
        lag = targets[-1, 0] - held[-1, 0]
    assert lag == pytest.approx(4.0 * speed / 3.0, abs=0.005)


def test_offset_beside_a_wall():
    """At rest (S - b) K_e/(K + K_e) off a target that is b from a wall."""
    for contact_stiffness, beside in ((3.0, 0.4), (8.0, 0.5), (3.0, 0.7)):
        own = FADING.model_copy(update={"contact_stiffness_n_m": contact_stiffness})
        targets = along(0.0, 40.0)
        # The nearest point of a wall stays abreast of P.
        last = run(targets, [[0.0, -beside, 0.0, 0.0]], law=own)[-1]
        expected = (1.0 - beside) * contact_stiffness / (3.0 + contact_stiffness)
        # From the target; the wall's point recedes as P does.
        assert last[1] == pytest.approx(expected, abs=0.005)


def test_pulled_through_an_obstacle_only_with_enough_lag():
    """Head-on: K lag = K_e (S - d_c) at the contact: nothing holds it any more."""
    touch = 0.1  # from P to the obstacle where the body touches it
    targets = along(0.15, 60.0)
    rows = run(targets, [[3.0, 0.0, 0.0, 0.0]], law=FADING)
    distance = np.abs(3.0 - rows[:, 0])
    first = int(np.argmax(distance <= touch))
    assert first > 0
    lag = targets[first, 0] - rows[first, 0]
    assert 0.75 <= lag <= 0.95
    assert lag >= 3.0 * (1.0 - touch) / 3.0 - 0.02


def test_the_block_adds_both_and_limits_the_acceleration():
    block = TrajectoryImpedanceController(parameters=FADING, robot=ROBOT)
    outputs = evaluate(
        block,
        target_state=[0.5, 0.0, 0.1, 0.0],
        objects_W=objects_of([1, 0.0, 0.4, 0.0, 0.0, 1.0]),
        pose_WB_estimated=[0.0, 0.0, 0.0],
        v_WP=[0.0, 0.05],
    )
    pull = [3.0 * (0.5 - 0.08) + 4.0 * 0.1, -4.0 * 0.05]
    off = [0.0, -3.0 * 0.6 - 4.0 * 0.6 * 0.05]
    np.testing.assert_allclose(outputs["forces_W"], [*pull, *off], atol=1e-9)
    command = outputs["acceleration_W"]
    wanted = np.add(pull, off)
    assert np.linalg.norm(wanted) > 2.5
    np.testing.assert_allclose(command, 2.5 * wanted / np.linalg.norm(wanted))


def test_eq_6_refuses_steps_that_end_near_and_lead_nearer():
    """Against plain geometry: 2000 cases, both answers often."""
    draw, refused = np.random.default_rng(6), 0
    for _ in range(2000):
        places = draw.uniform(-0.5, 0.5, (int(draw.integers(1, 9)), 2))
        step, block = draw.uniform(-0.1, 0.1, 2), draw.uniform(0.05, 0.4)
        found = step_is_blocked(objects_of(*([1, *p] for p in places)), step, block)
        before, after = (np.linalg.norm(places - s, axis=1) for s in (0.0, step))
        assert found == bool(np.any((after <= block) & (after <= before)))
        refused += found
    assert 500 < refused < 1500


@pytest.mark.parametrize(
    ("distance", "speed", "stops"),
    [(0.203, 0.1, False), (0.203, 0.2, True), (0.19, 0.2, True), (0.19, -0.2, False)],
)
def test_eq_6_stops_the_virtual_mass_at_once(distance, speed, stops):
    """A step of T v; -v/T is what the wheel command makes a velocity of zero of."""
    accelerations = []
    for block_m in (None, 0.2):
        own = CONVENTIONAL.model_copy(update={"block_distance_m": block_m})
        block = TrajectoryImpedanceController(parameters=own, robot=ROBOT)
        outputs = evaluate(
            block,
            target_state=[0.08 + (1.0 - distance), 0.0, speed, 0.0],
            objects_W=objects_of([1, distance, 0.0, speed, 0.0, 1.0]),
            # A target that moves straight back would drive it aside.
            pose_WB_estimated=[0.08, -0.08, math.pi / 2.0],
            v_WP=[speed, 0.0],
        )
        accelerations.append(outputs["acceleration_W"])
    free, held = accelerations
    # Spring and target balance.
    np.testing.assert_allclose(free, 0.0, atol=1e-12)
    np.testing.assert_allclose(
        held, [-speed / TICK_S if stops else 0.0, 0.0], atol=1e-9
    )


def test_summed_damping_is_stable_up_to_2M_over_T():
    """Of the sampled velocity loop: v+ = (1 - D1 T/M) v."""
    for damping, stable in ((75.0, True), (85.0, False)):
        own = CONVENTIONAL.model_copy(
            update={"damping_n_s_m": damping, "stiffness_n_m": 1e-3}
        )
        rows = run(along(0.0, 2.0), start=(0.0, 0.0, 0.1, 0.0), law=own)
        assert (abs(rows[-1, 2]) < 0.1) == stable
    assert 2.0 * ROBOT.mass_kg / TICK_S == 80.0
