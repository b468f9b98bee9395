"""Objects by their true places: nearest points, discs, velocities, what spoils them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from systems.base.robot import RobotParameters
from systems.framework.input_error import InputError
from systems.ranging.ideal_object_sensor import IdealObjectSensor
from systems.ranging.objects import KNOWN, RADIUS, ROBOT, THERE, VX, VY, X, Y
from systems.ranging.parameters import ObjectSensorParameters

ROBOT_PARAMETERS = RobotParameters(control_point_m=0.1)


def seen(bodies: Any, ticks: int = 1, robots: Any = (), **own: Any) -> Any:
    """(ticks, 8, 8) of bodies (x, y, theta, vx, vy, omega, length, width)."""
    bodies = np.reshape(np.array(bodies, dtype=float), (-1, 8))
    sizes = np.pad(bodies[:, 6:], ((0, 0), (0, 1)))
    block = IdealObjectSensor(
        parameters=ObjectSensorParameters(**own),
        robot=ROBOT_PARAMETERS,
        bodies=len(bodies),
        robots=robots,
        seed=3,
    )
    step, rows = block.step, []
    state = np.array(step.state)
    for tick in range(ticks):
        poses = bodies[:, :3] + 0.025 * tick * bodies[:, 3:6]
        inputs = [np.zeros(3), poses.ravel(), sizes.ravel()]
        outputs = [[0.0] * 64]
        step.step(tick, state, inputs, outputs, step.numbers)
        rows.append(np.reshape(outputs[0], (8, 8)))
    return np.array(rows)


def test_what_rests_is_its_rectangle():
    """From P at (0.1, 0)."""
    rows = seen(
        [[1.1, 0.0, 0.0, 0, 0, 0, 0.4, 0.2], [0.1, -0.6, 0.3, 0, 0, 0, 0.2, 0.2]], 2
    )
    nearest, farther = rows[1, :2]
    assert nearest[[THERE, KNOWN, VX, VY, RADIUS, ROBOT]].tolist() == [1, 1, 0, 0, 0, 0]
    assert np.hypot(nearest[X], nearest[Y]) < np.hypot(farther[X], farther[Y])
    np.testing.assert_allclose(farther[[X, Y]], [0.8, 0.0])
    assert not rows[1, 2:].any()
    assert rows[0, :2, KNOWN].tolist() == [0, 0]


def test_what_moves_is_a_disc_with_the_velocity_of_its_middle():
    rows = seen([[1.1, 0.0, 0.0, -0.2, 0.1, 0.5, 0.3, 0.4]], 2, robots=(0,))
    # The disc's radius is half of a diagonal of 0.5 m.
    middle = np.array([1.0 - 0.005, 0.0025])
    away = np.linalg.norm(middle)
    slot = rows[1, 0]
    np.testing.assert_allclose(slot[[X, Y]], middle * (1.0 - 0.25 / away), rtol=1e-12)
    np.testing.assert_allclose(slot[[VX, VY, RADIUS, ROBOT]], [-0.2, 0.1, 0.25, 1.0])


def test_a_long_one_is_its_nearest_point_with_that_points_velocity():
    """A wall 3 m long that turns about its middle at (0.6, 1)."""
    slot = seen([[0.6, 1.0, math.pi / 2, 0.0, 0.0, 0.4, 3.0, 0.2]], 2)[1, 0]
    turned = math.pi / 2 + 0.01
    across = np.array([-math.sin(turned), math.cos(turned)])
    from_middle = np.array([0.1, 0.0]) - [0.6, 1.0]
    away = from_middle @ across - 0.1
    np.testing.assert_allclose(slot[[X, Y]], -away * across, atol=1e-12)
    r = np.array([0.1, 0.0]) + slot[[X, Y]] - [0.6, 1.0]
    np.testing.assert_allclose(slot[[VX, VY]], [-0.4 * r[1], 0.4 * r[0]], rtol=1e-9)
    assert slot[RADIUS] == 0.1


def test_beyond_the_range_nothing_is_seen():
    at = [[2.4, 0.0, 0.0, 0, 0, 0, 0.4, 0.2]]
    assert seen(at)[0, 0, THERE] == 0.0
    assert seen(at, maximum_range_m=2.2)[0, 0, THERE] == 1.0


def test_eight_of_many_and_the_nearest_first():
    rows = seen([[0.1, 0.5 + 0.18 * k, 0, 0, 0, 0, 0.05, 0.05] for k in (8, *range(8))])
    away = np.hypot(rows[0, :, X], rows[0, :, Y])
    np.testing.assert_allclose(away, 0.475 + 0.18 * np.arange(8))


def test_a_body_hides_what_is_behind_it():
    bodies = [[1.1, 0, 0, 0, 0, 0, 0.1, 1.0], [1.6, 0, 0, 0, 0, 0, 0.1, 0.1]]
    assert seen(bodies)[0, :, THERE].sum() == 2
    shown = seen(bodies, occlusion=True)[0]
    assert shown[:, THERE].sum() == 1
    assert shown[0, X] == pytest.approx(0.95)


def test_what_shows_a_corner_is_not_hidden():
    """A post 0.9 m ahead of P, 0.1 m wide, shades 0.1 m to each side 1.8 m ahead."""
    post = [1.05, 0, 0, 0, 0, 0, 0.1, 0.1]
    for half, count in ((0.08, 1), (0.12, 2)):
        behind = [1.95, 0, 0, 0, 0, 0, 0.1, 2.0 * half]
        shown = seen([post, behind], occlusion=True, maximum_range_m=3.0)[0]
        assert shown[:, THERE].sum() == count


def test_late_by_the_latency():
    bodies = [[1.1, 0.0, 0.0, -0.4, 0.0, 0.0, 0.2, 0.2]]
    at_once, late = seen(bodies, 8), seen(bodies, 8, latency_s=0.075)
    np.testing.assert_array_equal(late[3:], at_once[:-3])
    assert not late[:3].any()
    with pytest.raises(InputError, match=r"latency_s: 0\.03 s is not a multiple"):
        seen(bodies, latency_s=0.03)


def test_noise_is_as_stated():
    """4000 draws: a standard deviation is known to 1.1 %."""
    bodies = [[1.1, 0.0, 0.0, 0.0, 1e-6, 0.0, 0.2, 0.2]]
    exact = seen(bodies, 2001)[1:, 0]
    noisy = seen(bodies, 2001, noise_m=0.02, velocity_noise_m_s=0.05)[1:, 0]
    off = noisy - exact
    assert off[:, [X, Y]].std() == pytest.approx(0.02, rel=0.05)
    assert off[:, [VX, VY]].std() == pytest.approx(0.05, rel=0.05)
    assert abs(off[:, [X, Y, VX, VY]].mean(axis=0)).max() < 0.004
    assert not off[:, [THERE, KNOWN, RADIUS, ROBOT]].any()
