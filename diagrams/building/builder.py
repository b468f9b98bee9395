"""Connects robots, sources and obstacles in one diagram."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, VectorLogSink

from diagrams.building.robot import (
    SHOWN,
    Parts,
    make_robot,
    make_source,
    make_world,
    multiplexed,
    parts_of,
)
from diagrams.building.signals import Signal
from diagrams.scenario.scenario import ODOR, WORLD, Scenario
from systems import Obstacles
from systems.framework.input_error import InputError
from systems.sound.parameters import SoundParameters


@dataclass(frozen=True)
class SoundFollower:
    """Contains the diagram of a scenario, and its robots and sources by name.

    If the scenario has only one robot, the properties ``blocks``, ``port``, ``log`` and
    ``logged`` refer to this robot.
    """

    diagram: Diagram
    scenario: Scenario
    robots: Mapping[str, Parts]
    """Blocks of each robot, by name of the robot. The key of a block is its part: its
    role in the robot, such as ``plant``. A robot that follows a sound has the parts
    plant, odometry, hearing, tracker, collision, controller and command. It has the
    part microphones if it hears audio, ultrasonic if it has range sensors, and emitter
    if it has a loudspeaker.
    """
    sources: Mapping[str, Parts]
    """Blocks of each source: source, and with audio also emitter."""
    obstacles: Obstacles
    world: Parts | None = None
    """Blocks that all robots share: wind, plume, radio and sink. None if no robot
    searches.
    """

    @cached_property
    def only(self) -> Parts:
        """The blocks of the only robot.

        Raises:
            InputError: There are several robots.
        """
        if len(self.robots) > 1:
            raise InputError(
                "robots",
                f"there are {len(self.robots)}: {', '.join(self.robots)}; select "
                "a robot by its name (SoundFollower.robots)",
            )
        return next(iter(self.robots.values()))

    @cached_property
    def blocks(self) -> dict[str, Any]:
        """Blocks of the only robot and of its source, and ``obstacles``, by part."""
        robot = self.only
        target = self.scenario.target(next(iter(self.robots)))
        sources = self.sources[target].blocks if target in self.sources else {}
        world = {**sources, "obstacles": self.obstacles}
        return {**world, **robot.blocks}

    @property
    def log(self) -> VectorLogSink | None:
        """The log of the only robot; None if the diagram has no log."""
        return self.only.log

    @property
    def logged(self) -> Mapping[tuple[str, str], tuple[str, ...]]:
        """Columns in the log of the only robot, see ``Parts``."""
        return self.only.logged

    def port(self, part: str, name: str) -> Any:
        """Returns an output port of the only robot, of its source or of the obstacles.

        ``part`` is a key of ``blocks``: the role of the block, such as ``plant``.
        ``name`` is the name of the port. To evaluate the port, use the context of its
        block.
        """
        return self.blocks[part].GetOutputPort(name)


def build_sound_follower(
    scenario: Scenario,
    *,
    log: bool = False,
    signals: Mapping[str, Mapping[str, Signal]] | None = None,
) -> SoundFollower:
    """Builds the diagram of a scenario with all its robots, sources and obstacles.

    Each robot and each source is a diagram inside this diagram (``make_robot``,
    ``make_source``). Each robot can see and hit the obstacles, the other robots and the
    sources, and it hears all sounds.

    You can add the diagram to a diagram of your own. Its outputs are, for example,
    ``robot.pose_WB`` and ``robot.velocity_WB`` of each robot, ``source.pose_WS`` of
    each source, and ``obstacles.poses_WO``. A robot also has the further outputs of
    ``make_robot`` that show what it senses, for example ``robot.p_WS_estimated``.

    Args:
        scenario: The scenario to build.
        log: Whether each robot logs the columns of its blocks.
        signals: Signals that replace quantities of a robot, by name of the robot and
            then by name of the quantity. A signal is a function of the time in s. All
            blocks of the robot then read the signal instead of the quantity.

    Returns:
        The diagram, with the blocks of each robot and source.

    Raises:
        InputError: The law is not known.
        InputError: A sound file cannot be played.
        InputError: No block of the robot reads a quantity in ``signals``.
    """
    driven = signals or {}
    builder = DiagramBuilder()
    audible = audible_sounds(scenario)
    sources = {
        name: make_source(scenario, name, source, audible=name in audible)
        for name, source in scenario.sources.items()
    }
    obstacles = Obstacles(obstacles=scenario.all_obstacles)
    followers = {
        name: robot_of(scenario, name, log=log, signals=driven.get(name))
        for name in scenario.robots
    }
    systems = [*sources.items(), ("obstacles", obstacles), *followers.items()]
    shared = make_world(scenario, log=log)
    if shared is not None:
        systems.insert(0, (WORLD, shared))
    for name, system in systems:
        builder.AddNamedSystem(name, system)
    world = _World(builder, scenario, obstacles, sources, followers, shared)
    for name in followers:
        world.surround(name)
    _export(builder, followers, ("pose_WB", "velocity_WB", *SHOWN))
    _export(builder, sources, ("pose_WS", "v_WS"))
    _export(builder, {"obstacles": obstacles}, ("poses_WO",))
    diagram = builder.Build()
    diagram.set_name("sound_follower")
    return SoundFollower(
        diagram,
        scenario,
        {name: parts_of(system) for name, system in followers.items()},
        {name: parts_of(system) for name, system in sources.items()},
        obstacles,
        parts_of(shared) if shared is not None else None,
    )


def _export(
    builder: DiagramBuilder, systems: Mapping[str, Any], ports: tuple[str, ...]
) -> None:
    """Makes outputs of systems to outputs of the diagram, named ``<system>.<port>``."""
    for name, system in systems.items():
        for port in ports:
            if system.HasOutputPort(port):
                builder.ExportOutput(system.GetOutputPort(port), f"{name}.{port}")


def audible_sounds(scenario: Scenario) -> Mapping[str, SoundParameters]:
    """Returns the sounds of a scenario, provided that a robot hears sound as waves.

    The result has the sound of each source and loudspeaker, by name of the source or
    robot. It is empty if no robot hears sound as waves.
    """
    listens = any(robot.listens for robot in scenario.robots.values())
    return scenario.sounds() if listens else {}


def robot_of(
    scenario: Scenario,
    name: str,
    *,
    log: bool = False,
    signals: Mapping[str, Signal] | None = None,
) -> Diagram:
    """Builds the diagram of one robot of a scenario with ``make_robot``.

    If no robot hears the robot's loudspeaker, the diagram has no loudspeaker.

    Args:
        scenario: Scenario with all robots.
        name: Name of the robot.
        log: Whether the diagram logs the columns of its blocks at every tick (control
            period).
        signals: Signals that replace quantities of the robot, see ``make_robot``.

    Returns:
        The diagram, see ``make_robot``.
    """
    own, target = scenario.of_robot(name), scenario.target(name)
    around = scenario.surroundings(name)
    if name not in audible_sounds(scenario):
        own = own.with_robot(loudspeaker=None)
    return make_robot(
        own,
        name,
        owners=around.owners,
        robots=scenario.robots_seen(name),
        others=[each for each in scenario.sounds() if each != target],
        listeners_frame_s=scenario.longest_frame_s,
        log=log,
        signals=signals,
    )


@dataclass(frozen=True)
class _World:
    """Connects the inputs of robots to the outputs of sources, obstacles and robots."""

    builder: DiagramBuilder
    scenario: Scenario
    obstacles: Any
    sources: Mapping[str, Any]
    robots: Mapping[str, Any]
    shared: Any

    def surround(self, name: str) -> None:
        """Connects all inputs of a robot to sources, obstacles and other robots.

        A robot has only the inputs that its blocks need. The inputs ``poses_WO`` and
        ``sizes`` contain the obstacles first, then the other robots and the sources.
        """
        around, target = self.scenario.surroundings(name), self.scenario.target(name)
        if self.shared is not None:
            for port in ("wind", "plume", "air"):
                self._give(name, port, lambda p=port: self.shared.GetOutputPort(p))
            if self.shared.HasInputPort(f"frames_{name}"):
                frames = self.robots[name].GetOutputPort("frames")
                self.builder.Connect(frames, self.shared.GetInputPort(f"frames_{name}"))
        self._give(name, "pose_WS", lambda: self._pose(target))
        self._give(name, "emission", lambda: self._emission(target))
        for other in self.scenario.sounds():
            self._give(name, f"emission_{other}", lambda o=other: self._emission(o))
        obstacles = len(self.scenario.all_obstacles)
        others = dict([*around.obstacles.items()][obstacles:])
        poses = [self._pose(other) for other in others]
        shapes = [body.shape for body in others.values()]
        sizes = [extent for shape in shapes for extent in shape.rectangles[0, 3:]]
        self._give(name, "poses_WO", lambda: self._joined(name, "poses_WO", poses))
        self._give(
            name,
            "sizes",
            lambda: self._joined(name, "sizes", self._constant(name, sizes)),
        )

    def _give(self, name: str, port: str, source: Any) -> None:
        robot = self.robots[name]
        if robot.HasInputPort(port):
            self.builder.Connect(source(), robot.GetInputPort(port))

    def _pose(self, name: str) -> Any:
        if name in self.sources:
            return self.sources[name].GetOutputPort("pose_WS")
        if name == ODOR:
            assert self.scenario.odor is not None
            return self._constant_port(ODOR, [*self.scenario.odor.position_m, 0.0])
        return self.robots[name].GetOutputPort("pose_WB")

    def _emission(self, name: str) -> Any:
        if name in self.sources:
            return self.sources[name].GetOutputPort("emission")
        return self.robots[name].GetOutputPort("own_emission")

    def _constant(self, name: str, sizes: list[float]) -> list[Any]:
        if not sizes:
            return []
        return [self._constant_port(f"sizes_of_others_for_{name}", sizes)]

    def _constant_port(self, name: str, values: list[float]) -> Any:
        if not self.builder.HasSubsystemNamed(name):
            array: Any = np.array(values)  # untyped: Drake's type stubs reject ndarray
            self.builder.AddNamedSystem(name, ConstantVectorSource(array))
        return self.builder.GetSubsystemByName(name).get_output_port()

    def _joined(self, name: str, port: str, more: list[Any]) -> Any:
        """Returns the port of the obstacles, joined with any further ports."""
        first = self.obstacles.GetOutputPort(port)
        ports = [each for each in (first, *more) if each.size()]
        if len(ports) < 2:
            return ports[0] if ports else first
        return multiplexed(self.builder, f"{port}_for_{name}", ports)
