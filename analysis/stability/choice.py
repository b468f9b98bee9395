"""Which robot and which laws a report is of."""

from __future__ import annotations

from collections.abc import Sequence

from diagrams.scenario.scenario import Scenario, scenario_from_mapping
from systems.framework.input_error import InputError
from systems.laws.catalogue import FORCE_LAWS, LAWS, ROUTE_LAWS


def chosen_laws(scenario: Scenario, names: Sequence[str]) -> tuple[Scenario, ...]:
    """The same scenario under one law after the other.

    Args:
        scenario: Any scenario.
        names: Laws; ``all`` stands for those that avoid obstacles, or that drive on a
            route; none at all: the scenario's own.

    Returns:
        One a law; a law that is named twice comes once.

    Raises:
        InputError: There is no such law.
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
    """The robot of a scenario that is analysed, alone with what it follows.

    Args:
        scenario: Any scenario.
        name: Of the robot; none: the first one.

    Returns:
        The scenario as if it were alone, and a line that says so; the line is empty
        where there are no others.

    Raises:
        InputError: There is no such robot.
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
    # Alone there is nobody to hear it.
    alone = scenario.of_robot(chosen).with_robot(loudspeaker=None)
    note = f"the report covers robot {chosen!r} alone, without {', '.join(others)}"
    if name is None:
        note += "; the option robot selects another robot"
    return alone, note
