"""The burst cycle against a model of its own, and against simulation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from analysis.loops.burst_cycle import burst_cycle, simulate_burst_cycle
from diagrams.scenario.scenario import Scenario
from tests.operating_points import follow_point

M, K, D, T = 3.94, 2.0, 1.0, 0.025


def scenario(**data) -> Scenario:
    return Scenario.model_validate({"law": "none"} | data)


def sampled_line(lag: float, hold: str, heard_ticks: int = 20) -> float:
    """Largest multiplier of p, w (lagged), v on a line over 80 ticks.

    What is heard is a tick old. World hold places it by the pose of its moment;
    robot hold keeps the distance, so that it is late by that tick.
    """
    decay = np.exp(-T / lag)
    # State: p, w, v, distance held, p of a tick ago.
    product = np.eye(5)
    for tick in range(80):
        A = np.zeros((5, 5))
        distance = np.eye(5)[0]
        if hold == "robot":
            distance = np.eye(5)[4 if tick < heard_ticks else 3]
        acceleration = -K / M * distance
        acceleration[2] -= D / M
        A[2] = np.eye(5)[2] + T * acceleration
        A[1] = decay * np.eye(5)[1] + (1 - decay) * A[2]
        A[0] = np.eye(5)[0] + lag * (1 - decay) * np.eye(5)[1]
        A[0] += (T - lag * (1 - decay)) * A[2]
        A[3] = distance
        A[4] = np.eye(5)[0]
        product = A @ product
    values = np.linalg.eigvals(product)
    return float(np.abs(values[np.abs(values - 1) > 1e-6]).max())


def continuous_robot_hold() -> float:
    """0.5 s of the loop, 1.5 s of a constant force: the design notes say 0.997."""
    heard = expm(np.array([[0, 1], [-K / M, -D / M]]) * 0.5)
    held = expm(np.array([[0, 1, 0], [0, -D / M, -K / M], [0, 0, 0]]) * 1.5)
    kept = held[:2, :2].copy()
    kept[:, 0] += held[:2, 2]
    return float(np.abs(np.linalg.eigvals(kept @ heard)).max())


def test_this_models_continuous_limit_is_the_design_notes():
    assert continuous_robot_hold() == pytest.approx(0.997, abs=5e-4)
    assert np.exp(-D / (2 * M) * 2.0) == pytest.approx(0.776, abs=5e-4)


@pytest.mark.parametrize("lag", [0.01, 0.05])
@pytest.mark.parametrize("hold", ["world", "robot"])
def test_largest_multiplier_is_that_of_a_model_on_a_line(lag, hold):
    case = scenario(plant={"motor_lag_s": lag})
    found = burst_cycle(case, hold, point=follow_point(case))
    assert found.largest == pytest.approx(sampled_line(lag, hold), abs=2e-3)


def test_world_hold_forgets_and_robot_hold_does_not():
    """The target at rest in W closes the loop by odometry all the time."""
    point = follow_point(scenario())
    world, robot, motion = (
        burst_cycle(scenario(), hold, point=point)
        for hold in ("world", "robot", "motion")
    )
    always = max(np.exp(point.eigenvalues.real * 2.0))
    assert world.largest == pytest.approx(always, rel=1e-3)
    assert motion.largest == pytest.approx(always, rel=1e-3)
    assert world.stable
    assert not robot.stable


def test_without_silence_robot_hold_is_a_tick_late():
    point = follow_point(scenario())
    for hold in ("world", "robot"):
        found = burst_cycle(scenario(), hold, on_s=2.0, gap_s=0.0, point=point)
        assert found.largest == pytest.approx(sampled_line(0.05, hold, 80), abs=1e-3)


@pytest.mark.parametrize("hold", ["world", "robot"])
def test_simulation_shows_the_largest_multiplier(hold):
    cycle = burst_cycle(scenario(), hold, point=follow_point(scenario()))
    run = simulate_burst_cycle(cycle, 24)
    assert run.factor == pytest.approx(cycle.largest, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("direction", ["along", "across"])
def test_simulation_with_the_active_law_shows_both_directions(direction):
    case = scenario(law="active")
    cycle = burst_cycle(case, "robot", point=follow_point(case))
    run = simulate_burst_cycle(cycle, 24, direction=direction)
    largest = abs(getattr(cycle, direction)[0])
    assert run.factor == pytest.approx(largest, rel=0.05)
    assert np.isclose(np.abs(cycle.multipliers), largest, rtol=1e-12).any()


@pytest.mark.parametrize(("on", "gap"), [(0.0, 2.0), (0.5, -0.1), (0.51, 1.5)])
def test_a_cycle_of_no_whole_ticks_is_refused(on, gap):
    with pytest.raises(ValueError, match=r"sound: .* multiples of 0.025"):
        burst_cycle(scenario(), "world", on_s=on, gap_s=gap)
