"""What a run leaves out of its own time."""

from __future__ import annotations

from time import sleep

from diagrams import build_sound_follower, make_simulator, simulate, simulation
from diagrams.scenario import Scenario
from systems.signals import FRAME_PERIOD_S


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
    assert simulators[0].get_context().get_time() < 10 * FRAME_PERIOD_S
    assert first.wall_s < 1.0
    for name, values in first.columns.items():
        assert values.tobytes() == second.columns[name].tobytes()
