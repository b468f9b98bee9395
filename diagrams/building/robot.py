"""One robot, and one source, as a diagram of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any
from zlib import crc32

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, Multiplexer, VectorLogSink

from diagrams.building.laws import commanded, make_command, make_controller
from diagrams.building.own_blocks import with_own_blocks
from diagrams.building.robots.following_robot import following_blocks
from diagrams.building.robots.routed_robot import routed_blocks, trajectory_command
from diagrams.building.robots.searching_robot import search_command, searching_blocks
from diagrams.building.world_blocks import world_blocks
from diagrams.scenario.participants import SourceParameters
from diagrams.scenario.scenario import ROBOT, SOURCE, WORLD, Scenario
from systems import (
    DiffDrivePlant,
    MotionGuard,
    SoundEmitter,
    SourceRobot,
    WheelOdometry,
)
from systems.framework.block import Block, part_of
from systems.framework.input_error import InputError
from systems.framework.signals import TICK_S
from systems.laws.impedance_controller import LAW_COLUMNS
from systems.sound.mic_array import microphone_reach
from systems.sound.parameters import SoundParameters

#: What a robot takes from the world around it; of emissions, all.
OUTSIDE = "pose_WS", "poses_WO", "sizes", "emission", "wind", "plume", "air"


@dataclass(frozen=True)
class Parts:
    """What a robot's or a source's diagram is made of."""

    diagram: Diagram
    blocks: Mapping[str, Any]
    """Blocks by part, as ``plant``."""
    log: VectorLogSink | None = None
    """Rows of the logged ports, one after the other; none unless asked for."""
    logged: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)
    """What the log holds, in order: the columns of each (part, port)."""

    def port(self, part: str, name: str) -> Any:
        """Output port of a block.

        Args:
            part: A key of ``blocks``.
            name: Of the port.

        Returns:
            The port; its value is read in the block's own context.
        """
        return self.blocks[part].GetOutputPort(name)


def parts_of(diagram: Diagram) -> Parts:
    """The parts of what ``make_robot`` or ``make_source`` has made."""
    log, blocks, logged = None, {}, {}
    for system in diagram.GetSystems():
        if isinstance(system, VectorLogSink):
            log = system
        elif not isinstance(system, Multiplexer):
            blocks[part_of(system)] = system
    if log is not None:
        logged = columns_of(blocks)
    return Parts(diagram, blocks, log, logged)


def columns_of(blocks: Mapping[str, Any]) -> dict[tuple[str, str], tuple[str, ...]]:
    """What a log of a robot holds, in order.

    Args:
        blocks: Of the robot, by part.

    Returns:
        The columns of each (part, port).
    """
    return {
        (part, port): names
        for part, block in blocks.items()
        for port, names in _columns(block).items()
    }


def publishes_state(block: Any, port: str) -> bool:
    """Whether an output of a block is part of its state: what its last update made.

    Args:
        block: Of a robot or the world.
        port: Name of its output.

    Returns:
        False where it is made of the present inputs, or moves between ticks.
    """
    if block.num_continuous_states():
        return False
    if isinstance(block, Block) and hasattr(block, "step"):
        return block.step.publish is not None
    if not (block.num_discrete_state_groups() or block.num_abstract_states()):
        return False
    return not block.HasDirectFeedthrough(block.GetOutputPort(port).get_index())


def block_seed(seed: int, name: str) -> int:
    """A block's own seed: depends on the scenario's seed and its name alone.

    Args:
        seed: Of the scenario.
        name: Of the block.

    Returns:
        A whole number from 0 to 2^64 - 1.
    """
    sequence = np.random.SeedSequence([seed, crc32(name.encode())])
    return int(sequence.generate_state(1, np.uint64)[0])


def seed_of(scenario: Scenario, block: str, owner: str) -> int:
    """The seed of a block; of the only robot or source it is that of the block.

    Args:
        scenario: The run.
        block: Name of the block.
        owner: Name of the robot or source that has it.

    Returns:
        As ``block_seed``.
    """
    name = block if owner in (ROBOT, SOURCE) else f"{block}_{owner}"
    return block_seed(scenario.seed, name)


def world_seeds(scenario: Scenario) -> dict[str, int]:
    """Seeds of the blocks that all robots share, by name.

    Args:
        scenario: The run.
    """
    names = "wind_field", "odor_plume", "radio_channel"
    return {name: block_seed(scenario.seed, name) for name in names}


def robot_blocks(
    scenario: Scenario,
    name: str = ROBOT,
    *,
    bodies: int = 0,
    robots: Sequence[int] = (),
    others: Sequence[str] = (),
) -> dict[str, Any]:
    """The blocks of a robot by part, a user's own among them.

    Args:
        scenario: Of this robot alone, see ``Scenario.of_robot``.
        name: Of the robot; its random numbers depend on it.
        bodies: Number of bodies on ``poses_WO`` and ``sizes``.
        robots: Numbers of those that are robots.
        others: Names of the sources that are not followed.

    Returns:
        As a diagram needs them, not yet in one.

    Raises:
        InputError: As ``make_robot``.
    """
    own_seed = partial(seed_of, scenario, owner=name)
    seed = own_seed("controller")
    controller = make_controller(scenario, bodies=bodies, seed=seed)
    if scenario.searches is not None:
        sensing = searching_blocks(
            scenario,
            bodies=bodies,
            others=others,
            seed_of=own_seed,
        )
    elif scenario.route is None:
        sensing = following_blocks(
            scenario, controller, bodies=bodies, others=others, seed_of=own_seed
        )
    else:
        with _fields_of_robot(name):
            sensing = routed_blocks(
                scenario,
                bodies=bodies,
                robots=robots,
                seed_of=own_seed,
            )
    ours = [
        DiffDrivePlant(
            robot=scenario.robot, plant=scenario.plant, initial_pose=scenario.start.pose
        ),
        WheelOdometry(
            robot=scenario.robot,
            odometry=scenario.odometry,
            plant=scenario.plant,
            initial_pose=scenario.start.pose,
            tick_s=scenario.tick_s,
        ),
        *sensing,
        controller,
        _driving(scenario, controller),
    ]
    return with_own_blocks(
        {part_of(block): block for block in ours},
        scenario.blocks,
        {
            "scenario": scenario,
            "robot": scenario.robot,
            "bodies": bodies,
            "tick_s": scenario.tick_s,
            "seed": seed_of(scenario, "own_block", name),
        },
    )


def make_robot(
    scenario: Scenario,
    name: str = ROBOT,
    *,
    bodies: int = 0,
    robots: Sequence[int] = (),
    others: Sequence[str] = (),
    listeners_frame_s: float = TICK_S,
    log: bool = False,
) -> Diagram:
    """A robot that follows a sound, as a diagram with ports of its own.

    The same function builds every fidelity: ``hearing`` and
    ``obstacle_sensing`` choose blocks with the same ports. Inside, every input is
    joined to the one output of its name (see docs/model.md). With both ideal and
    ``odometry.rounding`` off the diagram converts to AutoDiffXd.

    Input ports, as far as its blocks need them: ``pose_WS`` of what it follows,
    ``poses_WO`` and ``sizes`` of the other bodies, ``emission`` of what it follows,
    ``emission_<name>`` of each other source, and ``wind``, ``plume`` and ``air`` of
    the world. Output ports: ``pose_WB``, ``velocity_WB``, with a loudspeaker
    ``own_emission``, and of one that searches ``frames``.

    Args:
        scenario: Of this robot alone, see ``Scenario.of_robot``.
        name: Of the robot; its random numbers depend on it.
        bodies: Number of bodies on ``poses_WO`` and ``sizes``.
        robots: Numbers of those that are robots.
        others: Names of the sources that are not followed.
        listeners_frame_s: Longest frame of those that hear its loudspeaker, s.
        log: Whether to log what its blocks name columns for, at every tick.

    Returns:
        The diagram; ``parts_of`` gives its blocks by what they are for.

    Raises:
        InputError: The law is not known, or a sound file cannot be played.
    """
    by_part = robot_blocks(scenario, name, bodies=bodies, robots=robots, others=others)
    blocks, plant = [*by_part.values()], by_part["plant"]
    builder = DiagramBuilder()
    for block in blocks:
        builder.AddNamedSystem(block.get_name(), block)
    connect_by_name(builder, blocks, OUTSIDE)
    for port in ("pose_WB", "velocity_WB"):
        builder.ExportOutput(plant.GetOutputPort(port), port)
    if scenario.searches is not None:
        builder.ExportOutput(by_part["controller"].GetOutputPort("frames"), "frames")
    if scenario.loudspeaker is not None:
        calls = scenario.searches == "odor"
        emitter = _emitter(
            scenario, name, scenario.loudspeaker, listeners_frame_s, called=calls
        )
        _carry_loudspeaker(builder, emitter, plant)
        if calls:
            calling = by_part["controller"].GetOutputPort("calling")
            builder.Connect(calling, emitter.GetInputPort("calling"))
    if log:
        _add_log(builder, blocks, scenario.tick_s)
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram


def make_world(scenario: Scenario, *, log: bool = False) -> Diagram | None:
    """What all robots share, as a diagram with ports of its own.

    Input ports: ``frames_<name>`` of each robot that searches. Output ports: what its
    blocks put out, ``air`` among it.

    Args:
        scenario: The run.
        log: Whether to log what its blocks name columns for, at every tick.

    Returns:
        The diagram; none where no robot searches.
    """
    blocks = [*world_blocks(scenario, world_seeds(scenario)).values()]
    if not blocks:
        return None
    builder = DiagramBuilder()
    for block in blocks:
        builder.AddNamedSystem(block.get_name(), block)
    connect_by_name(builder, blocks, ("frames",))
    for block in blocks:
        for index in range(block.num_output_ports()):
            port = block.get_output_port(index)
            if port.get_name() in OUTSIDE:
                builder.ExportOutput(port, port.get_name())
    if log:
        _add_log(builder, blocks, scenario.tick_s)
    diagram = builder.Build()
    diagram.set_name(WORLD)
    return diagram


def make_source(
    scenario: Scenario, name: str, source: SourceParameters, *, audible: bool
) -> Diagram:
    """A source, driven along its waypoints, as a diagram with ports of its own.

    Output ports: ``pose_WS``, ``v_WS``, and ``emission`` where it is audible.

    Args:
        scenario: For the seed, the air and the room.
        name: Of the source; its random numbers depend on it.
        source: Its path, drive and sound.
        audible: Whether anybody hears its sound as waves.

    Returns:
        The diagram; its name is that of the source.

    Raises:
        InputError: Its sound file cannot be played.
    """
    robot = SourceRobot(source=source)
    blocks: list[Any] = [robot]
    if audible:
        blocks.append(_emitter(scenario, name, source.sound, scenario.longest_frame_s))
    builder = DiagramBuilder()
    for block in blocks:
        builder.AddNamedSystem(block.get_name(), block)
    connect_by_name(builder, blocks)
    for block in blocks:
        for index in range(block.num_output_ports()):
            port = block.get_output_port(index)
            builder.ExportOutput(port, port.get_name())
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram


def _emitter(
    scenario: Scenario,
    name: str,
    sound: SoundParameters,
    frame_s: float,
    *,
    called: bool = False,
) -> SoundEmitter:
    with naming_sounds(scenario, name, sound):
        return SoundEmitter(
            sound=sound,
            acoustics=scenario.acoustics,
            maximum_range_m=microphone_reach(scenario.room, scenario.acoustics),
            frame_s=frame_s,
            tick_s=scenario.tick_s,
            seed=seed_of(scenario, "sound_emitter", name),
            called=called,
        )


@contextmanager
def _fields_of_robot(name: str) -> Iterator[None]:
    """Errors of a route name the robot's field in the scenario."""
    try:
        yield
    except InputError as error:
        if name == ROBOT or not error.field.startswith(("route.", "start.")):
            raise
        raise InputError(f"robots.{name}.{error.field}", error.message) from None


