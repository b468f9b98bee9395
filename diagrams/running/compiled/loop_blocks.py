"""Makes the blocks of compiled loops, which runs with different layouts share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram, PortDataType

from diagrams.building.builder import audible_sounds, robot_of
from diagrams.building.robot import columns_of, make_source, make_world, parts_of
from diagrams.building.world_blocks import radio_nodes
from diagrams.scenario.own_versions import loaded_digests
from diagrams.scenario.participants import Router
from diagrams.scenario.scenario import Scenario
from systems.framework.block import RunFacts, Step
from systems.framework.input_error import InputError

#: Fields of a scenario that do not affect how blocks are made. If the step of a block
#: needs such a value, ``RunFacts`` provides it.
_NO_BLOCKS = {
    "name",
    "description",
    "engine",
    "seed",
    "duration_s",
    "arena_m",
    "obstacles",
    "world",
    "reference_path_m",
    "stop",
    "robots",
    "sources",
    "wind",
    "odor",
}
#: Shared blocks, by a text of the values from which they were made. The most recently
#: used blocks are last.
_SHARED: dict[str, LoopBlocks] = {}
_MOST_SHARED = 64

#: Key of a port: the part of its block, and the name of the port. For an input of the
#: whole diagram, the part is empty.
PortKey = tuple[str, str]


class LoopBlocks:
    """Contains the blocks of a diagram, and the connections of their ports.

    The key of each block is its part: its role in the diagram, such as ``plant``.

    Args:
        diagram: Diagram of a robot, a source or the world.
    """

    def __init__(self, diagram: Diagram) -> None:
        parts = parts_of(diagram)
        self.blocks = parts.blocks
        names = {block.get_name(): part for part, block in self.blocks.items()}
        connected = {
            (names[block.get_name()], int(index)): (names[source.get_name()], int(port))
            for (block, index), (source, port) in diagram.connection_map().items()
        }
        self.sizes: dict[PortKey, int] = {}
        """Number of elements of each output port, and of each input from outside."""
        self.objects: set[PortKey] = set()
        """The ports that carry objects instead of numbers."""
        self.inputs: dict[str, dict[str, PortKey]] = {}
        """For each part: the port that each input is connected to, by name."""
        self.outputs: dict[str, list[PortKey]] = {}
        """Output ports of each part."""
        self.columns = columns_of(self.blocks)
        """Columns of the log, in order, by (part, port)."""
        for part, block in self.blocks.items():
            ports = map(block.get_output_port, range(block.num_output_ports()))
            self.outputs[part] = [self._add(part, port) for port in ports]
        for part, block in self.blocks.items():
            self.inputs[part] = {}
            for index in range(block.num_input_ports()):
                port = block.get_input_port(index)
                if (part, index) in connected:
                    source, number = connected[part, index]
                    key = self.outputs[source][number]
                else:
                    key = self._add("", port)
                self.inputs[part][port.get_name()] = key

    def _add(self, part: str, port: Any) -> PortKey:
        key = part, port.get_name()
        self.sizes[key] = port.size()
        if port.get_data_type() == PortDataType.kAbstractValued:
            self.objects.add(key)
        return key

    def steps(
        self, run: RunFacts
    ) -> tuple[dict[str, Step], dict[PortKey, Callable[[int], Any]]]:
        """Returns the steps of the blocks in a run, and the objects on their ports.

        Most ports carry numbers, but some ports carry objects such as sound.

        Args:
            run: Facts about the run, such as seed and initial pose.

        Returns:
            Two mappings. The first has the step of each block, by part (role of the
            block). The second has one function for each port or input of the diagram
            that carries an object. The function returns the object at a tick (control
            period).

        Raises:
            InputError: A user's own block has no step.
        """
        carried = {("", port): function for port, function in run.carried.items()}
        found: dict[str, Step] = {}
        # A block that publishes an object precedes the blocks that read it.
        for part in self._ordered(self.blocks, self.objects):
            inputs = self.inputs[part].items()
            own = {name: carried[key] for name, key in inputs if key in carried}
            found[part] = _step_for(self.blocks[part], run._replace(carried=own))
            carried |= {
                (part, port): function for port, function in found[part].carries.items()
            }
        return {part: found[part] for part in self.blocks}, carried

    def order(self, steps: Mapping[str, Step]) -> tuple[list[str], list[str]]:
        """Returns the order in which the blocks compute their steps in a tick.

        A tick is a control period.

        Args:
            steps: Step of each block, by part (role of the block, such as ``plant``).

        Returns:
            Two lists of parts. The first has the blocks whose outputs depend on present
            inputs, each after the blocks whose outputs it reads. The second has the
            blocks whose outputs depend only on their state.
        """
        late = [part for part, step in steps.items() if step.publish is not None]
        early = [part for part in self.blocks if part not in late]
        return self._ordered(early, self.sizes), late

    def _ordered(self, parts: Iterable[str], ports: Iterable[PortKey]) -> list[str]:
        """Orders parts: each follows those parts whose ``ports`` it reads."""
        waiting, ports, done = [*parts], {*ports}, list[str]()
        while waiting:
            missing = {key for part in waiting for key in self.outputs[part]} & ports
            part = next(
                p for p in waiting if missing.isdisjoint(self.inputs[p].values())
            )
            waiting.remove(part)
            done.append(part)
        return done


class LoopDiagram:
    """Contains the blocks of a diagram in one run, with their steps and port values.

    Args:
        made: The blocks and their connections.
        run: Facts about the run, such as seed and initial pose.
        shared: Arrays with the values of those ports that another diagram also uses.
    """

    def __init__(
        self,
        made: LoopBlocks,
        run: RunFacts,
        shared: Mapping[PortKey, NDArray[np.float64]],
    ) -> None:
        self.made, (self.steps, self.carried) = made, made.steps(run)
        self.values = {key: np.zeros(size) for key, size in made.sizes.items()} | {
            key: values for key, values in shared.items() if key in made.sizes
        }
        """Values of the ports."""
        self.published = {
            port: (part, port) for part, port in reversed(made.sizes) if part
        }
        """Keys of the output ports, by name."""

    def output(self, port: str, tick: int = 0) -> Any:
        """Returns the values of an output port, or the object that the port carries.

        ``port`` is the name of the port. ``tick`` is the number of the present tick
        (control period), which matters only for an object. The result is None if there
        is no such port.
        """
        key = self.published.get(port)
        if key in self.made.objects:
            return self.carried[key](tick) if key in self.carried else None
        return None if key is None else self.values[key]


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
    """Returns the blocks of all robots for a compiled loop.

    The function reuses the blocks of an earlier scenario where possible. The earlier
    scenario may differ in fields that do not affect the blocks, such as start pose and
    seed. Reuse matters because Drake never frees blocks written in Python.

    Args:
        scenario: The scenario to run.

    Returns:
        Blocks of each robot, by name of the robot.

    Raises:
        InputError: The blocks of a robot cannot be made, see ``make_robot``.
    """
    blocks = {}
    for name in scenario.robots:
        own, made = scenario.of_robot(name), partial(robot_of, scenario, name)
        if own.only.blocks:  # a user's block may depend on the whole scenario
            blocks[name] = LoopBlocks(made())
            continue
        owners = scenario.surroundings(name).owners
        target = scenario.target(name)
        others = [sound for sound in scenario.sounds() if sound != target]
        robots = scenario.robots_seen(name)
        made_from, code = _made_from(own), loaded_digests(own)
        heard = name in audible_sounds(scenario), scenario.longest_frame_s
        key = f"{name} {owners} {robots} {others} {heard} {code} {made_from}"
        blocks[name] = _shared(key, made)
    return blocks


def shared_sources(scenario: Scenario) -> dict[str, LoopBlocks]:
    """Returns the blocks of all sources that a robot hears as sound waves.

    The keys are the names of the sources. The function reuses the blocks of earlier
    scenarios where possible. If a sound file cannot be played, it raises an
    ``InputError``.
    """
    air = f"{scenario.sound_speed_m_s} {scenario.room}"
    blocks = {}
    for name, sound in audible_sounds(scenario).items():
        source = scenario.sources.get(name)
        if source is not None:
            made = partial(make_source, scenario, name, source, audible=True)
            times = f"{scenario.longest_frame_s} {scenario.tick_s}"
            key = f"{name} {sound.model_dump_json()} {air} {times}"
            blocks[name] = _shared(key, made)
    return blocks


def shared_world(scenario: Scenario) -> LoopBlocks | None:
    """Returns the blocks that all robots share, such as radio and wind.

    The function reuses the blocks of earlier scenarios where possible. The result is
    None if no robot searches.
    """
    nodes = radio_nodes(scenario)
    if not nodes:
        return None
    made_from = scenario.model_dump_json(include={"wind", "odor", "radio", "tick_s"})
    return _shared(f"{nodes} {made_from}", partial(make_world, scenario))


def _shared(key: str, made: Callable[[], Any]) -> LoopBlocks:
    found = _SHARED.pop(key, None)
    if found is None:
        found = LoopBlocks(made())
    _SHARED[key] = found
    if len(_SHARED) > _MOST_SHARED:
        del _SHARED[next(iter(_SHARED))]
    return found


def _made_from(own: Scenario) -> str:
    """Returns a text of all field values that affect the blocks of the only robot.

    The goal of a route does not affect the blocks, because the steps receive it through
    ``RunFacts``.
    """
    robot = own.only
    if isinstance(robot, Router):
        route = robot.route.model_copy(update={"goal_m": (0.0, 0.0)})
        robot = robot.model_copy(update={"route": route})
    source = None if robot.has_goal else (own.source_size, own.source.sound)
    run = own.model_dump_json(exclude=_NO_BLOCKS)
    return f"{robot.model_dump_json(exclude={'start'})} {source} {run}"
