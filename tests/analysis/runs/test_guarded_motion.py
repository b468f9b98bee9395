"""Where a guarded robot could rest, by other means than the guard's."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.runs.guarded_motion import GUARD_ACTIONS, guarded_motion
from analysis.runs.known_space import known_space
from systems.safety.braking import HALTED
from systems.world.geometry import rectangle_clearance


@pytest.fixture(scope="module")
def motion(guarded_run):
    found = guarded_motion(guarded_run)
    assert found is not None
    return found


def test_the_outline_is_the_body_and_the_margin(motion):
    assert motion.half_size_m == pytest.approx((0.175 + 0.012, 0.41 + 0.012))


def test_actions_are_those_of_the_table(guarded_run, motion):
    assert np.array_equal(motion.actions, guarded_run.columns["guard_action"])
    assert set(motion.actions.tolist()) == set(range(HALTED))
    assert GUARD_ACTIONS[HALTED] == "halted"


def test_a_robot_that_rests_stays(guarded_run, motion):
    assert motion.resting_poses[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    columns = guarded_run.columns
    place = columns["p_WB_estimated_x"][-1], columns["p_WB_estimated_y"][-1]
    assert motion.resting_poses[-1, :2] == pytest.approx(place, abs=2e-3)


def test_the_way_to_rest_is_that_of_the_commands_and_of_the_lag(guarded_run, motion):
    """What lags by T behind u goes on for the sum of u and T times its speed now."""
    columns = guarded_run.columns
    tick = round(0.7 / 0.025)
    rims = [0.06 * columns[f"wheel_speed_{s}"][tick - 1] for s in ("left", "right")]
    assert rims == pytest.approx([0.6, 0.6])
    braking = np.arange(0.6 - 1.5 * 0.025, 0.0, -1.5 * 0.025)
    way = 0.025 * np.sum(braking) + 0.05 * columns["v_WB_x"][tick]
    ahead = motion.resting_poses[tick, 0] - columns["p_WB_estimated_x"][tick]
    assert ahead == pytest.approx(way, abs=2e-4)
    assert 0.14 < way < 0.16


def test_the_outline_at_rest_lies_in_known_space(guarded_run, motion):
    """But for 3 mm: the robot of the table is not quite where its odometry is."""
    rows = np.arange(4, len(guarded_run.time), 20)
    known = known_space(guarded_run, guarded_run.time[rows])
    assert known is not None
    assert len(known.times) == len(rows)
    free = np.pad(known.free, ((0, 0), (1, 1), (1, 1)))
    x_low, _, y_low, _ = known.extent
    for k, row in enumerate(rows):
        corners = np.argwhere(~free[k]) * 0.05 + [x_low - 0.05, y_low - 0.05]
        body = np.array([*motion.resting_poses[row], 0.35, 0.82, 0.0])
        near = corners[np.hypot(*(corners + 0.025 - body[:2]).T) < 0.7]
        for cell in near + 0.025:
            box = np.array([*cell, 0.0, 0.05, 0.05, 0.0])
            assert rectangle_clearance(body, box) >= 0.012 - 0.003


def test_without_guard_there_is_none(crossing_run):
    assert guarded_motion(crossing_run) is None
