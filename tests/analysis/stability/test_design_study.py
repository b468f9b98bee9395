"""Runs before two obstacles: at the scenario's own rates."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from analysis.stability import design_study as module
from diagrams.scenario.scenario import Scenario

#: One that stops 3 m from the source.
RUN = SimpleNamespace(
    cause="stuck", columns={"source_range_true": np.array([4.0, 3.0])}
)


@pytest.mark.parametrize("tick_s", [0.0125, 0.025])
def test_runs_have_the_rates_of_the_scenario(tick_s, monkeypatch):
    seen: list[Scenario] = []

    def simulate(case):
        seen.append(case)
        return RUN

    monkeypatch.setattr(module, "simulate", simulate)
    rates = {
        "tick_s": tick_s,
        "microphones": {"frame_s": 2 * tick_s},
        "ultrasonic": {"period_s": 4 * tick_s},
    }
    (found,) = module.jam_runs(Scenario.model_validate(rates), ["active"])
    assert {case.tick_s for case in seen} == {tick_s}
    assert {case.follower.microphones.frame_s for case in seen} == {2 * tick_s}
    assert {case.follower.ultrasonic.period_s for case in seen} == {4 * tick_s}
    assert found.causes == {"stuck": len(module.JAM_STARTS_M)}
    assert found.jams == len(module.JAM_STARTS_M), "none came into the goal"
