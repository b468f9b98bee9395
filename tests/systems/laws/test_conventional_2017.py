"""The conventional law of 2017, by hand from eq. 20: K_0/c + D_0 s.

The gains are not printed; 1.2 N m and 3 N s/m can be worked out on paper.
"""

from __future__ import annotations

import numpy as np
import pytest

from phonotaxis.testing import assert_linearization, evaluate
from systems.base.robot import RobotParameters
from systems.laws.conventional_2017 import (
    Conventional2017Parameters,
    conventional_2017_force,
)
from systems.laws.impedance_controller import ConventionalImpedance2017Controller
from systems.laws.parameters import AttractionParameters
from systems.ranging.parameters import UltrasonicParameters
from tests.systems.laws.one_obstacle import ONE_OBSTACLE

GAINS = Conventional2017Parameters(distance_gain_j=1.2, damping_n_s_m=3.0)
#: Least range of the sensors, m (Kim 2017, 4.2: 3 cm).
LEAST = 0.03


def slope(function, x, h=1e-6):
    return (function(x + h) - function(x - h)) / (2.0 * h)


@pytest.mark.parametrize(
    ("c", "s", "force"),
    [
        (3.0, 0.0, 0.4),
        (1.0, 0.0, 1.2),
        (0.2, 0.0, 6.0),
        (0.1, 0.0, 12.0),
        (0.05, 0.0, 24.0),
        (0.03, 0.0, 40.0),
        (1.0, 0.5, 2.7),
        (1.0, 0.72, 3.36),
        (1.0, 10.0, 31.2),
        (0.05, 1.0, 27.0),
    ],
)
def test_force(c, s, force):
    """Neither term saturates, unlike the active law's at 0.1 m and at 0.72 m/s."""
    found = conventional_2017_force(c, s, GAINS, LEAST)
    assert found == pytest.approx(force, rel=1e-12)


@pytest.mark.parametrize("c", [0.0299, 0.01, 0.0])
def test_nearer_than_the_least_range_the_push_stays(c):
    """1.2 N m over 3 cm: without it the printed law divides by zero."""
    assert conventional_2017_force(c, 0.0, GAINS, LEAST) == pytest.approx(40.0)
    assert conventional_2017_force(c, 0.5, GAINS, LEAST) == pytest.approx(41.5)
    assert conventional_2017_force(c, 0.0, GAINS, 0.1) == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("c", "by_c"), [(1.0, -1.2), (0.2, -30.0), (0.04, -750.0), (0.02, 0.0)]
)
def test_slope_in_distance(c, by_c):
    found = slope(lambda x: conventional_2017_force(x, 0.3, GAINS, LEAST), c)
    assert found == pytest.approx(by_c, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("s", [0.1, 0.73, 5.0])
def test_slope_in_speed(s):
    found = slope(lambda x: conventional_2017_force(0.5, x, GAINS, LEAST), s)
    assert found == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize(
    ("distance", "least", "push"), [(0.4, 0.03, 3.0), (0.02, 0.03, 40.0)]
)
def test_block_adds_attraction_and_repulsion(distance, least, push):
    """The least range is the sensors'."""
    block = ConventionalImpedance2017Controller(
        gains=GAINS,
        sensors=UltrasonicParameters.model_validate({"minimum_range_m": least}),
    )
    outputs = evaluate(
        block,
        p_WS_estimated=[3.175, 0.0],
        target_valid=[1.0],
        collision_vectors_B=[0.0, distance, 0, 0, 0, 0],
        features=[2, 0, 0],
        pose_WB_estimated=[0, 0, 0],
        v_WP=[0.0, 0.0],
    )
    np.testing.assert_allclose(
        outputs["forces_W"], [2.0 * 1.8, 0.0, 0.0, -push], atol=1e-9
    )


@pytest.mark.parametrize("velocity_term", ["printed", "closing"])
@pytest.mark.parametrize("least", [0.03, 1.0])
def test_gradient(velocity_term, least):
    """The obstacle is at 0.61 m."""
    block = ConventionalImpedance2017Controller(
        robot=RobotParameters(control_point_m=0.2, mass_kg=5.0),
        attraction=AttractionParameters(follow_distance_m=0.6, damping_n_s_m=4.0),
        gains=GAINS,
        velocity_term=velocity_term,
        sensors=UltrasonicParameters.model_validate({"minimum_range_m": least}),
    )
    assert_linearization(block, **ONE_OBSTACLE)
