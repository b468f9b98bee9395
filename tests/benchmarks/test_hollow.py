"""The floor of ``make bench``: the wiring and the ticks of the real diagram."""

from __future__ import annotations

import pytest
from pydrake.systems.analysis import Simulator

from benchmarks.hollow import hollow_diagram
from diagrams import build_sound_follower, load_scenario


@pytest.mark.parametrize("overrides", [(), ("hearing=ideal", "law=none")])
def test_hollow_blocks_are_wired_and_act_as_the_real_ones(overrides):
    follower = build_sound_follower(load_scenario("default", overrides), log=True)
    hollow = hollow_diagram(follower, log=True)
    real = {block.get_name(): block for block in follower.blocks.values()}
    for block in hollow.GetSystems():
        if block.get_name() not in real:
            continue
        twin = real.pop(block.get_name())
        for ports in ("input", "output"):
            names = (
                [
                    getattr(each, f"get_{ports}_port")(k).get_name()
                    for k in range(getattr(each, f"num_{ports}_ports")())
                ]
                for each in (block, twin)
            )
            assert next(names) == next(names)
    assert not real
    simulator = Simulator(hollow)
    simulator.AdvanceTo(1.0)
    sink = next(each for each in hollow.GetSystems() if "Log" in type(each).__name__)
    data = sink.FindLog(simulator.get_context()).data()
    columns = sum(
        len(names)
        for parts in follower.robots.values()
        for names in parts.logged.values()
    )
    assert data.shape == (columns, 41)
    assert not data.any()
