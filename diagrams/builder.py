"""Wires the blocks into the sound-following robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, Multiplexer, VectorLogSink

from diagrams.laws import make_command, make_controller
from diagrams.scenario import Scenario
from systems import (
    CollisionVector,
    DiffDrivePlant,
    IdealObstacleSensor,
    IdealSourceSensor,
    MicArray,
    Obstacles,
    SoundEmitter,
    SourceRobot,
    SourceTracker,
    TDOAEstimator,
    UltrasonicArray,
    WheelOdometry,
)
from systems.framework.input_error import InputError
from systems.framework.signals import FRAME_PERIOD_S
from systems.sound.waveforms import SoundParameters

__all__ = ["SoundFollower", "block_seed", "build_sound_follower"]

#: Ports that a logged build records at every tick, where they exist: (block, port).
LOGGED_PORTS = (
    ("plant", "pose_WB"),
    ("plant", "velocity_WB"),
    ("source", "pose_WS"),
    ("hearing", "p_PS_B"),
    ("hearing", "detected"),
    ("hearing", "range_valid"),
    ("tracker", "p_WS_estimated"),
    ("tracker", "target_valid"),
    ("odometry", "pose_WB_estimated"),
    ("collision", "collision_vectors_B"),
    ("collision", "features"),
    ("controller", "forces_W"),
    ("controller", "obstacle_speeds"),
    ("command", "wheel_speeds"),
    ("command", "v_WP"),
    ("ultrasonic", "ranges"),
    ("ultrasonic", "echo"),
)
#: Those that it records besides where ``plant.friction`` is set.
LOGGED_WITH_FRICTION = (("plant", "slip_velocities"),)


@dataclass(frozen=True)
class SoundFollower:
    """A built diagram, with its blocks by role.

    Roles: plant, odometry, source, obstacles, hearing, tracker, collision,
    controller, command; with audio also emitter and microphones, and
    source_<name> and emitter_<name> of each interferer; with ultrasonic
    sensing also ultrasonic.
    """

    diagram: Diagram
    scenario: Scenario
    blocks: dict[str, Any]
    log: VectorLogSink | None
    """Rows of the logged ports, one after the other; none unless asked for."""
    logged: tuple[tuple[str, str], ...]
    """(role, port) of what the log holds, in order."""

    def port(self, role: str, name: str) -> Any:
        """Output port of a block."""
        return self.blocks[role].GetOutputPort(name)


def block_seed(seed: int, name: str) -> int:
    """A block's own seed: depends on the scenario's seed and its name alone."""
    sequence = np.random.SeedSequence([seed, crc32(name.encode())])
    return int(sequence.generate_state(1, np.uint64)[0])


def build_sound_follower(scenario: Scenario, *, log: bool = False) -> SoundFollower:
    """Builds the diagram of a scenario.

    The same function builds every fidelity: ``hearing`` and
    ``obstacle_sensing`` choose blocks with the same ports. With both ideal
    and ``odometry.rounding`` off the diagram converts to AutoDiffXd.

    Args:
        scenario: What to build.
        log: Whether to add a log of every port in ``LOGGED_PORTS``, and of
            those in ``LOGGED_WITH_FRICTION`` where there is friction.

    Raises:
        InputError: The law is not known.
        InputError: The sound file cannot be played.
    """
    builder = DiagramBuilder()
    blocks = {
        "source": SourceRobot(source=scenario.source),
        "obstacles": Obstacles(obstacles=scenario.obstacles),
        "plant": DiffDrivePlant(
            robot=scenario.robot,
            plant=scenario.plant,
            initial_pose=scenario.start.pose,
        ),
        "odometry": WheelOdometry(
            robot=scenario.robot,
            odometry=scenario.odometry,
            initial_pose=scenario.start.pose,
        ),
        **_hearing(scenario),
        "tracker": _tracker(scenario),
        **_obstacle_sensing(scenario),
        "controller": (controller := make_controller(scenario)),
        "command": make_command(controller, scenario.robot),
    }
    for block in blocks.values():
        builder.AddNamedSystem(block.get_name(), block)
    _connect_by_name(builder, list(blocks.values()))
    friction = scenario.plant.friction is not None
    sink, logged = _add_log(builder, blocks, friction=friction) if log else (None, ())
    diagram = builder.Build()
    diagram.set_name("sound_follower")
    return SoundFollower(diagram, scenario, blocks, sink, logged)


def _add_log(
    builder: DiagramBuilder, blocks: dict[str, Any], *, friction: bool
) -> tuple[VectorLogSink, tuple[tuple[str, str], ...]]:
    """One sink behind a multiplexer: a third cheaper than a sink a port."""
    logged = tuple(key for key in LOGGED_PORTS if key[0] in blocks)
    if friction:
        logged += LOGGED_WITH_FRICTION
    ports = [blocks[role].GetOutputPort(name) for role, name in logged]
    multiplexer = builder.AddNamedSystem(
        "log_multiplexer", Multiplexer([port.size() for port in ports])
    )
    for index, port in enumerate(ports):
        builder.Connect(port, multiplexer.get_input_port(index))
    sink = LogVectorOutput(
        multiplexer.get_output_port(0), builder, publish_period=FRAME_PERIOD_S
    )
    sink.set_name("log")
    return sink, logged


def _hearing(scenario: Scenario) -> dict[str, Any]:
    if scenario.hearing == "ideal":
        return {
            "hearing": IdealSourceSensor(
                robot=scenario.robot,
                hearing=scenario.ideal_hearing,
                sound=scenario.sound,
                seed=block_seed(scenario.seed, "ideal_source_sensor"),
            )
        }
    microphones = MicArray(
        parameters=scenario.microphones,
        robot=scenario.robot,
        acoustics=scenario.acoustics,
        room=scenario.room,
        interferers=[interferer.name for interferer in scenario.interferers],
        seed=block_seed(scenario.seed, "mic_array"),
    )
    emitters = {"emitter": _emitter(scenario, scenario.sound, microphones)}
    for k, interferer in enumerate(scenario.interferers):
        suffix = f"_{interferer.name}"
        robot = SourceRobot(source=interferer, suffix=suffix)
        emitters[f"source{suffix}"] = robot
        try:
            emitter = _emitter(scenario, interferer.sound, microphones, suffix)
        except InputError as error:
            field = f"interferers.{k}.{error.field}"
            raise InputError(field, error.message) from None
        emitters[f"emitter{suffix}"] = emitter
    return {
        **emitters,
        "microphones": microphones,
        "hearing": TDOAEstimator(
            parameters=scenario.tdoa,
            robot=scenario.robot,
            acoustics=scenario.acoustics,
        ),
    }


def _emitter(
    scenario: Scenario, sound: SoundParameters, microphones: MicArray, suffix: str = ""
) -> SoundEmitter:
    return SoundEmitter(
        sound=sound,
        acoustics=scenario.acoustics,
        maximum_range_m=microphones.maximum_range_m,
        seed=block_seed(scenario.seed, f"sound_emitter{suffix}"),
        suffix=suffix,
    )


def _tracker(scenario: Scenario) -> Any:
    """An ideal estimate is a tick old, one from audio half a frame more.

    It also is what its covariance says, and tells front from back.
    """
    tracker, age = scenario.tracker, 1.5 * FRAME_PERIOD_S
    if scenario.hearing == "ideal":
        exact = {"resolve_front_back": False, "measurement_floor_m": 0.0}
        tracker = tracker.model_copy(update=exact)
        age = FRAME_PERIOD_S
    return SourceTracker(robot=scenario.robot, tracker=tracker, measurement_age_s=age)


def _obstacle_sensing(scenario: Scenario) -> dict[str, Any]:
    bodies: dict[str, Any] = {
        "robot": scenario.robot,
        "source_size": scenario.source_size,
        "obstacle_count": len(scenario.obstacles),
    }
    if scenario.obstacle_sensing == "ideal":
        return {
            "collision": IdealObstacleSensor(
                maximum_range_m=scenario.ultrasonic.maximum_range_m,
                all_bodies=scenario.collision_vector.aggregation == "sum",
                **bodies,
            )
        }
    return {
        "ultrasonic": UltrasonicArray(
            parameters=scenario.ultrasonic,
            acoustics=scenario.acoustics,
            seed=block_seed(scenario.seed, "ultrasonic_array"),
            **bodies,
        ),
        "collision": CollisionVector(
            parameters=scenario.collision_vector,
            sensors=scenario.ultrasonic,
            robot=scenario.robot,
            initial_pose=scenario.start.pose,
        ),
    }


def _connect_by_name(builder: DiagramBuilder, blocks: Sequence[Any]) -> None:
    """Joins every input port to the one output port of the same name.

    A quantity has one name on every port (see docs/model.md), so the wiring
    needs no list; an input whose quantity nobody or more than one block
    publishes is an error.
    """
    outputs: dict[str, list[Any]] = {}
    for block in blocks:
        for index in range(block.num_output_ports()):
            port = block.get_output_port(index)
            outputs.setdefault(port.get_name(), []).append(port)
    for block in blocks:
        for index in range(block.num_input_ports()):
            port = block.get_input_port(index)
            sources = outputs.get(port.get_name(), [])
            if len(sources) != 1:
                raise InputError(
                    f"{block.get_name()}",
                    f"{len(sources)} blocks publish "
                    f"{port.get_name()!r}, which it needs; give one block an output "
                    "port of that name",
                )
            builder.Connect(sources[0], port)
