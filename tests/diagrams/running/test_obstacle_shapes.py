"""Runs with discs, walls and polygons: by both engines, against boxes, and in numbers.

A finer test of the geometry is in ``tests/systems/world``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from diagrams import Scenario, load_scenario, simulate
from diagrams.scenario.warnings.corner_speeds import corner_speeds
from systems.framework.input_error import InputError

WAITING: dict[str, Any] = {
    "law": "none",
    "hearing": "ideal_always",
    "obstacle_sensing": "ideal",
    "attraction": {"stiffness_n_m": 0.0},
    "source": {"waypoints_m": [[6.0, 0.0]]},
    "duration_s": 3.0,
}
#: The corners of a box of 0.6 m x 0.4 m around the origin.
CORNERS = [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]
#: One obstacle of each shape, moving and at rest, between the start and (4, 0).
EVERY_SHAPE: list[dict[str, Any]] = [
    {"name": "post", "radius_m": 0.1, "waypoints_m": [[1.5, 0.7]]},
    {"name": "fence", "wall_m": [[-1.0, 1.4], [3.0, 1.4], [3.0, 2.0]]},
    {"name": "desk", "polygon_m": [[2.0, -1.6], [2.8, -1.4], [2.2, -0.9]]},
    {
        "name": "person",
        "preset": "person",
        "waypoints_m": [[3.2, -1.0], [3.2, 1.0]],
        "at_end": "shuttle",
    },
    {
        "name": "cart",
        "polygon_m": CORNERS[::-1],
        "waypoints_m": [[-2.0, -1.5], [3.0, -1.9], [3.0, -3.0]],
    },
    {
        "name": "gate",
        "wall_m": [[0.0, 0.0], [0.5, 0.0], [0.5, 0.3]],
        "waypoints_m": [[0.5, -1.2], [0.5, -2.0]],
        "at_end": "shuttle",
    },
]


def trajectory(fields: dict[str, Any], engine: str) -> tuple[Any, Any, Any]:
    result = simulate(Scenario.model_validate(fields | {"engine": engine}))
    return result.cause, result.collision, result.poses("WB")


@pytest.mark.parametrize(
    "own",
    [
        {"law": "active"},
        {
            "law": "conventional",
            "obstacle_sensing": "ideal",
            "collision_vector": {"aggregation": "sum"},
        },
        {"law": "orca"},
    ],
    ids=["cones", "exact", "orca"],
)
def test_both_engines_agree(own):
    fields = {
        "hearing": "ideal",
        "source": {"waypoints_m": [[4.0, 0.0]]},
        "obstacles": EVERY_SHAPE,
        "duration_s": 8.0,
        **own,
    }
    drake, compiled = (trajectory(fields, engine) for engine in ("drake", "compiled"))
    assert drake[:2] == compiled[:2]
    np.testing.assert_allclose(drake[2], compiled[2], atol=1e-9)
    assert np.ptp(drake[2][:, 0]) > 0.3


def test_both_engines_plan_around_every_shape():
    fields = {
        "law": "trajectory_filtered",
        "robot": {"preset": "turtlebot3_burger"},
        "route": {"goal_m": [4.0, -1.4]},
        "objects": {"occlusion": True},
        "obstacle_sensing": "ideal",
        "obstacles": EVERY_SHAPE[:4],
        "duration_s": 24.0,
    }
    drake, compiled = (trajectory(fields, engine) for engine in ("drake", "compiled"))
    assert drake[:2] == compiled[:2]
    np.testing.assert_allclose(drake[2], compiled[2], atol=1e-9)
    assert drake[1] is None
    assert np.ptp(drake[2][:, 0]) > 2.0


@pytest.mark.parametrize(
    "own", [{"law": "active"}, {"law": "orca"}, {"obstacle_sensing": "ideal"}]
)
def test_a_box_by_its_corners_is_the_same_obstacle(own):
    """Until they collide, or for 6 s; the noise of the sensors is the same."""
    place = {"name": "box", "waypoints_m": [[2.0, 0.1]], "heading_deg": 20.0}
    found = [
        trajectory(
            {
                "hearing": "ideal",
                "source": {"waypoints_m": [[4.0, 0.0]]},
                "obstacles": [place | shape],
                "duration_s": 6.0,
                **own,
            },
            "compiled",
        )
        for shape in ({"size_m": [0.6, 0.4]}, {"polygon_m": CORNERS})
    ]
    assert found[0][0] == found[1][0]
    np.testing.assert_allclose(found[0][2], found[1][2], atol=1e-6)


def test_a_disc_touches_when_its_rim_arrives():
    """At 1 m/s from x = 3 m to the front at 0.175 m; it passes the corner by 1 mm."""
    disc: dict[str, Any] = {"name": "ball", "radius_m": 0.2, "speed_m_s": 1.0}
    disc |= {"acceleration_m_s2": 1e6, "waypoints_m": [[3.0, 0.0], [-3.0, 0.0]]}
    result = simulate(Scenario.model_validate(WAITING | {"obstacles": [disc]}))
    hit = result.collision
    assert hit is not None
    assert (hit.object, hit.fault) == ("ball", "obstacle")
    assert hit.time == pytest.approx(3.0 - 0.2 - 0.175, abs=0.0051)
    for gap, cause in ((0.001, "timeout"), (-0.001, "collision")):
        y = 0.41 + 0.2 + gap
        disc["waypoints_m"] = [[1.0, y], [-1.0, y]]
        result = simulate(Scenario.model_validate(WAITING | {"obstacles": [disc]}))
        assert (result.cause == "collision") == (cause == "collision")


def test_a_wall_is_one_body():
    """It is hit under its name, and its clearance is that of its nearest edge."""
    wall = {"name": "L", "wall_m": [[1.0, -2.0], [1.0, 2.0], [3.0, 2.0]]}
    fields = {
        **WAITING,
        "attraction": {},
        "obstacles": [wall | {"thickness_m": 0.2}],
        "duration_s": 10.0,
    }
    result = simulate(Scenario.model_validate(fields))
    assert result.collision is not None
    assert (result.collision.object, result.collision.fault) == ("L", "robot")
    assert result.poses("WB")[-1, 0] == pytest.approx(0.9 - 0.175, abs=0.02)
    assert [*result.surroundings.bodies] == ["L", "source"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"obstacles": [{"polygon_m": [[-3, -3], [3, -3], [3, 3], [-3, 3]]}]},
            "'obstacle' is on the robot's start",
        ),
        (
            {"obstacles": [{"radius_m": 0.5, "waypoints_m": [[0.6, 0.0]]}]},
            "'obstacle' is on the robot's start",
        ),
    ],
)
def test_starts_inside_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        Scenario(**(WAITING | changes))


def test_goals_inside_a_polygon_are_refused():
    room = [[2.0, -2.0], [6.0, -2.0], [6.0, 2.0], [2.0, 2.0]]
    fields = {
        "law": "trajectory_conventional",
        "route": {"goal_m": [4.0, 0.0]},
        "obstacles": [{"name": "block", "polygon_m": room}],
    }
    message = r"route.goal_m: \(4, 0\) is inside 'block'"
    with pytest.raises(InputError, match=message):
        Scenario(**fields)


def test_a_disc_that_turns_is_no_faster_than_its_center():
    """A box of its size has corners that swing out in the bend."""
    path = {"waypoints_m": [[3.0, 2.0], [3.0, 0.0], [5.0, 0.0]], "speed_m_s": 0.5}
    fast: dict[str, float] = {}
    for name, shape in (("disc", {"radius_m": 0.3}), ("box", {"size_m": [0.6, 0.6]})):
        obstacle = {"name": name, **shape, **path}
        scenario = load_scenario("default", {"obstacles": [obstacle]})
        fast |= corner_speeds(scenario, "robot")
    assert fast["disc"] == pytest.approx(0.5)
    assert fast["box"] > 1.0
    assert math.isfinite(fast["box"])