@contextmanager
def naming_sounds(
    scenario: Scenario, name: str, sound: SoundParameters
) -> Iterator[None]:
    """Errors of a sound name its field in the scenario.

    Args:
        scenario: Has the sound.
        name: Of the source or robot that plays it.
        sound: What is played.

    Yields:
        Nothing.

    Raises:
        InputError: The sound cannot be played.
    """
    try:
        yield
    except InputError as error:
        if not error.field.startswith("sound."):
            raise
        field = error.field.removeprefix("sound.")
        if name in scenario.sources:
            group = f"sources.{name}.sound."
        elif scenario.loudspeaker is sound:
            group = f"robots.{name}.loudspeaker."
        else:
            group = "sound."
        raise InputError(f"{group}{field}", error.message) from None


def _carry_loudspeaker(builder: DiagramBuilder, emitter: Any, plant: Any) -> None:
    """The robot's own loudspeaker stands where the robot is: W's S is its B."""
    builder.AddNamedSystem(emitter.get_name(), emitter)
    for output, entry in (("pose_WB", "pose_WS"), ("velocity_WB", "v_WS")):
        builder.Connect(plant.GetOutputPort(output), emitter.GetInputPort(entry))
    builder.ExportOutput(emitter.GetOutputPort("emission"), "own_emission")


