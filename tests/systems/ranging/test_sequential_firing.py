"""Sensors that fire one after the other: s of a wall, from the ranges to the law."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from phonotaxis.testing import Bench
from systems.base.robot import RobotParameters
from systems.laws.impedance_controller import RadialLawController
from systems.ranging.collision_vector import CollisionVector
from systems.ranging.parameters import CollisionVectorParameters, UltrasonicParameters
from systems.ranging.ultrasonic_array import UltrasonicArray

T = 0.025
START = 2.4
#: Length of the foot on the pair of sensors at 0 and 30 deg before a wall at 1 m:
#: they see (1, 0) and (1/cos 15 deg) (cos 30 deg, sin 30 deg).
PAIR = math.sin(math.radians(30)) / (
    math.cos(math.radians(15))
    * math.hypot(1.0 - 0.5 * math.sqrt(3.0) / math.cos(math.radians(15)),
                 0.5 / math.cos(math.radians(15)))
)  # fmt: skip


def approach(
    firing,
    aggregation,
    *,
    robot,
    wall,
    heading=0.0,
    start=START,
    period=T,
    ticks=30,
):
    """Speeds (ticks, 3) and vectors (ticks, 6) while robot and wall close in.

    The robot drives along its heading at ``robot`` m/s, a long wall across its
    path comes at ``wall`` m/s.
    """
    sensors = UltrasonicParameters.model_validate(
        {"noise_m": 0.0, "firing": firing, "period_s": period}
    )
    far: dict[str, Any] = {
        "poses_WO": [0.0] * 3,
        "sizes": [1.0, 30.0, 0.0],
        "pose_WS": [90.0, 0.0, 0.0],
    }
    array = Bench(
        UltrasonicArray(parameters=sensors, obstacle_count=1),
        pose_WB=[0.0] * 3,
        **far,
    )
    collision = Bench(
        CollisionVector(
            parameters=CollisionVectorParameters(aggregation=aggregation),
            sensors=sensors,
            robot=RobotParameters(),
            initial_pose=(0.0, 0.0, heading),
        )
    )
    controller = Bench(
        RadialLawController(sensors=sensors),
        p_WS_estimated=[5.0, 0.0],
        target_valid=[1.0],
        v_WP=[0.0, 0.0],
    )
    held = firing == "sequential" or period > T
    updated = [controller, collision, array] if held else [controller]
    toward = np.array([math.cos(heading), math.sin(heading)])
    speeds, vectors = [], []
    for tick in range(ticks):
        pose = [*(robot * tick * T * toward), heading]
        ahead = 0.175 + start + 0.5 - wall * tick * T
        array.set(pose_WB=pose, poses_WO=[*(ahead * toward), heading])
        names = ("ranges", "echo", "range_ages")
        collision.set(pose_WB_estimated=pose, **{n: array.output(n) for n in names})
        seen = {n: collision.output(n) for n in ("collision_vectors_B", "features")}
        controller.set(pose_WB_estimated=pose, **seen)
        speeds.append(controller.output("obstacle_speeds"))
        vectors.append(seen["collision_vectors_B"])
        for at in updated:
            at.tick()
    return np.array(speeds), np.array(vectors)


@pytest.mark.parametrize(
    ("robot", "wall"), [(0.72, 0.0), (0.0, 0.72), (0.3, 0.42), (-0.1, 0.82)]
)
@pytest.mark.parametrize("heading", [0.0, 2.5])
def test_speed_of_a_wall_is_true_at_every_tick(robot, wall, heading):
    """0.72 m/s, whoever moves; 2.15, 0, 0.03, 2.15 where a tick is divided by."""
    closing = {"robot": robot, "wall": wall, "heading": heading}
    speeds, _ = approach("sequential", "nearest", **closing)
    np.testing.assert_array_equal(speeds[:4], 0.0, "a round after the first echo")
    np.testing.assert_allclose(speeds[6:, 0], 0.72, atol=1e-9)


@pytest.mark.parametrize(("robot", "wall"), [(0.3, 0.0), (0.0, 0.3), (0.1, 0.2)])
@pytest.mark.parametrize(
    ("firing", "first"), [("simultaneous", 4), ("sequential", 2 * 6)]
)
def test_speed_of_a_wall_where_sensors_fire_every_other_tick(
    firing, first, robot, wall
):
    """A round is two ticks, or six; s is true from the end of the second one on."""
    closing = {"robot": robot, "wall": wall, "period": 2 * T, "ticks": 60}
    speeds, vectors = approach(firing, "nearest", **closing)
    np.testing.assert_allclose(speeds[first:, 0], 0.3, atol=1e-9)
    if not wall:
        now = START - robot * T * np.arange(60)
        np.testing.assert_allclose(vectors[first:, 0], now[first:], atol=1e-9)


def test_distance_of_a_resting_wall_is_that_of_now():
    """Held ranges are carried on with the robot: 1.8 cm a tick at 0.72 m/s."""
    _, vectors = approach("sequential", "nearest", robot=0.72, wall=0.0)
    now = START - 0.72 * T * np.arange(len(vectors))
    np.testing.assert_allclose(vectors[2:, 0], now[2:], atol=1e-9)


def test_distance_of_a_moving_wall_is_as_old_as_its_range():
    """The middle sensor fires at ticks 1, 4, 7: 0, 1 and 2 ticks of 0.72 m/s."""
    _, vectors = approach("sequential", "nearest", robot=0.0, wall=0.72)
    ticks = np.arange(len(vectors))
    fired = ticks - (ticks - 1) % 3
    np.testing.assert_allclose(vectors[4:, 0], (START - 0.72 * T * fired)[4:])


@pytest.mark.parametrize(
    ("robot", "wall", "tolerance"), [(0.72, 0.0, 1e-9), (0.0, 0.72, 0.025)]
)
def test_speed_of_a_pair(robot, wall, tolerance):
    """Case II: the foot lies at PAIR of the wall's distance, and so does its speed.

    Two sensors that fire at different moments see a resting wall as one that
    fires at once; of a moving one, their line is turned a little.
    """
    closing = {"robot": robot, "wall": wall, "start": 0.9}
    at_once, _ = approach("simultaneous", "sum", **closing)
    np.testing.assert_allclose(at_once[1:, :2], PAIR * 0.72, atol=1e-9)
    in_turn, _ = approach("sequential", "sum", **closing)
    np.testing.assert_allclose(in_turn[6:, :2], PAIR * 0.72, rtol=tolerance)
