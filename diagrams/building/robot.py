"""Builds the diagrams of one robot, of one source, and of the world."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
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
from diagrams.building.signals import Signal, signal_sources
from diagrams.building.world_blocks import world_blocks
from diagrams.scenario.participants import Follower, Router, SourceParameters
from diagrams.scenario.scenario import WORLD, Scenario
from diagrams.scenario.shorthand import ROBOT, SOURCE, fields_of
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

#: Inputs of a robot that come from outside of its diagram. ``emission`` also stands for
#: all inputs ``emission_<name>``.
OUTSIDE = "pose_WS", "poses_WO", "sizes", "emission", "wind", "plume", "air"

#: Outputs of a robot that a live view shows, see ``make_robot``.
SHOWN = "echo", "p_WS_estimated", "target_state", "target_valid"


@dataclass(frozen=True)
class Parts:
    """The parts of a robot's or a source's diagram."""

    diagram: Diagram
    blocks: Mapping[str, Any]
    """Blocks by part, for example ``plant``."""
    log: VectorLogSink | None = None
    """Log with the values of all logged ports; None if the diagram has no log."""
    logged: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)
    """Columns of the log by (part, port), in order."""

    def port(self, part: str, name: str) -> Any:
        """Returns an output port of a block.

        ``part`` is a key of ``blocks``: the role of the block, such as ``plant``.
        ``name`` is the name of the port. To evaluate the port, use the context of its
        block.
        """
        return self.blocks[part].GetOutputPort(name)


def parts_of(diagram: Diagram) -> Parts:
    """Returns the parts of a diagram of a robot, a source or the world."""
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
    """Returns the names of the columns in the log of a robot, in order.

    The keys of ``blocks`` are parts; a part is the role of a block, such as ``plant``.
    The keys of the result are pairs of a part and the name of an output port.
    """
    return {
        (part, port): names
        for part, block in blocks.items()
        for port, names in _columns(block).items()
    }


def publishes_state(block: Any, port: str) -> bool:
    """Whether an output port contains exactly what the block's last update computed.

    The answer is False if the output depends on the present inputs, or if it changes
    between updates.
    """
    if block.num_continuous_states():
        return False
    if isinstance(block, Block) and hasattr(block, "step"):
        return block.step.publish is not None
    if not (block.num_discrete_state_groups() or block.num_abstract_states()):
        return False
    return not block.HasDirectFeedthrough(block.GetOutputPort(port).get_index())


def block_seed(seed: int, name: str) -> int:
    """Computes the seed of a block from the scenario's seed and the block's name.

    The result is a whole number from 0 to 2^64 - 1.
    """
    sequence = np.random.SeedSequence([seed, crc32(name.encode())])
    return int(sequence.generate_state(1, np.uint64)[0])


def seed_of(scenario: Scenario, block: str, owner: str) -> int:
    """Returns the random seed of a block that belongs to a robot or source.

    The seed depends on the names of the block and of its owner. An owner with the
    default name ``robot`` or ``source`` does not affect the seed.

    Args:
        scenario: Scenario with the seed of the run.
        block: Name of the block.
        owner: Name of the robot or source to which the block belongs.

    Returns:
        The seed, see ``block_seed``.
    """
    name = block if owner in (ROBOT, SOURCE) else f"{block}_{owner}"
    return block_seed(scenario.seed, name)


def world_seeds(scenario: Scenario) -> dict[str, int]:
    """Returns the random seed of each block that all robots share, by block name."""
    names = "wind_field", "odor_plume", "radio_channel"
    return {name: block_seed(scenario.seed, name) for name in names}


def robot_blocks(
    scenario: Scenario,
    name: str = ROBOT,
    *,
    owners: Sequence[int] = (),
    robots: Sequence[int] = (),
    others: Sequence[str] = (),
) -> dict[str, Any]:
    """Makes the blocks of a robot, including a user's own blocks.

    Args:
        scenario: Scenario of this robot alone, see ``Scenario.of_robot``.
        name: Name of the robot. The random numbers of the robot depend on its name.
        owners: Number of the body of each rectangle in the inputs ``poses_WO`` and
            ``sizes``, ascending from 0.
        robots: Numbers of those bodies that are robots.
        others: Names of the sources and loudspeakers that the robot does not follow.

    Returns:
        Blocks by part, which is the role of a block, such as ``plant``. They are not
        yet in a diagram.

    Raises:
        InputError: The law is not known, or a block cannot be made.
    """
    robot, own_seed = scenario.only, partial(seed_of, scenario, owner=name)
    seed = own_seed("controller")
    controller = make_controller(scenario, bodies=len(owners), seed=seed)
    if robot.searches is not None:
        sensing = searching_blocks(
            scenario,
            owners=owners,
            others=others,
            seed_of=own_seed,
        )
    elif isinstance(robot, Follower):
        sensing = following_blocks(
            scenario, controller, owners=owners, others=others, seed_of=own_seed
        )
    else:
        with fields_of("robots", name):
            sensing = routed_blocks(
                scenario, owners=owners, robots=robots, seed_of=own_seed
            )
    ours = [
        DiffDrivePlant(
            robot=robot.robot, plant=robot.plant, initial_pose=robot.start.pose
        ),
        WheelOdometry(
            robot=robot.robot,
            faults=robot.faults,
            plant=robot.plant,
            initial_pose=robot.start.pose,
            tick_s=scenario.tick_s,
        ),
        *sensing,
        controller,
        _driving(scenario, controller),
    ]
    return with_own_blocks(
        {part_of(block): block for block in ours},
        robot,
        {
            "scenario": scenario,
            "robot": robot.robot,
            "bodies": len(owners),
            "tick_s": scenario.tick_s,
            "seed": seed_of(scenario, "own_block", name),
        },
    )


def make_robot(
    scenario: Scenario,
    name: str = ROBOT,
    *,
    owners: Sequence[int] = (),
    robots: Sequence[int] = (),
    others: Sequence[str] = (),
    listeners_frame_s: float = TICK_S,
    log: bool = False,
    signals: Mapping[str, Signal] | None = None,
) -> Diagram:
    """Builds the diagram of a robot.

    The fields ``hearing`` and ``obstacle_sensing`` select simulated or ideal sensors.
    Both kinds of blocks have the same ports. If both are ideal and
    ``plant.pulses_per_revolution`` is null, Drake can convert the diagram to
    AutoDiffXd. Each input of a block connects to the only output with the same name
    (see docs/model.md).

    The diagram has each of the following inputs only if one of its blocks needs it:

    - ``pose_WS`` and ``emission`` of the target
    - ``poses_WO`` and ``sizes`` of the other bodies
    - ``emission_<name>`` of each other source
    - ``wind``, ``plume`` and ``air`` of the world

    The outputs are ``pose_WB`` and ``velocity_WB``, and those of ``echo``,
    ``p_WS_estimated``, ``target_state`` and ``target_valid`` that a block publishes. A
    robot with a loudspeaker also has ``own_emission``. A robot that searches also has
    ``frames``.

    Args:
        scenario: Scenario of this robot alone, see ``Scenario.of_robot``.
        name: Name of the robot. The random numbers of the robot depend on its name.
        owners: Number of the body of each rectangle in the inputs ``poses_WO`` and
            ``sizes``, ascending from 0.
        robots: Numbers of those bodies that are robots.
        others: Names of the sources and loudspeakers that the robot does not follow.
        listeners_frame_s: Longest audio frame of the robots that hear the loudspeaker,
            s.
        log: Whether the diagram logs the columns of its blocks at every tick (control
            period).
        signals: Signals that replace quantities of the robot, by name of the quantity,
            see ``signal_sources``.

    Returns:
        The diagram. ``parts_of`` returns its blocks by part (role of the block).

    Raises:
        InputError: The law is not known, or a sound file cannot be played.
    """
    by_part = robot_blocks(scenario, name, owners=owners, robots=robots, others=others)
    blocks, plant = [*by_part.values()], by_part["plant"]
    given = signal_sources(blocks, signals or {}, scenario.tick_s)
    # The log keeps the last of several columns of the same name, that of the signal.
    blocks += given
    builder = DiagramBuilder()
    for block in blocks:
        builder.AddNamedSystem(block.get_name(), block)
    connect_by_name(builder, blocks, OUTSIDE, given)
    for port in ("pose_WB", "velocity_WB"):
        builder.ExportOutput(plant.GetOutputPort(port), port)
    for port in SHOWN:
        publishers = [block for block in blocks if block.HasOutputPort(port)]
        if len(publishers) == 1:
            builder.ExportOutput(publishers[0].GetOutputPort(port), port)
    robot = scenario.only
    if robot.searches is not None:
        builder.ExportOutput(by_part["controller"].GetOutputPort("frames"), "frames")
    if robot.loudspeaker is not None:
        calls = robot.searches == "odor"
        with fields_of("robots", name, sound="loudspeaker"):
            emitter = _emitter(
                scenario, name, robot.loudspeaker, listeners_frame_s, called=calls
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
    """Builds the diagram of the blocks that all robots share, such as the radio.

    The inputs of the diagram are ``frames_<name>`` of each searching robot. Its outputs
    are the ports that robots need, for example ``air``.

    Args:
        scenario: Scenario with all robots.
        log: Whether the diagram logs the columns of its blocks at every tick (control
            period).

    Returns:
        The diagram, or None if no robot searches.
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
    """Builds the diagram of a sound source that moves along its waypoints.

    The outputs of the diagram are ``pose_WS`` and ``v_WS``. The diagram of an audible
    source also has the output ``emission``.

    Args:
        scenario: Scenario with the seed, the speed of sound and the room.
        name: Name of the source and of the diagram. The random numbers of the source
            depend on it.
        source: Path, drive and sound of the source.
        audible: Whether a robot hears the sound as waves.

    Returns:
        The diagram.

    Raises:
        InputError: The sound file of the source cannot be played.
    """
    robot = SourceRobot(source=source)
    blocks: list[Any] = [robot]
    if audible:
        with fields_of("sources", name):
            frame_s = scenario.longest_frame_s
            blocks.append(_emitter(scenario, name, source.sound, frame_s))
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
    return SoundEmitter(
        sound=sound,
        sound_speed_m_s=scenario.sound_speed_m_s,
        maximum_range_m=microphone_reach(scenario.room, scenario.sound_speed_m_s),
        frame_s=frame_s,
        tick_s=scenario.tick_s,
        seed=seed_of(scenario, "sound_emitter", name),
        called=called,
    )


