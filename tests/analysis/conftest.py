"""Runs to draw: short to make, and each with something to see."""

from __future__ import annotations

import pytest

from diagrams import RunResult, load_scenario, simulate

CROSSING = (
    "obstacles=[{name: cart, size_m: [0.3, 0.2], waypoints_m: [[3, -2], [3, 2]], "
    "speed_m_s: 0.3}, {name: box, size_m: [0.1, 0.05], waypoints_m: [[2.6, 0.8]]}]"
)


@pytest.fixture(scope="session")
def crossing_run() -> RunResult:
    """A moving and a resting obstacle, cones, a moving source."""
    overrides = ["hearing=ideal", "duration_s=16", CROSSING]
    return simulate(load_scenario("default", overrides), engine="compiled")


@pytest.fixture(scope="session")
def ideal_run() -> RunResult:
    """No cones."""
    overrides = ["hearing=ideal", "obstacle_sensing=ideal", "duration_s=6"]
    return simulate(load_scenario("default", overrides), engine="compiled")


@pytest.fixture(scope="session")
def collision_run() -> RunResult:
    """The robot drives straight on into the face x = 0.85 m of a box."""
    overrides = [
        "hearing=ideal",
        "law=none",
        "obstacles=[{name: box, size_m: [0.3, 0.3], waypoints_m: [[1.0, 0.1]]}]",
        "source.waypoints_m=[[3, 0]]",
    ]
    return simulate(load_scenario("default", overrides), engine="compiled")


@pytest.fixture(scope="session")
def shortest_run() -> RunResult:
    """A single tick: it ends before the second."""
    return simulate(load_scenario("default", ["hearing=ideal", "duration_s=0.01"]))


@pytest.fixture(scope="session")
def guarded_run() -> RunResult:
    """A robot with a guard that stops it between two boxes."""
    overrides = ["hearing=ideal", "guard={}", "duration_s=8"]
    return simulate(load_scenario("two_static_obstacles", overrides), engine="compiled")
