"""The compiled loop connects and orders blocks as the diagrams do."""

from __future__ import annotations

import pytest

from diagrams import load_scenario
from diagrams.running.compiled.loop_blocks import (
    LoopBlocks,
    shared_blocks,
    shared_sources,
    shared_world,
)
from systems.framework.block import Step

pytestmark = pytest.mark.drake

#: Step of a block whose outputs are not part of its state.
NO_STEP = Step(lambda *_: None, ())


@pytest.fixture(scope="module")
def leader() -> LoopBlocks:
    return shared_blocks(load_scenario("convoy"))["leader"]


def test_inputs_are_connected_as_in_the_diagram(leader):
    """Also those of a loudspeaker, whose ports have other names than the plant's."""
    assert leader.inputs["emitter"] == {
        "pose_WS": ("plant", "pose_WB"),
        "v_WS": ("plant", "velocity_WB"),
    }
    assert leader.inputs["hearing"]["audio"] == ("microphones", "audio")
    assert leader.inputs["microphones"]["emission"] == ("", "emission")
    assert {("microphones", "audio"), ("", "emission")} <= leader.objects
    assert leader.sizes["", "emission_leader"] == 0
    assert leader.sizes["plant", "pose_WB"] == 3


def test_parts_follow_those_that_they_read(leader):
    publishing = NO_STEP._replace(publish=lambda *_: None)
    steps = dict.fromkeys(leader.blocks, NO_STEP) | {"plant": publishing}
    # The loop between the plant and the law is cut at the blocks with a state, too.
    steps |= {"command": publishing, "tracker": publishing, "odometry": publishing}
    early, late = leader.order(steps)
    assert {*late} == {"plant", "command", "tracker", "odometry"}
    assert sorted(early + late) == sorted(leader.blocks)
    for number, part in enumerate(early):
        read = {source for source, _ in leader.inputs[part].values()}
        assert read <= {"", *late, *early[:number]}


def test_blocks_are_shared_by_layouts_and_not_by_sounds():
    scenario = load_scenario("convoy")
    moved = scenario.model_copy(update={"seed": 7, "duration_s": 3.0})
    assert shared_blocks(moved)["leader"] is shared_blocks(scenario)["leader"]
    assert shared_sources(moved)["source"] is shared_sources(scenario)["source"]
    longer = load_scenario("convoy", {"sound.period_s": 2.5})
    assert shared_sources(longer)["source"] is not shared_sources(scenario)["source"]
    assert shared_world(scenario) is None


def test_what_no_robot_hears_has_no_loudspeaker():
    silent = load_scenario("convoy", {"hearing": "ideal"})
    assert shared_sources(silent) == {}
    assert "emitter" not in shared_blocks(silent)["leader"].blocks
