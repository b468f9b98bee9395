"""Makes the controller block of a law, and the block that drives the wheels."""

from __future__ import annotations

import inspect
from typing import Any

from pydrake.systems.framework import LeafSystem

from diagrams.building.own_laws import checked_law, try_law, why_by_differences
from diagrams.building.robots.routed_robot import make_trajectory_controller
from diagrams.building.robots.searching_robot import search_controller
from diagrams.scenario.own_classes import asked_for, made
from diagrams.scenario.own_code import import_own
from diagrams.scenario.own_gains import check_own_gains, law_arguments, set_gains
from diagrams.scenario.participants import (
    Follower,
    HasRangeSensors,
    LawGains,
)
from diagrams.scenario.scenario import Scenario
from systems import RadialLawController, WheelCommand
from systems.base.robot import RobotParameters
from systems.base.wheel_speed_command import COMMANDS
from systems.framework.input_error import InputError
from systems.framework.signals import TICK_S
from systems.laws.catalog import LAWS, ROUTE_LAWS
from systems.ranging.collision_vector import SLOTS

#: Optional output ports of a law for the log, with sizes.
_TOLD = {"forces_W": 4, "obstacle_speeds": SLOTS}


def make_controller(scenario: Scenario, *, bodies: int = 0, seed: int = 0) -> Any:
    """Builds the controller block for the control law that ``scenario.law`` names.

    ``scenario.law`` is the name of a law of the package, or of a user's own law. The
    name of a user's law is ``package.module:Name`` or ``path/to/file.py:Name``. Python
    also searches the working directory. A user's law is a function or a class:

    - A function ``law(c, s)`` or ``law(c, s, laws)`` returns the force away from an
      obstacle, N. c is the distance of the obstacle, m, and s is its speed, m/s.
      ``laws`` contains the gains of all laws of the package. ``make_controller`` tests
      the function at several distances and speeds.
    - A class derives from LeafSystem. Each of its input ports has the name of an output
      port in the diagram. It has exactly one of the output ports that ``make_command``
      accepts. Its constructor can take any of the arguments ``robot``, ``attraction``,
      ``laws``, ``gains``, ``velocity_term``, ``sensors``, ``tick_s``, ``guard``,
      ``bodies`` and ``seed``. Only a robot that follows a sound has ``attraction``,
      ``velocity_term`` and ``guard``. If the class derives from the block of a law of
      the package, ``gains`` are the gains of that law.

    Further arguments with a number as default are gains, which ``own_gains`` sets.

    Args:
        scenario: Scenario with the law and the parameters of its block.
        bodies: Number of rectangles in the inputs ``poses_WO`` and ``sizes``.
        seed: Seed of a law that uses random numbers.

    Returns:
        The controller block.

    Raises:
        InputError: The law does not exist, or is neither a valid function nor a valid
            class.
    """
    robot = scenario.only
    if robot.searches is not None:
        return search_controller(scenario)
    if robot.law in ROUTE_LAWS:
        return make_trajectory_controller(scenario)
    assert isinstance(robot, HasRangeSensors)
    sensors = robot.ultrasonic
    if robot.obstacle_sensing == "ideal":
        at_once = {"firing": "simultaneous", "period_s": scenario.tick_s}
        sensors = sensors.model_copy(update=at_once)
    name = robot.law
    parts = {
        "gains": robot.gains,
        "robot": robot.robot,
        "tick_s": scenario.tick_s,
        "sensors": sensors,
        "bodies": bodies,
        "seed": seed,
    }
    if isinstance(robot, Follower):
        parts |= {
            "attraction": robot.attraction,
            "velocity_term": robot.collision_vector.velocity_term,
            "guard": robot.own_map,
            "plant": robot.plant,
        }
    if name in LAWS:
        controller = LAWS[name].controller
        if controller is not None:
            return controller(**asked_for(controller, parts))
        return _radial(LAWS[name], parts)
    check_own_gains(robot)
    law = import_own(name, "law")
    if inspect.isclass(law):
        gains = robot.gains
        if isinstance(robot, Follower):
            gains = _gains_of_base(law, robot.laws)
        parts |= {"laws": robot.laws, "gains": gains}
        return _own_block(name, law, parts | set_gains(law, robot.own_gains))
    function = checked_law(name, law)
    arguments = law_arguments(law, robot.laws, robot.own_gains)
    reach, top_speed = robot.ultrasonic.maximum_range_m, robot.robot.top_speed_m_s
    try_law(function, arguments, reach, top_speed)
    return _radial(function, {**parts, "arguments": arguments})


