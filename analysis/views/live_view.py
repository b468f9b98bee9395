"""The Drake system that shows a simulation in Meshcat while it runs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.systems.framework import DiagramBuilder, EventStatus, LeafSystem

from analysis.run_error import RunError
from analysis.views.live_scene import LiveScene, sensor_count
from analysis.views.replay import quiet_drake
from diagrams import Scenario, SoundFollower
from diagrams.scenario.participants import Router

#: Least time between two pictures, s. It is rounded up to whole ticks (control
#: periods), because other times would divide the integration steps and change the run.
_PERIOD_S = 0.025


class LiveView(LeafSystem):
    """Shows the robots, sources and obstacles of a scenario in Meshcat.

    Each input port may stay unconnected. For each robot, for example the robot
    ``robot``, the ports are:

    - ``robot.pose_WB`` (3, m and rad)
    - ``robot.echo``, one flag per range sensor, if it has range sensors
    - ``robot.p_WS_estimated`` (2, m); on a route ``robot.target_state`` (4)
    - ``robot.target_valid`` (1)

    Each source has the port ``source.pose_WS`` (3), and all obstacles share the port
    ``obstacles.poses_WO`` (3 per obstacle). Without these ports, sources and obstacles
    follow the waypoints of the scenario.

    Args:
        scenario: Scenario of the run.
        meshcat: Drake's 3D viewer.
    """

    def __init__(self, scenario: Scenario, meshcat: Meshcat) -> None:
        super().__init__()
        self.set_name("live_view")
        self._scene = LiveScene(scenario, meshcat)
        for name, robot in scenario.robots.items():
            sizes = {"pose_WB": 3, "target_valid": 1, "p_WS_estimated": 2}
            if isinstance(robot, Router):
                sizes["target_state"] = 4
            if count := sensor_count(robot):
                sizes["echo"] = count
            for port, size in sizes.items():
                self.DeclareVectorInputPort(f"{name}.{port}", size)
        for name in scenario.sources:
            self.DeclareVectorInputPort(f"{name}.pose_WS", 3)
        if scenario.all_obstacles:
            shapes = (each.shape() for each in scenario.all_obstacles)
            size = 3 * sum(len(shape.rectangles) for shape in shapes)
            self.DeclareVectorInputPort("obstacles.poses_WO", size)
        period = scenario.tick_s * math.ceil(_PERIOD_S / scenario.tick_s - 1e-9)
        self.DeclareInitializationPublishEvent(self._start)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._show)

    def _start(self, context: Any) -> EventStatus:
        self._scene.start()
        return self._show(context)

    def _show(self, context: Any) -> EventStatus:
        ports = map(self.get_input_port, range(self.num_input_ports()))
        values: dict[str, Any] = {
            port.get_name(): port.Eval(context)
            for port in ports
            if port.HasValue(context)
        }
        self._scene.show(context.get_time(), values)
        return EventStatus.Succeeded()


def add_live_view(
    builder: DiagramBuilder, follower: SoundFollower, meshcat: Meshcat
) -> LiveView:
    """Adds a live view to a Drake diagram that contains the diagram of a scenario.

    The view shows the robots, the sources, the obstacles and the paths that they have
    driven, with the shapes of a replay. ``docs/runs.md`` has an example.

    Args:
        builder: Builder that already contains ``follower.diagram``.
        follower: Result of ``build_sound_follower``.
        meshcat: Drake's 3D viewer, for example ``pydrake.geometry.StartMeshcat()``.

    Returns:
        The system that shows the scene. It is in the builder, and its inputs are
        connected to the outputs of ``follower.diagram``.
    """
    view = LiveView(follower.scenario, meshcat)
    builder.AddNamedSystem("live_view", view)
    for index in range(view.num_input_ports()):
        port = view.get_input_port(index)
        if follower.diagram.HasOutputPort(port.get_name()):
            output = follower.diagram.GetOutputPort(port.get_name())
            builder.Connect(output, port)
    return view


def with_live_view(follower: SoundFollower, meshcat: Meshcat) -> SoundFollower:
    """Returns the same blocks in a diagram that also has a live view."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("run", follower.diagram)
    add_live_view(builder, follower, meshcat)
    diagram = builder.Build()
    diagram.set_name("live_sound_follower")
    return replace(follower, diagram=diagram)


def start_meshcat() -> Meshcat:
    """Starts Meshcat on this computer, without a message of Drake.

    Returns:
        Drake's 3D viewer, which serves its page to browsers on this computer.

    Raises:
        RunError: No port is free.
    """
    with quiet_drake():
        try:
            return Meshcat(MeshcatParams(host="localhost"))
        except RuntimeError as error:
            raise RunError(f"the live view cannot start: {error}") from error
