"""From the name of a law to its controller block."""

from __future__ import annotations

import inspect
from typing import Any

from pydrake.systems.framework import LeafSystem

from diagrams.own_laws import checked_law, import_law, law_files, try_law
from diagrams.scenario import Scenario
from systems import RadialLawController
from systems.framework.input_error import InputError
from systems.laws.catalogue import LAWS
from systems.laws.law import Law

__all__ = ["LAWS", "law_files", "make_controller"]

#: Output ports that the diagram or its log needs, with their sizes.
_OUTPUTS = {"acceleration_W": 2, "forces_W": 4, "obstacle_speeds": 3}


def make_controller(scenario: Scenario) -> Any:
    """Builds the controller that ``scenario.law`` names.

    ``package.module:Name`` or ``path/to/file.py:Name`` is a function
    ``law(c, s, repulsion)`` that returns the force away from an obstacle in N, or
    a LeafSystem class with the ports of ``RadialLawController`` that takes
    ``robot``, ``attraction`` and ``repulsion``. It is looked up in the working
    directory, too. A function is tried at a few distances and speeds.

    Raises:
        InputError: There is no such law, or it does not do what a law does.
    """
    parts = {
        "robot": scenario.robot,
        "attraction": scenario.attraction,
        "repulsion": scenario.repulsion,
    }
    sensors = scenario.ultrasonic
    if scenario.obstacle_sensing == "ideal":
        sensors = sensors.model_copy(update={"firing": "simultaneous"})
    name = scenario.law
    if name in LAWS:
        return _block(LAWS[name], parts | {"sensors": sensors})
    if ":" not in name:
        raise InputError(
            "law",
            f"{name!r} is not known; use {', '.join(LAWS)}, package.module:Name, or "
            "path/to/file.py:Name",
        )
    law = import_law(name)
    if inspect.isclass(law):
        return _own_block(name, law, parts)
    function = checked_law(name, law)
    reach, top_speed = scenario.ultrasonic.maximum_range_m, scenario.robot.top_speed_m_s
    try_law(function, scenario.repulsion, reach, top_speed)
    return RadialLawController(**parts, sensors=sensors, law=function)


def _block(law: Law, parts: dict[str, Any]) -> Any:
    if law.controller is not None:
        return law.controller(**parts)
    force = law.force
    assert force is not None, f"{law.name} has neither force nor block"
    arguments = law.arguments(parts["repulsion"], parts["sensors"].minimum_range_m)
    return RadialLawController(
        **parts, law=lambda c, s, repulsion: force(c, s, *arguments)
    )


def _own_block(name: str, law: type, parts: dict[str, Any]) -> Any:
    if not issubclass(law, LeafSystem):
        raise InputError(
            "law",
            f"{name!r} is a class, but no LeafSystem; write a function "
            "law(c, s, repulsion), or derive it from a controller of ours",
        )
    try:
        block = law(**parts)
    except (Exception, SystemExit) as error:  # whatever it raises
        raise InputError(
            "law",
            f"{name!r} cannot be built with robot, attraction and repulsion "
            f"({type(error).__name__}: {error}); mend it",
        ) from error
    sizes = {
        port.get_name(): port.size()
        for port in map(block.get_output_port, range(block.num_output_ports()))
    }
    for port, size in _OUTPUTS.items():
        if sizes.get(port) != size:
            raise InputError(
                "law", f"{name!r} needs an output port {port} of size {size}; add it"
            )
    return block
