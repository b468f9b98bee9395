"""A user's own law: handed c, s and the parameters, and nothing changed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.math import exp

from phonotaxis.testing import assert_linearization, evaluate
from systems.base.robot import RobotParameters
from systems.laws.conventional import ConventionalParameters
from systems.laws.impedance_controller import RadialLawController
from systems.laws.no_avoidance import no_force
from tests.systems.laws.one_obstacle import ONE_OBSTACLE

pytestmark = pytest.mark.drake

GAINS = ConventionalParameters(stiffness_n_m=7.0)


def exponential_law(c, s, gains):
    return gains.stiffness_n_m * exp(-c) + 0.5 * s


def test_own_law_gets_distance_speed_and_parameters():
    block = RadialLawController(gains=GAINS, law=exponential_law)
    outputs = evaluate(block, **ONE_OBSTACLE | {"features": [1, 0, 0]})
    magnitude = 7.0 * math.exp(-math.hypot(0.6, 0.1))  # new feature: s = 0
    force = outputs["forces_W"][2:]
    assert np.linalg.norm(force) == pytest.approx(magnitude)
    outputs = evaluate(block, **ONE_OBSTACLE)
    speed = outputs["obstacle_speeds"][0]
    assert speed > 1.0
    force = outputs["forces_W"][2:]
    assert np.linalg.norm(force) == pytest.approx(magnitude + 0.5 * speed)


def test_force_points_away_in_world_axes():
    block = RadialLawController(gains=GAINS, law=exponential_law)
    force = evaluate(block, **ONE_OBSTACLE)["forces_W"][2:]
    away = math.atan2(0.1, 0.6) + 0.2 + math.pi
    assert math.atan2(force[1], force[0]) == pytest.approx(away - 2 * math.pi)


def test_no_avoidance_by_default():
    outputs = evaluate(RadialLawController(), **ONE_OBSTACLE)
    np.testing.assert_array_equal(outputs["forces_W"][2:], [0.0, 0.0])
    assert no_force(0.1, 5.0, GAINS) == 0.0


def test_gradient():
    robot = RobotParameters(control_point_m=0.2, mass_kg=5.0)
    block = RadialLawController(robot=robot, gains=GAINS, law=exponential_law)
    assert_linearization(block, **ONE_OBSTACLE)
