"""The names of columns and states agree with the ports and states."""

from __future__ import annotations

from itertools import chain

import pytest
from pydrake.systems.primitives import Gain

from diagrams import build_sound_follower, load_scenario
from systems.framework.block import part_of

pytestmark = pytest.mark.drake

BUILDS = (
    ["hearing=audio", "loudspeaker={}"],
    ["hearing=ideal", "ultrasonic.firing=sequential"],
    ["hearing=ideal", "obstacle_sensing=ideal", "law=conventional2017"],
    ["hearing=ideal", "plant.friction=0.5"],
)


@pytest.mark.parametrize("overrides", BUILDS)
def test_each_logged_element_has_a_column_of_its_own(overrides):
    follower = build_sound_follower(load_scenario("default", overrides), log=True)
    robot = follower.robots["robot"]
    for (part, port), names in robot.logged.items():
        assert robot.port(part, port).size() == len(names)
    columns = list(chain.from_iterable(robot.logged.values()))
    assert len(columns) == len(set(columns))
    assert robot.log is not None
    assert robot.log.get_input_port().size() == len(columns)


@pytest.mark.parametrize("overrides", BUILDS)
def test_each_state_that_is_named_is_named_once(overrides):
    """The emitter's past, the microphones' and the estimator's are not named."""
    follower = build_sound_follower(load_scenario("default", overrides))
    context = follower.diagram.CreateDefaultContext()
    unnamed = set()
    for part, block in follower.robots["robot"].blocks.items():
        own = block.GetMyContextFromRoot(context)
        states = getattr(block, "states", ())
        assert len(set(states)) == len(states)
        count = own.num_continuous_states()
        for k in range(own.num_discrete_state_groups()):
            count += own.get_discrete_state(k).size()
        if own.num_abstract_states() or len(states) != count:
            unnamed.add(part)
    assert unnamed <= {"emitter", "microphones", "hearing", "ultrasonic", "collision"}


def test_a_system_that_states_no_part_is_a_controller():
    assert part_of(Gain(1.0, 1)) == "controller"
