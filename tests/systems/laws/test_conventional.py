"""The conventional law at chosen points, and its block."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from systems.base.robot import RobotParameters
from systems.laws.conventional import ConventionalParameters, conventional_force
from systems.laws.impedance_controller import ConventionalImpedanceController
from systems.laws.parameters import AttractionParameters

GAINS = ConventionalParameters(stiffness_n_m=10.0, damping_n_s_m=3.0)
POINT = [2.0, 0.4, 0.6, 0.1, 0.2, 0.3, -0.1, -0.1]


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


def test_block_adds_attraction_and_repulsion(bench):
    """Seen from B at rest: P at (0.175, 0), obstacle 0.5 m ahead, new: s = 0."""
    block = ConventionalImpedanceController(gains=GAINS)
    at = bench(
        block,
        p_WS_estimated=[3.175, 0.0],
        target_valid=[1.0],
        collision_vectors_B=[0.5, 0, 0, 0, 0, 0],
        features=[2, 0, 0],
        pose_WB_estimated=[0, 0, 0],
        v_WP=[0.2, 0.1],
    )
    expected = [2.0 * (3.0 - 1.2) - 0.2, -0.1, -10.0 * 0.3, 0.0]
    np.testing.assert_allclose(at.output("forces_W"), expected, atol=1e-9)


def test_printed_velocity_term_also_resists_a_receding_obstacle(controller_bench):
    at = controller_bench(ConventionalImpedanceController(gains=GAINS), POINT)
    s = at.output("obstacle_speeds")[0]
    force = -at.output("forces_W")[2:]
    c = np.hypot(0.6, 0.1)
    assert np.linalg.norm(force) == pytest.approx(10.0 * (0.8 - c) + 3.0 * s)


def test_without_target_it_still_pushes_off(controller_bench):
    block = ConventionalImpedanceController(gains=GAINS)
    point = [0.0, 0.0, 0.5, 0.0, 0.0, 0.4, 0.0, 0.0]
    at = controller_bench(block, point, feature=1.0, valid=0.0)
    expected = [-3.94 / 0.5 * 0.4, 0.0, -3.0, 0.0]
    np.testing.assert_allclose(at.output("forces_W"), expected, atol=1e-9)


@pytest.mark.parametrize("velocity_term", ["printed", "closing"])
@pytest.mark.parametrize("valid", [1.0, 0.0])
def test_gradient(controller_bench, check_gradient, velocity_term, valid):
    def respond(block, x):
        at = controller_bench(block, x, valid=valid)
        outputs = [*at.output("acceleration_W"), *at.output("forces_W")]
        return [*outputs, *at.output("obstacle_speeds"), *at.updated()]

    block = ConventionalImpedanceController(
        robot=RobotParameters(control_point_m=0.2, mass_kg=5.0),
        attraction=AttractionParameters(follow_distance_m=0.6, damping_n_s_m=4.0),
        gains=GAINS,
        velocity_term=velocity_term,
    )
    check_gradient(block, respond, POINT)