def _driving(scenario: Scenario, controller: Any) -> Any:
    """What drives the wheels as the law commands, as far as a guard lets it."""
    if scenario.searches is not None:
        return search_command(scenario)
    if scenario.route is not None:
        filtering = trajectory_command(scenario)
        if filtering is not None:
            return filtering
    if scenario.own_guard is None:
        return make_command(controller, scenario.robot, scenario.tick_s)
    return MotionGuard(
        parameters=scenario.own_guard,
        known=scenario.free_space,
        robot=scenario.robot,
        plant=scenario.plant,
        command=commanded(controller),
        tick_s=scenario.tick_s,
    )


def connect_by_name(
    builder: DiagramBuilder, blocks: Sequence[Any], outside: Sequence[str] = ()
) -> None:
    """Joins every input port to the one output port of the same name.

    A quantity has one name on every port (see docs/model.md), so the wiring
    needs no list.

    Args:
        builder: That of the robot or source, which has the blocks.
        blocks: Its blocks.
        outside: Quantities that come from elsewhere: they become its own inputs; a
            name that goes on after one of these and an underscore, too.

    Raises:
        InputError: More than one block publishes a quantity, or none, and it does
            not come from elsewhere.
    """
    outputs = require_published(blocks, outside)
    entries: dict[str, Any] = {}
    for block in blocks:
        for index in range(block.num_input_ports()):
            port = block.get_input_port(index)
            name = port.get_name()
            if name in outputs:
                builder.Connect(outputs[name], port)
            elif name not in entries:
                entries[name] = builder.ExportInput(port, name)
            else:
                builder.ConnectInput(entries[name], port)


