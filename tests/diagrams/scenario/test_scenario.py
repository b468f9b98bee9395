"""The scenario tree: defaults, derived quantities, checks across fields."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from diagrams.scenario.bodies import robot_rectangle
from diagrams.scenario.participants import StartParameters
from diagrams.scenario.scenario import Scenario
from systems.base.robot import RobotParameters
from systems.framework.input_error import InputError
from systems.world.geometry import rectangle_corners


def test_default_scenario_is_complete():
    scenario = Scenario()
    assert scenario.only.law == "active"
    assert (scenario.follower.hearing, scenario.follower.obstacle_sensing) == (
        "audio",
        "ultrasonic",
    )


def test_goal_radius_is_follow_distance_and_margin():
    scenario = Scenario.model_validate(
        {"attraction": {"follow_distance_m": 0.9}, "stop": {"goal_margin_m": 0.2}}
    )
    assert scenario.goal_radius_m == pytest.approx(1.1)


def test_start_pose_in_radians():
    start = StartParameters(position_m=(1.0, -2.0), heading_deg=90.0)
    assert start.pose == pytest.approx((1.0, -2.0, math.pi / 2))


def test_footprint_is_wider_than_long():
    """0.35 m along x and 0.82 m along y, P on its front edge."""
    corners = rectangle_corners(robot_rectangle((0.0, 0.0, 0.0), RobotParameters()))
    np.testing.assert_allclose(np.abs(corners), [[0.175, 0.41]] * 4)


def obstacle(x: float, y: float, name: str = "box") -> dict[str, object]:
    return {"name": name, "waypoints_m": [[x, y]], "size_m": [0.2, 0.2]}


@pytest.mark.parametrize(
    ("x", "y", "clear"),
    [(0.28, 0.0, True), (0.27, 0.0, False), (0.0, 0.52, True), (0.0, 0.5, False)],
)
def test_no_obstacle_may_stand_on_the_start(x, y, clear):
    """Half of the box and half of the robot: 0.275 m ahead, 0.51 m aside."""
    data = {"obstacles": [obstacle(5.0, 5.0, "far"), obstacle(x, y)]}
    if clear:
        assert len(Scenario.model_validate(data).obstacles) == 2
        return
    with pytest.raises(ValidationError, match=r"obstacles\.1: 'box' is on"):
        Scenario.model_validate(data)


def test_the_source_may_not_stand_on_the_start():
    with pytest.raises(ValidationError, match="source: 'source' is on the"):
        Scenario.model_validate({"source": {"waypoints_m": [[0.3, 0.0]]}})


def test_the_start_itself_may_move():
    data = {
        "obstacles": [obstacle(0.0, 0.0)],
        "start": {"position_m": [0.0, -1.0]},
    }
    assert Scenario.model_validate(data).only.start.position_m == (0.0, -1.0)


@pytest.mark.parametrize("names", [("a", "a"), ("a", "source")])
def test_every_body_has_a_name_of_its_own(names):
    bodies = [obstacle(5.0, k, name) for k, name in enumerate(names)]
    with pytest.raises(ValidationError, match=f"name {names[1]!r} is taken"):
        Scenario.model_validate({"obstacles": bodies})


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            {"source": {"waypoints_m": [[2.0, 0.0], [3.0, 0.0], [3.0, 4.0]]}},
            r"source\.waypoints_m: \(3, 4\) is outside the room",
        ),
        (
            {"sources": {"source": {}, "fan": {"waypoints_m": [[-3.6, 0.0]]}}},
            r"sources\.fan\.waypoints_m: \(-3\.6, 0\)",
        ),
        (
            {"start": {"position_m": [3.4, 0.0]}},
            r"start\.position_m: .*a microphone, is outside",
        ),
        ({"room": {"reverberation_time_s": 0.1}}, r"room\.reverberation_time_s"),
        ({"room": {"absorption": 0.01}}, r"room\.maximum_order"),
    ],
)
def test_all_that_sounds_is_in_the_room(data, message):
    with pytest.raises(ValidationError, match=message):
        Scenario.model_validate({"room": {}} | data)


def test_seed_fits_the_generators():
    assert Scenario(seed=2**63 - 1).seed == 2**63 - 1
    for seed in (-1, 2**63):
        with pytest.raises(InputError, match="seed"):
            Scenario(seed=seed)
