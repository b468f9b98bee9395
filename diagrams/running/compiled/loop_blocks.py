"""Blocks of robots for compiled loops, shared by runs that differ only in layout."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Any

from pydrake.systems.framework import PortDataType

from diagrams.building.robot import (
    OUTSIDE,
    columns_of,
    require_published,
    robot_blocks,
    world_seeds,
)
from diagrams.building.world_blocks import radio_nodes, world_blocks
from diagrams.scenario.own_code import loaded_digests
from diagrams.scenario.participants import Router
from diagrams.scenario.scenario import Scenario
from systems.framework.block import RunFacts, Step
from systems.framework.input_error import InputError

#: Inputs from outside: inputs of a robot that come from the world, and inputs of the
#: world that come from robots.
_WORLD = *OUTSIDE, "frames"
#: Fields of a run that do not affect how blocks are made. ``RunFacts`` provides
#: the values of a run that blocks need.
_NO_BLOCKS = {
    "name",
    "description",
    "engine",
    "seed",
    "duration_s",
    "arena_m",
    "obstacles",
    "stop",
    "robots",
    "sources",
    "wind",
    "odor",
}
#: Shared blocks by the values that they were made from, most recently used last.
_SHARED: dict[str, LoopBlocks] = {}
_MOST_SHARED = 64


class LoopBlocks:
    """The blocks of a robot by part, and the connections of their ports."""

    def __init__(self, blocks: Mapping[str, Any]) -> None:
        """Reads the ports of blocks, which need not be in a diagram.

        Raises:
            InputError: An input is not published by exactly one block or by the world.
        """
        require_published(blocks.values(), _WORLD)
        self.blocks = blocks
        self.sizes: dict[str, int] = {}
        """Number of elements of each port, by name."""
        self.objects: set[str] = set()
        """Names of the ports that carry objects instead of numbers."""
        self.inputs = {part: self._names(b, "input") for part, b in blocks.items()}
        """Names of the input ports of each part."""
        self.outputs = {part: self._names(b, "output") for part, b in blocks.items()}
        """Names of the output ports of each part."""
        self.columns = columns_of(blocks)
        """Columns of the log, in order, by (part, port)."""

    def _names(self, block: Any, kind: str) -> list[str]:
        port: Callable[[int], Any] = getattr(block, f"get_{kind}_port")
        ports = list(map(port, range(getattr(block, f"num_{kind}_ports")())))
        self.sizes |= {port.get_name(): port.size() for port in ports}
        self.objects |= {
            port.get_name()
            for port in ports
            if port.get_data_type() == PortDataType.kAbstractValued
        }
        return [port.get_name() for port in ports]

    @cached_property
    def outside(self) -> set[str]:
        """Names of the inputs that come from the world."""
        return {*self.sizes}.difference(*self.outputs.values())

    def steps(
        self, run: RunFacts
    ) -> tuple[dict[str, Step], Mapping[str, Callable[[int], Any]]]:
        """Returns the step of each part in a run.

        Args:
            run: Facts about the run.

        Returns:
            The steps, by part. Also, for each port that carries an object, a function
            that returns this object at a tick. Ports from outside are included.

        Raises:
            InputError: A user's own block has no step.
        """
        # A block that publishes an object precedes the blocks that read it.
        carried, found = {**run.carried}, dict[str, Step]()
        run = run._replace(carried=carried)
        waiting = [*self.blocks]
        while waiting:
            missing = {
                port
                for part in waiting
                for port in self.outputs[part]
                if port in self.objects
            }
            part = next(p for p in waiting if not missing.intersection(self.inputs[p]))
            waiting.remove(part)
            found[part] = _step_for(self.blocks[part], run)
            carried |= found[part].carries
        return {part: found[part] for part in self.blocks}, carried

    def order(self, steps: Mapping[str, Step]) -> tuple[list[str], list[str]]:
        """Orders the parts for a tick.

        The first list has the parts without state outputs, each after the parts whose
        outputs it reads. The second list has the parts whose outputs are part of their
        state.
        """
        late = [part for part, step in steps.items() if step.publish is not None]
        known = self.outside.union(*(self.outputs[part] for part in late))
        waiting, early = [part for part in self.blocks if part not in late], []
        while waiting:
            part = next(p for p in waiting if known.issuperset(self.inputs[p]))
            waiting.remove(part)
            early.append(part)
            known.update(self.outputs[part])
        return early, late


def _step_for(block: Any, run: RunFacts) -> Step:
    if not hasattr(block, "step_for"):
        raise InputError(
            "engine",
            f"{block.get_name()} has no method step_for, which a compiled loop "
            "needs; add this method, or run with engine drake",
        )
    step: Step = block.step_for(run)
    return step


def shared_blocks(scenario: Scenario) -> dict[str, LoopBlocks]:
    """Returns blocks for a compiled loop, and reuses blocks of earlier scenarios.

    Blocks are reused if the scenarios differ only in fields that do not affect the
    blocks, such as layout, start and seed. Reuse matters because Drake never frees
    blocks written in Python.

    Args:
        scenario: The scenario to run.

    Returns:
        Blocks of each robot.

    Raises:
        InputError: See ``robot_blocks``.
    """
    blocks = {}
    for name in scenario.robots:
        own = scenario.of_robot(name)
        bodies = len(scenario.surroundings(name).obstacles)
        target = scenario.target(name)
        others = [sound for sound in scenario.sounds() if sound != target]
        robots = scenario.robots_seen(name)
        made = partial(
            robot_blocks, own, name, bodies=bodies, robots=robots, others=others
        )
        if own.only.blocks:  # a user's block may depend on the whole scenario
            blocks[name] = LoopBlocks(made())
            continue
        made_from = _made_from(own)
        code = loaded_digests(own)
        key = f"{name} {bodies} {robots} {others} {code} {made_from}"
        blocks[name] = _shared(key, made)
    return blocks


def shared_world(scenario: Scenario) -> LoopBlocks | None:
    """Returns the blocks that all robots share, and reuses blocks of earlier scenarios.

    Args:
        scenario: The scenario to run.

    Returns:
        The blocks; None if no robot searches.
    """
    nodes = radio_nodes(scenario)
    if not nodes:
        return None
    made_from = scenario.model_dump_json(include={"wind", "odor", "radio", "tick_s"})
    made = partial(world_blocks, scenario, world_seeds(scenario))
    return _shared(f"{nodes} {made_from}", made)


def _shared(key: str, made: Callable[[], Mapping[str, Any]]) -> LoopBlocks:
    found = _SHARED.pop(key, None)
    if found is None:
        found = LoopBlocks(made())
    _SHARED[key] = found
    if len(_SHARED) > _MOST_SHARED:
        del _SHARED[next(iter(_SHARED))]
    return found


def _made_from(own: Scenario) -> str:
    """Returns the values of all fields that affect the blocks of the only robot.

    The goal does not affect them; ``RunFacts`` has the goal of the run.
    """
    robot = own.only
    if isinstance(robot, Router):
        route = robot.route.model_copy(update={"goal_m": (0.0, 0.0)})
        robot = robot.model_copy(update={"route": route})
    source = None if robot.has_goal else (own.source_size, own.source.sound)
    run = own.model_dump_json(exclude=_NO_BLOCKS)
    return f"{robot.model_dump_json(exclude={'start'})} {source} {run}"
