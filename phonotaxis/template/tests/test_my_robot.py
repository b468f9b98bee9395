"""Tests of the law and the block."""

import math

import numpy as np
import pytest
from my_robot.laws import PUSH_N, REACH_M, soft

import phonotaxis

LAWS = phonotaxis.load_scenario().only.laws


def test_push_decays_by_e_over_the_reach():
    assert soft(0.0, 0.0, LAWS) == pytest.approx(PUSH_N)
    assert soft(REACH_M, 0.0, LAWS) == pytest.approx(PUSH_N / math.e)


def test_traveled_distance_is_the_length_of_the_trajectory():
    run = phonotaxis.simulate(
        "obstacle_free",
        law="my_robot.laws:soft",
        blocks=["my_robot.blocks:TraveledDistance"],
        hearing="ideal",
        duration_s=2.0,
    )
    x, y = run.trajectory["p_WB_x"], run.trajectory["p_WB_y"]
    length = np.hypot(np.diff(x), np.diff(y)).sum()
    assert length > 0.1
    assert run.trajectory["traveled_distance"].iloc[-1] == pytest.approx(length)
