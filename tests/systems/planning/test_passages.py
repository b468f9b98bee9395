"""Passages of a long body: axes and motions against closed forms, and one run."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from phonotaxis import load_scenario, simulate
from systems.planning.drive_state import make_drive_state
from systems.planning.passage import (
    PASSING,
    along_axis,
    front_error,
    lines_up,
    make_passage,
)
from systems.planning.passage_axis import fit_axis
from systems.planning.passage_search import occupied_points, sides
from systems.planning.passing import drive_in_passage
from systems.safety.fine_space import free_fine_cells
from systems.safety.free_space import PARTS, cell_is_free, make_free_space

HALF = 0.9, 0.45


def walls(middle, angle, width, length):
    """Points every 1.25 cm on two straight walls, seen from the middle between them."""
    u = np.arange(-length / 2, length / 2, 0.0125)
    points = np.concatenate([[u, 0 * u + width / 2], [u, 0 * u - width / 2]], axis=1)
    c, s = math.cos(angle), math.sin(angle)
    return (np.array([[c, -s], [s, c]]) @ points).T + middle


@pytest.mark.parametrize("angle", [0.0, 0.4, -2.0])
def test_the_axis_is_the_middle_line_of_straight_walls(angle):
    """From 10 cm beside it and 0.3 rad off, and with phantoms before a wall."""
    points = walls((2.0, 1.0), angle, 1.0, 2.4)
    normal = np.array([-math.sin(angle), math.cos(angle)])
    phantoms = np.array([[2.0, 1.0]]) + 0.35 * normal + [[0.0, 0.0], [0.03, 0.0]]
    passage = make_passage()
    passage.middle[:] = np.array([2.0, 1.0]) + 0.1 * normal
    passage.axis[0], passage.half_m[0] = angle + 0.3, 1.0
    both = np.concatenate([points, phantoms])
    fit_axis(passage, both, 0.8, 0.05)
    fit_axis(passage, both, 0.06, 0.005)
    assert passage.axis[0] == pytest.approx(angle, abs=0.01)
    assert abs(normal @ (passage.middle - [2.0, 1.0])) < 0.01
    assert passage.width_m[0] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("heading", [0.2, -0.6, 1.0])
def test_a_body_whose_front_follows_the_axis_lines_up_as_a_tractrix(heading):
    """After the length s, tan(h/2) has decreased by exp(-s/l): 2 cm steps miss 3 %."""
    passage = make_passage()
    passage.half_m[0] = 1.0
    needed = HALF[0] * math.log(math.tan(abs(heading) / 2) / math.tan(0.015 / 2))
    for way, expected in ((1.03 * needed, True), (0.97 * needed, False)):
        front = HALF[0] - 1.0 - way
        pose = front - HALF[0] * math.cos(heading), -HALF[0] * math.sin(heading)
        assert front_error(passage, (*pose, heading), HALF[0]) == pytest.approx(
            (front, 0.0), abs=1e-12
        )
        assert lines_up(passage, (*pose, heading), HALF) == expected


def test_a_body_beside_the_axis_turns_its_front_toward_it():
    """In line with the axis, and 1 m beside it: the front has to move by 66 deg."""
    passage, memory = make_passage(), make_drive_state(8, 1).memory
    passage.state[0] = PASSING
    error = along_axis(passage, (0.0, 1.0, 0.0), HALF[0])
    assert error == pytest.approx(-math.atan(1.0 / 0.45))
    numbers: Any = SimpleNamespace(half_size=HALF, widths=(1.0, 1.02), creep_m_s=0.3)
    drive_in_passage(memory, passage, 0.0, 0.3, error, 1.0, numbers)
    assert memory.speed[0] == 0.0
    assert memory.turn[0] < -0.1


def test_nearest_points_on_both_sides():
    points = np.array([[0.3, 0.0], [0.0, 0.4], [-0.8, 0.1], [-0.9, 0.0]])
    assert sides(points, 0.0, 0.0) == pytest.approx((0.3, math.hypot(0.8, 0.1)))
    assert sides(points[:2], 0.0, 0.0) == (0.3, math.inf)


def test_fine_cells_are_free_if_they_or_their_cells_are():
    space, rng = make_free_space(40, 0.05, 1, 2, 60), np.random.default_rng(1)
    space.free_until[:] = rng.choice([-1.0, 1.0], space.free_until.shape)
    space.fine.free_until[:] = rng.choice([-1.0, 1.0], space.fine.free_until.shape)
    found = free_fine_cells(space, -70, -45, 33, 61, 0.5)
    for i in range(-70, 34):
        for j in range(-45, 62):
            own = cell_is_free(space.fine, i, j, 0.5)
            wide = cell_is_free(space, i // PARTS, j // PARTS, 0.5)
            assert found[i + 70, j + 45] == (own or wide)


def test_occupied_points_are_fine_cells_that_were_not_seen_free():
    space = make_free_space(80, 0.05, 1, 2, 80)
    space.hits[2, 3] = space.hits[30, 0] = 9.0
    space.fine.free_until[8:10, 12:16] = 1.0
    found = occupied_points(space, (0.0, 0.0), 2.0, np.zeros((0, 3)))
    # Half of the cell in the window of the fine cells, and the whole cell outside.
    fine = {
        (0.0125 * (a + 0.5), 0.0125 * (b + 0.5))
        for a in (10, 11)
        for b in range(12, 16)
    }
    assert {tuple(point) for point in found.round(6)} == {
        *((round(x, 6), round(y, 6)) for x, y in fine),
        (1.525, 0.025),
    }


def test_a_long_body_passes_a_gap_that_is_narrower_than_its_disc():
    """The gap is 0.75 m wide, the body 0.6 m, and its disc 1.34 m."""
    wall = {"size_m": [1.0, 20.0]}
    scenario = load_scenario(
        "default",
        {
            "law": "guarded",
            "engine": "compiled",
            "hearing": "ideal_always",
            "duration_s": 60.0,
            "arena_m": [50.0, 50.0],
            "start": {"position_m": [-4.0, 1.0], "heading_deg": 0.0},
            "robot": {
                "length_m": 1.2,
                "width_m": 0.6,
                "control_point_m": 0.6,
                "wheel_separation_m": 0.5,
                "microphones_m": [[0, 0.2], [0, 0], [0, -0.2]],
                "top_speed_m_s": 1.0,
            },
            "ultrasonic": {"preset": "lidar"},
            "source": {"waypoints_m": [[4.5, 0.0]], "length_m": 0.02, "width_m": 0.02},
            "attraction": {"follow_distance_m": 0.3},
            "obstacles": [
                {"name": "left", "waypoints_m": [[0.5, 10.375]], **wall},
                {"name": "right", "waypoints_m": [[0.5, -10.375]], **wall},
            ],
        },
    )
    metrics = simulate(scenario).metrics
    assert metrics["time_to_goal_s"] < 60.0
    assert 0.05 < metrics["minimum_obstacle_clearance_m"] < 0.075
