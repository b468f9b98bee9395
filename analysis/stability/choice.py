"""Choice of the robot and of the laws that a stability report covers."""

from __future__ import annotations

from collections.abc import Sequence

from diagrams.scenario.scenario import Scenario, scenario_from_mapping
from systems.framework.input_error import InputError
from systems.laws.catalogue import FORCE_LAWS, LAWS, ROUTE_LAWS


def chosen_laws(scenario: Scenario, names: Sequence[str]) -> tuple[Scenario, ...]:
    """Returns copies of a scenario, each of which has one of the chosen laws.

    Args:
        scenario: The scenario with any number of robots of which one is analyzed.
        names: Names of the chosen laws. The name ``all`` means all force laws except
            ``none``, or all route laws for a robot on a route. If the sequence is
            empty, the only law is the law of the scenario.

    Returns:
        One scenario per law, in the order of the names. If a law occurs more than once,
        only the first occurrence counts.

    Raises:
        InputError: A law does not exist, or it cannot be analyzed for this robot.
    """
    routed = scenario.only.kind == "router"
    every = list(ROUTE_LAWS if routed else FORCE_LAWS)
    if not routed:
        every.remove("none")
    if scenario.only.searches is not None:
        every = [scenario.only.law]
    laws = [law for name in names for law in (every if name == "all" else [name])]
    for law in laws or [scenario.only.law]:
        if routed and law not in every:
            raise InputError(
                "law",
                f"is {law!r}, but the robot has a route; use {', '.join(every)}",
            )
        if scenario.only.searches is not None:
            if law != scenario.only.law:
                raise InputError(
                    "law",
                    f"is {law!r}, but the robot searches by law {scenario.only.law!r}; "
                    "leave --law out",
                )
            continue
        if not routed and law in LAWS and law not in FORCE_LAWS:
            raise InputError(
                "law",
                f"{law!r} plans and decides, so that it has no linear model; use "
                f"{', '.join(every)}, and add --guard on to include the promises of "
                "the guard",
            )
    return tuple(
        scenario_from_mapping({**scenario.model_dump(), "law": law})
        for law in dict.fromkeys(laws or [scenario.only.law])
    )


def chosen_robot(scenario: Scenario, name: str | None) -> tuple[Scenario, str]:
    """Returns a scenario with only the robot that is analyzed and what it follows.

    Args:
        scenario: Any scenario.
        name: Name of the robot. If the name is None, the first robot is analyzed.

    Returns:
        The first value is the scenario without all other robots. The second value is a
        sentence that lists the removed robots. If the scenario has only one robot, this
        sentence is empty.

    Raises:
        InputError: The scenario has no robot with this name.
    """
    names = list(scenario.robots)
    if name is not None and name not in names:
        raise InputError(
            "robot", f"{name!r} is not a robot of the scenario; use {', '.join(names)}"
        )
    chosen = names[0] if name is None else name
    others = [each for each in names if each != chosen]
    if not others:
        return scenario.of_robot(chosen), ""
    # No other robot is left that could hear the loudspeaker.
    alone = scenario.of_robot(chosen).with_robot(loudspeaker=None)
    note = f"the report covers robot {chosen!r} alone, without {', '.join(others)}"
    if name is None:
        note += "; the option robot selects another robot"
    return alone, note
