"""The blocks that all robots share: wind, plume, radio and sink."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diagrams.scenario.checks.search_checks import address_of_robot
from diagrams.scenario.participants import OdorSearcher, SoundSearcher
from diagrams.scenario.scenario import Scenario
from systems import OdorPlume, RadioChannel, SinkMonitor, WindField


def radio_nodes(scenario: Scenario) -> dict[str, int]:
    """Returns the address of each robot that has a radio, by name of the robot."""
    return {
        name: address_of_robot(robot)
        for name, robot in scenario.robots.items()
        if isinstance(robot, OdorSearcher | SoundSearcher)
    }


def world_blocks(scenario: Scenario, seeds: Mapping[str, int]) -> dict[str, Any]:
    """Makes the blocks that all robots share: wind, odor plume, radio and sink.

    The sink is the computer of the operator, which receives radio frames. ``seeds`` has
    the random seeds of the blocks, by name of the block. The keys of the result are the
    parts (roles) of the blocks, such as ``radio``. The result is empty if no robot
    needs these blocks. The blocks are not yet in a diagram.
    """
    blocks: dict[str, Any] = {}
    nodes, tick_s = radio_nodes(scenario), scenario.tick_s
    if scenario.odor is not None and nodes:
        blocks["wind"] = WindField(
            parameters=scenario.wind, seed=seeds["wind_field"], tick_s=tick_s
        )
        blocks["plume"] = OdorPlume(
            parameters=scenario.odor,
            wind=scenario.wind,
            seed=seeds["odor_plume"],
            tick_s=tick_s,
        )
    if nodes:
        blocks["radio"] = RadioChannel(
            parameters=scenario.radio,
            robots=tuple(nodes),
            seed=seeds["radio_channel"],
            tick_s=tick_s,
        )
        blocks["sink"] = SinkMonitor(robots=nodes, tick_s=tick_s)
    return blocks
