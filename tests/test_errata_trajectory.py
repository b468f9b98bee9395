"""The errata of Engelbrecht, Steyn and Djouani 2021, in numbers; docs/errata.md."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.laws.trajectory.impedance_sensitivity import penalty_gradient
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)
from systems.laws.trajectory.trajectory_impedance import (
    Contact,
    contact_force,
    contact_numbers,
    contacts_of_objects,
    step_is_blocked,
)
from systems.routes.grid_search import search_cells
from tests.systems.laws.trajectory.state_space import state_matrices

#: K = K_e = 3 N/m, D = D_e = 4 N s/m, M = 1 kg, as in the paper's tables.
K, D = 3.0, 4.0
NUMBERS = contact_numbers(TrajectoryImpedanceParameters())


def force(distance, speed=0.0, *, damping=D, **changes):
    """On P along x, away from an object ahead of it at rest."""
    objects = np.zeros(64)
    objects[:6] = 1.0, distance, 0.0, 0.0, 0.0, 1.0
    numbers = NUMBERS._replace(**changes)
    contacts = contacts_of_objects(objects, (speed, 0.0), numbers)
    return -contact_force(contacts, K, damping)[0]


def poles(contacts):
    """Of one axis, ascending by real part."""
    return np.sort_complex(np.linalg.eigvals(state_matrices(1.0, (K, D), contacts)[0]))


def test_engelbrecht_eq_4_and_5_drive_what_they_should_damp():
    """+D (v - v_j): the push falls as P comes nearer, and the motion feeds itself."""
    assert force(0.5, 0.2) == pytest.approx(K * 0.5 + D * 0.2)
    assert force(0.5, 0.2, damping=-D) == pytest.approx(K * 0.5 - D * 0.2)
    one, two = poles([(K, -D)]), poles([(K, -D)] * 2)
    np.testing.assert_allclose(one, [-2.449j, 2.449j], atol=1e-3)
    np.testing.assert_allclose(two, [2.0 - 2.236j, 2.0 + 2.236j], atol=1e-3)
    np.testing.assert_allclose(poles([(K, D)]), [-7.162, -0.838], atol=1e-3)


def test_engelbrecht_eq_10_pulls_to_the_obstacle():
    """The spring of eq. 10 has no force on the obstacle, x_e = q."""
    assert force(0.5, rest_m=0.0) == pytest.approx(-K * 0.5)
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
    assert force(0.9999, rest_m=2.0) == pytest.approx(3.0, abs=1e-3)
    assert force(1.0001, rest_m=2.0) == 0.0
    assert force(0.9999) == pytest.approx(0.0, abs=1e-3)


def test_engelbrecht_eq_27_is_no_penalty():
    """lambda/2 (d_sec^2 - d^2) falls ever faster as d grows; a hinge ends at d_sec.

    With its factor of 1/2 its slope is the -lambda d that eq. 32 has, and that of the
    hinge lambda/2 max(0, d_sec - d)^2, which the code uses, is -lambda (d_sec - d).
    """
    security, weight = 0.5, 3.0

    def printed(distance):
        return 0.5 * weight * (security**2 - distance**2)

    def hinge(distance):
        return 0.5 * weight * max(0.0, security - distance) ** 2

    def slope(penalty, distance):
        return (penalty(distance + 1e-6) - penalty(distance - 1e-6)) / 2e-6

    distances = (0.1, 0.4, 0.6, 2.0)
    np.testing.assert_allclose(
        [slope(printed, d) for d in distances],
        [-weight * d for d in distances],
        atol=1e-8,
    )
    assert printed(1.0) < 0.0
    for distance in distances:
        # The object is ahead along x, so that the distance falls as P moves on.
        contact = Contact((-1.0, 0.0), distance, 0.0, (0.0, 0.0), 1.0)
        along_x = penalty_gradient([contact], security, weight)[0]
        assert along_x == pytest.approx(-slope(hinge, distance), abs=1e-8)


def before_a_wall(allows, lag_s):
    """Largest and last x of a robot whose target passes a wall at 1 m and returns.

    A plain loop that shares nothing with the blocks: target at 0.15 m/s to 3 m and
    back, virtual mass of 1 kg, gains of the paper, motors of a first-order lag.
    """
    tick_s, place, speed, wanted, farthest = 0.025, 0.0, 0.0, 0.0, 0.0
    decay = math.exp(-tick_s / lag_s) if lag_s else 0.0
    for tick in range(2400):
        time = tick * tick_s
        out = min(0.15 * time, 3.0)
        target = out if time < 30.0 else max(3.0 - 0.15 * (time - 30.0), 0.0)
        acceleration = K * (target - place) - D * wanted
        if place < 1.0:
            acceleration -= K * place  # K_e (S - d), S = 1 m and d = 1 m - place
        after = wanted + tick_s * min(max(acceleration, -2.5), 2.5)
        after = min(max(after, -0.22), 0.22)
        wanted = after if allows(1.0 - place, tick_s * after) else 0.0
        place += tick_s * wanted + (speed - wanted) * lag_s * (1.0 - decay)
        speed = wanted + (speed - wanted) * decay
        farthest = max(farthest, place)
    return farthest, place


def test_engelbrecht_eq_6_holds_for_ever_what_has_momentum():
    """A robot that coasts into L_block takes no step that ends outside of it again.

    As printed, a new position needs d > L_block. Without momentum that stops the robot
    before L_block and lets it go when its target returns. With motors of 50 ms it
    coasts 3.3 mm farther, and stays there. A step that leads away is allowed here.
    """
    block = 0.2

    def printed(distance, step):
        return distance - step > block

    def ours(distance, step):
        objects = np.zeros(64)
        objects[:6] = 1.0, distance, 0.0, 0.0, 0.0, 1.0
        return not step_is_blocked(objects, (step, 0.0), block)

    assert before_a_wall(lambda *_: True, 0.05)[0] > 2.5
    for allows in (printed, ours):
        farthest, last = before_a_wall(allows, 0.0)
        assert 0.79 < farthest < 0.8
        assert last == pytest.approx(0.0, abs=0.01)
    farthest, last = before_a_wall(printed, 0.05)
    assert farthest == last == pytest.approx(0.8033, abs=1e-3)
    farthest, last = before_a_wall(ours, 0.05)
    # No farther than it coasts from top speed.
    assert 0.8 < farthest < 0.8 + 0.22 * 0.05
    assert last == pytest.approx(0.0, abs=0.01)


def test_engelbrecht_sec_1_a_star_is_up_to_8_percent_long():
    """ "The closest possible path" on eight neighbors: at 22.5 deg to an axis."""
    size = 200
    blocked = np.zeros((size, size), dtype=np.bool_)
    end = (199, round(199 * math.tan(math.radians(22.5))))
    cells = search_cells(blocked, (0, 0), end)
    steps = np.hypot(*np.diff(cells, axis=0).T).sum()
    assert steps / math.hypot(*end) == pytest.approx(1.0824, abs=1e-3)
