"""Runs to draw: short to make, and each with something to see."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from diagrams import RunResult, Scenario, load_scenario, simulate

CROSSING = (
    "obstacles=[{name: cart, size_m: [0.3, 0.2], waypoints_m: [[3, -2], [3, 2]], "
    "speed_m_s: 0.3}, {name: box, size_m: [0.1, 0.05], waypoints_m: [[2.6, 0.8]]}]"
)


@pytest.fixture(scope="session")
def crossing_run() -> RunResult:
    """A moving and a resting obstacle, cones, a moving source."""
    overrides = ["hearing=ideal", "duration_s=16", CROSSING]
    return simulate(load_scenario("default", overrides))


@pytest.fixture(scope="session")
def ideal_run() -> RunResult:
    """No cones."""
    overrides = ["hearing=ideal", "obstacle_sensing=ideal", "duration_s=6"]
    return simulate(load_scenario("default", overrides))


@pytest.fixture(scope="session")
def collision_run() -> RunResult:
    """The robot drives straight on into the face x = 0.85 m of a box."""
    overrides = [
        "hearing=ideal",
        "law=none",
        "obstacles=[{name: box, size_m: [0.3, 0.3], waypoints_m: [[1.0, 0.1]]}]",
        "source.waypoints_m=[[3, 0]]",
    ]
    return simulate(load_scenario("default", overrides))


@pytest.fixture(scope="session")
def shortest_run() -> RunResult:
    """A single tick: it ends before the second."""
    return simulate(load_scenario("default", ["hearing=ideal", "duration_s=0.01"]))


@pytest.fixture(scope="session")
def two_boxes() -> Callable[..., Scenario]:
    """``two_boxes(law, *overrides)``: a resting source behind two boxes.

    All gains are stated, so that other defaults change nothing here.
    """

    def make(law: str, *overrides: str) -> Scenario:
        gains = (
            f"law={law}",
            "attraction.stiffness_n_m=2.0",
            "attraction.damping_n_s_m=1.0",
            "attraction.follow_distance_m=1.2",
            "repulsion.conventional.stiffness_n_m=16",
            "repulsion.conventional.damping_n_s_m=0.8",
            "repulsion.conventional.reach_m=0.8",
            "repulsion.active.reference_stiffness_n_m=64",
            "repulsion.active.matched_stiffness_n_m=16",
            "repulsion.active.reach_m=0.8",
            "repulsion.active.reference_damping_n_s_m=0.2",
            "repulsion.active.matched_damping_n_s_m=0.8",
            "repulsion.active.speed_limit_m_s=0.6",
            "robot.top_speed_m_s=0.72",
            "repulsion.conventional2017.distance_gain_j=1.1",
            "repulsion.active2017.distance_gain_j=1.1",
            "repulsion.active2017.saturation_distance_m=0.1",
            "repulsion.active2017.damping_n_s_m=0.8",
        )
        return load_scenario("two_static_obstacles", [*gains, *overrides])

    return make