def _carry_loudspeaker(builder: DiagramBuilder, emitter: Any, plant: Any) -> None:
    """Attaches the loudspeaker to the robot: frame S is the robot's frame B."""
    builder.AddNamedSystem(emitter.get_name(), emitter)
    for output, entry in (("pose_WB", "pose_WS"), ("velocity_WB", "v_WS")):
        builder.Connect(plant.GetOutputPort(output), emitter.GetInputPort(entry))
    builder.ExportOutput(emitter.GetOutputPort("emission"), "own_emission")


def _driving(scenario: Scenario, controller: Any) -> Any:
    """Makes the block that drives the wheels, with a guard or safety filter if set."""
    robot = scenario.only
    if robot.searches is not None:
        return search_command(scenario)
    if isinstance(robot, Router):
        filtering = trajectory_command(scenario)
        if filtering is not None:
            return filtering
    if not isinstance(robot, Follower) or robot.own_guard is None:
        return make_command(controller, robot.robot, scenario.tick_s)
    return MotionGuard(
        parameters=robot.own_guard,
        robot=robot.robot,
        plant=robot.plant,
        command=commanded(controller),
        tick_s=scenario.tick_s,
    )


def connect_by_name(
    builder: DiagramBuilder,
    blocks: Sequence[Any],
    outside: Sequence[str] = (),
    replacing: Sequence[Any] = (),
) -> None:
    """Connects each input port of the blocks to the only output port of the same name.

    Each quantity has the same name on all ports (see docs/model.md). Therefore no list
    of connections is necessary.

    Args:
        builder: Builder that already contains the blocks.
        blocks: Blocks to connect.
        outside: Names of quantities that become inputs of the diagram. The name
            ``emission``, for example, also selects all inputs whose names begin with
            ``emission_``.
        replacing: Blocks whose outputs replace other outputs of the same name.

    Raises:
        InputError: Several blocks publish a quantity that a block needs.
        InputError: No block publishes a quantity that a block needs, and ``outside``
            does not name it.
    """
    outputs, counts = dict[str, Any](), Counter[str]()
    for block in blocks:
        for index in range(block.num_output_ports()):
            port = block.get_output_port(index)
            outputs[port.get_name()] = port
            counts[port.get_name()] += 1
    for block in replacing:
        port = block.get_output_port(0)
        outputs[port.get_name()], counts[port.get_name()] = port, 1
    entries: dict[str, Any] = {}
    for block in blocks:
        for index in range(block.num_input_ports()):
            port = block.get_input_port(index)
            name = port.get_name()
            given = any(f"{name}_".startswith(f"{each}_") for each in outside)
            if counts[name] != 1 and (counts[name] or not given):
                raise InputError(
                    block.get_name(),
                    f"{counts[name]} blocks publish {name!r}, which it needs; "
                    "give exactly one block an output port of that name",
                )
            if name in outputs:
                builder.Connect(outputs[name], port)
            elif name not in entries:
                entries[name] = builder.ExportInput(port, name)
            else:
                builder.ConnectInput(entries[name], port)


