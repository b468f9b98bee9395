"""The errata of Engelbrecht, Steyn and Djouani 2021, in numbers; docs/errata.md."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.laws.trajectory.impedance_sensitivity import penalty_gradient
from systems.laws.trajectory.parameters import TrajectoryImpedanceParameters
from systems.laws.trajectory.trajectory_impedance import (
    Contact,
    contact_force,
    contact_numbers,
    contacts_of_objects,
    state_matrices,
)
from systems.routes.grid_search import find_cells

#: K = K_e = 3 N/m, D = D_e = 4 N s/m, M = 1 kg, as in the paper's tables.
K, D = 3.0, 4.0
LAW = TrajectoryImpedanceParameters(
    stiffness_n_m=K,
    damping_n_s_m=D,
    contact_stiffness_n_m=K,
    contact_damping_n_s_m=D,
    security_zone_m=1.0,
    damping_fades=False,
)


def force(distance, speed=0.0, **changes):
    """On P along x, away from an object ahead of it at rest."""
    numbers = contact_numbers(LAW.model_copy(update=changes))
    objects = np.zeros(64)
    objects[:6] = 1.0, distance, 0.0, 0.0, 0.0, 1.0
    contacts = contacts_of_objects(objects, (speed, 0.0), numbers)
    return -contact_force(contacts, K, D, numbers)[0]


def poles(contacts):
    """Of one axis, ascending by real part."""
    return np.sort_complex(np.linalg.eigvals(state_matrices(1.0, (K, D), contacts)[0]))


def test_engelbrecht_eq_4_and_5_drive_what_they_should_damp():
    """+D (v - v_j): the push falls as P comes nearer, and the motion feeds itself."""
    assert force(0.5, 0.2) == pytest.approx(K * 0.5 + D * 0.2)
    assert force(0.5, 0.2, reading="printed_force") == pytest.approx(K * 0.5 - D * 0.2)
    one, two = poles([(K, -D)]), poles([(K, -D)] * 2)
    np.testing.assert_allclose(one, [-2.449j, 2.449j], atol=1e-3)
    np.testing.assert_allclose(two, [2.0 - 2.236j, 2.0 + 2.236j], atol=1e-3)
    np.testing.assert_allclose(poles([(K, D)]), [-7.162, -0.838], atol=1e-3)


def test_engelbrecht_eq_10_pulls_to_the_obstacle():
    assert force(0.5, reading="printed_state") == pytest.approx(-K * 0.5)
    assert force(0.5) == pytest.approx(K * 0.5)


def test_engelbrecht_eq_10_with_a_negative_stiffness_is_no_repulsion():
    """K_1 = 0 with one obstacle, below 0 with two."""
    assert poles([(-K, D)])[-1] == pytest.approx(0.0, abs=1e-12)
    assert poles([(-K, D)] * 2)[-1] == pytest.approx(0.245, abs=1e-3)


def test_engelbrecht_eq_13_without_its_signs_is_unstable():
    assert np.linalg.eigvals([[0.0, 1.0], [K, D]]).max() == pytest.approx(
        4.646, abs=1e-3
    )


def test_engelbrecht_eq_13_adds_a_velocity_to_a_place():
    """With a 1 at (1, 2) of B_1, P on a target that moves would move twice as fast."""
    a, b, _ = state_matrices(1.0, (K, D), [])
    state = np.array([0.4, 0.15])
    assert (a @ state + b @ state)[0] == pytest.approx(0.15)
    printed = np.add(b, [[0.0, 1.0], [0.0, 0.0]])
    assert (a @ state + printed @ state)[0] == pytest.approx(0.30)


def test_engelbrecht_zone_of_the_text_makes_the_force_jump():
    """R - d on d < S: 3 N at 1 m from one side, nothing from the other."""
    jump = {"zone": "jump", "horizon_m": 2.0}
    assert force(0.9999, **jump) == pytest.approx(3.0, abs=1e-3)
    assert force(1.0001, **jump) == 0.0
    assert force(0.9999) == pytest.approx(0.0, abs=1e-3)


def test_engelbrecht_eq_27_is_no_penalty():
    """lambda (d_sec^2 - d^2) falls ever faster as d grows; a hinge ends at d_sec."""

    def printed(distance):
        return 0.5**2 - distance**2

    slopes = [(printed(d + 1e-6) - printed(d)) / 1e-6 for d in (0.1, 0.5, 2.0)]
    np.testing.assert_allclose(slopes, [-0.2, -1.0, -4.0], atol=1e-5)
    assert printed(1.0) < 0.0

    def hinge(distance):
        contact = Contact((-1.0, 0.0), distance, 0.0, (0.0, 0.0), 1.0)
        return penalty_gradient([contact], 0.5, 1.0)[0]

    assert [hinge(d) for d in (0.1, 0.4, 0.6)] == pytest.approx([0.4, 0.1, 0.0])


def test_engelbrecht_sec_1_a_star_is_up_to_8_percent_long():
    """ "The closest possible path" on eight neighbours: at 22.5 deg to an axis."""
    size = 200
    blocked = np.zeros((size, size), dtype=np.bool_)
    end = (199, round(199 * math.tan(math.radians(22.5))))
    cells = np.array(find_cells(blocked, (0, 0), end))
    steps = np.hypot(*np.diff(cells, axis=0).T).sum()
    assert steps / math.hypot(*end) == pytest.approx(1.0824, abs=1e-3)
