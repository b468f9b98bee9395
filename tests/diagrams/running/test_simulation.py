"""What a run leaves out of its own time."""

from __future__ import annotations

from time import sleep

import numpy as np
import pytest

from diagrams import (
    build_sound_follower,
    load_scenario,
    make_simulator,
    simulate,
)
from diagrams.running import simulation
from diagrams.scenario.scenario import Scenario
from systems.framework.signals import TICK_S

pytestmark = pytest.mark.drake


def test_code_is_loaded_aside_and_once_for_a_kind_of_build(monkeypatch):
    """A first build of ideal hearing takes a second more here, which does not count."""
    simulators = []

    def slow_at_first(follower):
        simulators.append(make_simulator(follower))
        sleep(1.0 if len(simulators) == 1 else 0.0)
        return simulators[-1]

    monkeypatch.setattr(simulation, "make_simulator", slow_at_first)
    monkeypatch.setattr(simulation, "_LOADED", set())
    scenario = Scenario.model_validate({"hearing": "ideal", "duration_s": 1.0})
    follower = build_sound_follower(scenario, log=True)
    first, second = (simulate(scenario, follower=follower) for _ in range(2))
    assert len(simulators) == 3
    assert simulators[0].get_context().get_time() < 10 * TICK_S
    assert first.wall_s < 1.0
    for name, values in first.columns.items():
        assert values.tobytes() == second.columns[name].tobytes()


def test_speed_of_a_wall_with_sensors_that_fire_in_turn():
    """P closes in straight at 0.72 m/s: s is what P drives, also in the diagram."""
    wall = load_scenario(
        "wall",
        [
            "obstacle_sensing=ultrasonic",
            "ultrasonic.noise_m=0",
            "ultrasonic.firing=sequential",
            "collision_vector.aggregation=nearest",
            "law=none",
        ],
    )
    columns = simulate(wall).columns
    driven = np.gradient(columns["p_WP_x"], columns["t"])
    s = columns["obstacle_speed_1"]
    fast = (driven > 0.6) & (s > 0.0)
    assert np.count_nonzero(fast) > 20
    # The mean of a round is 37.5 ms old, and P gains up to 1.5 m/s in a second.
    np.testing.assert_allclose(s[fast], driven[fast], atol=0.06)