def why_law_by_differences(scenario: Scenario) -> str:
    """Returns why the derivatives of a user's own force law are differences.

    The result is empty if Drake differentiates the law, or if it is no user's function.
    """
    robot = scenario.only
    if not isinstance(robot, HasRangeSensors) or ":" not in robot.law:
        return ""
    law = import_own(robot.law, "law")
    if inspect.isclass(law):
        return ""
    arguments = law_arguments(law, robot.laws, robot.own_gains)
    reach, top_speed = robot.ultrasonic.maximum_range_m, robot.robot.top_speed_m_s
    return why_by_differences(law, arguments, reach, top_speed)


def _radial(law: Any, parts: dict[str, Any]) -> Any:
    return RadialLawController(law=law, **asked_for(RadialLawController, parts))


def _gains_of_base(block: type, laws: LawGains) -> Any:
    """Returns the gains of a law of the package, if its block is a base of a class."""
    for name, law in LAWS.items():
        if law.controller is not None and issubclass(block, law.controller):
            return getattr(laws, name, None)
    return None


def _own_block(name: str, law: type, parts: dict[str, Any]) -> Any:
    if not issubclass(law, LeafSystem):
        raise InputError(
            "law",
            f"{name!r} is a class, but not a LeafSystem; write a function law(c, "
            "s, laws), or derive it from a controller of phonotaxis",
        )
    block = made(name, "law", law, parts)
    commanded(block, name)
    sizes = _output_sizes(block)
    for port, size in _TOLD.items():
        if sizes.get(port, size) != size:
            raise InputError(
                "law",
                f"{name!r} has an output port {port} of size {sizes[port]}; make it "
                f"{size}, or leave it out",
            )
    return block


def make_command(
    controller: Any, robot: RobotParameters, tick_s: float = TICK_S
) -> Any:
    """Builds the block that converts the commands of a controller to wheel commands.

    The controller must have exactly one of these output ports of size 2. P is the
    control point ahead of the axle, and W is the world frame:

    - ``acceleration_W``: acceleration of P in W, m/s^2
    - ``velocity_W``: velocity of P in W, m/s
    - ``twist_B``: forward speed, m/s, and yaw rate, rad/s

    Args:
        controller: The controller block.
        robot: Dimensions and limits of the robot.
        tick_s: Control period, s.

    Returns:
        The block. Its input has the same name as the output of the controller.

    Raises:
        InputError: The controller has none or several of these outputs.
    """
    return WheelCommand(command=commanded(controller), robot=robot, tick_s=tick_s)


def commanded(controller: Any, name: str = "") -> str:
    """Returns the name of the output port that carries the commands of a controller.

    ``make_command`` lists the possible ports. If the controller has none or several of
    them, the function raises an ``InputError``, whose message contains the law's name
    ``name``.
    """
    name = name or controller.get_name()
    sizes = _output_sizes(controller)
    found = [port for port in COMMANDS if port in sizes]
    if len(found) == 1 and sizes[found[0]] == 2:
        return found[0]
    has = ", ".join(f"{port} of size {sizes[port]}" for port in found) or "none"
    raise InputError(
        "law",
        f"{name!r} needs one output port of size 2 out of {', '.join(COMMANDS)}, and "
        f"has {has}; {'add one' if not found else 'leave one of size 2'}",
    )


def _output_sizes(block: Any) -> dict[str, int]:
    ports = map(block.get_output_port, range(block.num_output_ports()))
    return {port.get_name(): port.size() for port in ports}
