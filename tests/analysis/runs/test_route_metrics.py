"""Metrics of routes against signals whose figures are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.runs.measured_run import near_and_after, yaw_ripple
from analysis.runs.metric_table import run_metrics
from diagrams import load_scenario, simulate

TICK_S = 0.025
WHICH = "greatest", "last"


def test_a_swing_of_4_hz_is_ripple_and_a_turn_is_none():
    """The mean over whole periods is zero; of the window's odd tick 1 in 41 is left."""
    t = TICK_S * np.arange(2000)
    where = np.zeros(2000, dtype=bool)
    where[400:1600] = True
    swing = yaw_ripple(0.3 * np.sin(8.0 * math.pi * t), where, TICK_S)
    assert swing == pytest.approx(0.3 / math.sqrt(2.0), rel=0.03)
    assert yaw_ripple(0.2 + 0.1 * t, where, TICK_S) == pytest.approx(0.0, abs=1e-12)
    assert yaw_ripple(t, np.zeros(2000, dtype=bool), TICK_S) is None


def test_what_is_met_counts_for_5_s_after():
    clearance = np.full(1000, 2.0)
    clearance[100:140] = 0.9
    met = near_and_after(clearance, TICK_S)
    assert np.flatnonzero(met)[0] == 100
    assert np.flatnonzero(met)[-1] == 139 + 200
    assert not near_and_after(np.full(3, 1.0), TICK_S).any()


def test_beside_a_wall_p_is_off_its_way_by_the_offset_of_springs():
    """(S - b) K_e/(K + K_e) off a way at b from a long wall; adaptive.md, acceptance 4.

    The way is straight, b = 0.6 m from it: (1 - 0.6 - off) 3 = 3 off, off = 0.2 m.
    """
    fields = [
        "law=trajectory_conventional",
        "obstacles.0.waypoints_m=[[3.0, 0.7]]",
        "obstacles.0.size_m=[30.0, 0.2]",
        "duration_s=30",
    ]
    result = simulate(load_scenario("unknown_block", fields), engine="compiled")
    metrics = run_metrics(result)
    assert metrics["route_deviation_m"] == pytest.approx(0.2, abs=0.005)
    # The wall's damping drags: D_e v/K behind the target, 4 x 0.15 / 3.
    lag = result.vector("target")[0, -1] - result.vector("p_WP")[0, -1]
    assert lag == pytest.approx(0.2, abs=0.005)
    assert metrics["replans"] == 0.0
    assert "following_fraction" not in metrics


def test_gains_that_adapt_are_told():
    fields = ["law=trajectory_adaptive", "duration_s=20"]
    metrics = run_metrics(
        simulate(load_scenario("unknown_block", fields), engine="compiled")
    )
    assert metrics["least_stiffness_n_m"] == pytest.approx(3.0, rel=0.01)
    greatest, last = (metrics[f"{which}_stiffness_n_m"] for which in WHICH)
    assert greatest == last
    assert last is not None
    assert last > 3.0