def require_published(blocks: Iterable[Any], outside: Sequence[str]) -> dict[str, Any]:
    """Refuses blocks whose inputs are not published, or more than once.

    Args:
        blocks: Of a robot or a source.
        outside: As of ``connect_by_name``.

    Returns:
        Their output ports by name.

    Raises:
        InputError: Names the block and what it needs.
    """
    blocks, outputs, counts = list(blocks), {}, Counter[str]()
    for block in blocks:
        for index in range(block.num_output_ports()):
            port = block.get_output_port(index)
            outputs[port.get_name()] = port
            counts[port.get_name()] += 1
    for block in blocks:
        for index in range(block.num_input_ports()):
            name = block.get_input_port(index).get_name()
            given = any(f"{name}_".startswith(f"{each}_") for each in outside)
            if counts[name] != 1 and (counts[name] or not given):
                raise InputError(
                    block.get_name(),
                    f"{counts[name]} blocks publish {name!r}, which it needs; "
                    "give exactly one block an output port of that name",
                )
    return outputs


def _columns(block: Any) -> dict[str, tuple[str, ...]]:
    """Output ports of a block that have columns, of a user's own as far as it has."""
    columns = getattr(block, "columns", None) or LAW_COLUMNS
    ports = {
        port.get_name(): port.size()
        for port in map(block.get_output_port, range(block.num_output_ports()))
    }
    return {
        name: names for name, names in columns.items() if ports.get(name) == len(names)
    }


def _add_log(builder: DiagramBuilder, blocks: Sequence[Any], tick_s: float) -> None:
    """One sink behind a multiplexer: a third cheaper than a sink a port."""
    ports = [block.GetOutputPort(name) for block in blocks for name in _columns(block)]
    joined = multiplexed(builder, "log_multiplexer", ports)
    LogVectorOutput(joined, builder, publish_period=tick_s).set_name("log")


def multiplexed(builder: DiagramBuilder, name: str, ports: Sequence[Any]) -> Any:
    """One output port with the values of several, one after the other.

    Args:
        builder: That of the diagram.
        name: Of the block that joins them.
        ports: Output ports of vectors.

    Returns:
        The port.
    """
    block = builder.AddNamedSystem(name, Multiplexer([port.size() for port in ports]))
    for index, port in enumerate(ports):
        builder.Connect(port, block.get_input_port(index))
    return block.get_output_port(0)