def _columns(block: Any) -> dict[str, tuple[str, ...]]:
    """Returns the names of the columns of a block's output ports, by port.

    A user's block without the attribute ``columns`` has the columns ``LAW_COLUMNS``.
    The result omits ports whose number of elements differs from the number of their
    columns.
    """
    columns = getattr(block, "columns", None) or LAW_COLUMNS
    ports = {
        port.get_name(): port.size()
        for port in map(block.get_output_port, range(block.num_output_ports()))
    }
    return {
        name: names for name, names in columns.items() if ports.get(name) == len(names)
    }


def _add_log(builder: DiagramBuilder, blocks: Sequence[Any], tick_s: float) -> None:
    """Adds one log for all ports of the blocks, behind a multiplexer.

    One log takes a third less time than one log per port.
    """
    ports = [block.GetOutputPort(name) for block in blocks for name in _columns(block)]
    joined = multiplexed(builder, "log_multiplexer", ports)
    LogVectorOutput(joined, builder, publish_period=tick_s).set_name("log")


def multiplexed(builder: DiagramBuilder, name: str, ports: Sequence[Any]) -> Any:
    """Joins several vector-valued output ports into one port that carries all values.

    ``name`` is the name of the multiplexer.
    """
    block = builder.AddNamedSystem(name, Multiplexer([port.size() for port in ports]))
    for index, port in enumerate(ports):
        builder.Connect(port, block.get_input_port(index))
    return block.get_output_port(0)
