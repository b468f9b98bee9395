"""The conventional law at chosen points, and its block."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from phonotaxis.testing import assert_linearization, evaluate
from systems.base.robot import RobotParameters
from systems.laws.conventional import ConventionalParameters, conventional_force
from systems.laws.impedance_controller import ConventionalImpedanceController
from systems.laws.parameters import AttractionParameters
from tests.systems.laws.one_obstacle import ONE_OBSTACLE

GAINS = ConventionalParameters(stiffness_n_m=10.0, damping_n_s_m=3.0)


@pytest.mark.parametrize(
    ("c", "s", "force"),
    [
        (0.8, 0.0, 0.0),
        (0.4, 0.0, 4.0),
        (0.0, 0.0, 8.0),
        (0.4, 0.5, 5.5),
        (0.79, 1.0, 3.1),
        (0.81, 1.0, 0.0),
        (3.0, 5.0, 0.0),
    ],
)
def test_force(c, s, force):
    """K_0 = 10 N/m, D_0 = 3 N s/m, rho_0 = 0.8 m (Han 2019, eq. 19-a)."""
    assert conventional_force(c, s, GAINS) == pytest.approx(force)


def test_barrier_is_the_spring_s_energy():
    energy, _ = quad(lambda c: conventional_force(c, 0.0, GAINS), 0.0, 0.8)
    assert energy == pytest.approx(10.0 * 0.8**2 / 2)


def test_block_adds_attraction_and_repulsion():
    """Seen from B at rest: P at (0.175, 0), obstacle 0.5 m ahead, new: s = 0."""
    block = ConventionalImpedanceController(gains=GAINS)
    outputs = evaluate(
        block,
        p_WS_estimated=[3.175, 0.0],
        target_valid=[1.0],
        collision_vectors_B=[0.5, 0, 0, 0, 0, 0],
        features=[2, 0, 0],
        pose_WB_estimated=[0, 0, 0],
        v_WP=[0.2, 0.1],
    )
    expected = [2.0 * (3.0 - 1.2) - 0.2, -0.1, -10.0 * 0.3, 0.0]
    np.testing.assert_allclose(outputs["forces_W"], expected, atol=1e-9)


def test_printed_velocity_term_also_resists_a_receding_obstacle():
    outputs = evaluate(ConventionalImpedanceController(gains=GAINS), **ONE_OBSTACLE)
    s = outputs["obstacle_speeds"][0]
    force = -outputs["forces_W"][2:]
    c = np.hypot(0.6, 0.1)
    assert np.linalg.norm(force) == pytest.approx(10.0 * (0.8 - c) + 3.0 * s)


def test_without_target_it_still_pushes_off():
    outputs = evaluate(
        ConventionalImpedanceController(gains=GAINS),
        p_WS_estimated=[0.0, 0.0],
        target_valid=[0.0],
        collision_vectors_B=[0.5, 0, 0, 0, 0, 0],
        features=[1, 0, 0],
        pose_WB_estimated=[0.0, 0.1, 0.0],
        v_WP=[0.4, 0.0],
    )
    expected = [-3.94 / 0.5 * 0.4, 0.0, -3.0, 0.0]
    np.testing.assert_allclose(outputs["forces_W"], expected, atol=1e-9)


@pytest.mark.parametrize("velocity_term", ["printed", "closing"])
@pytest.mark.parametrize("valid", [1.0, 0.0])
def test_gradient(velocity_term, valid):
    block = ConventionalImpedanceController(
        robot=RobotParameters(control_point_m=0.2, mass_kg=5.0),
        attraction=AttractionParameters(follow_distance_m=0.6, damping_n_s_m=4.0),
        gains=GAINS,
        velocity_term=velocity_term,
    )
    assert_linearization(block, **ONE_OBSTACLE | {"target_valid": [valid]})
