"""Choice of the robot and of the laws that a stability report covers."""

from __future__ import annotations

from collections.abc import Sequence

from diagrams.scenario.scenario import Scenario, scenario_from_mapping
from systems.framework.input_error import InputError
from systems.laws.catalog import FORCE_LAWS, LAWS, ROUTE_LAWS


def chosen_laws(scenario: Scenario, names: Sequence[str]) -> tuple[Scenario, ...]:
    """Returns one copy of a scenario for each chosen law, in the order of the names.

    The name ``all`` means all laws that compute a force (``FORCE_LAWS``), except the
    law ``none``. For a robot on a route, ``all`` means all laws for routes. For a robot
    that searches, ``all`` means the law of the scenario. If there are no names, the law
    of the scenario is chosen. A law that is named twice has one copy. The function
    raises an InputError if a law does not exist, or if the report cannot analyze this
    law for this robot.
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
                "law", f"is {law!r}, but the robot has a route; use {', '.join(every)}"
            )
        if scenario.only.searches is not None:
            if law != scenario.only.law:
                raise InputError(
                    "law",
                    f"is {law!r}, but the robot searches by law {scenario.only.law!r}; "
                    "leave --law out",
                )
            continue
        if plans(law):
            if set(laws or [law]) != {law}:
                raise InputError(
                    "law",
                    f"{law!r} has other sections than laws that compute a force; "
                    f"analyze it alone: --law {law}",
                )
            continue
        if not routed and law in LAWS and law not in FORCE_LAWS:
            raise InputError(
                "law",
                f"{law!r} decides anew in each tick, so that it has no linear model; "
                f"use {', '.join(every)}, and add --guard on to include the promises "
                "of the guard, or use guarded",
            )
    return tuple(
        scenario_from_mapping({**scenario.model_dump(), "law": law})
        for law in dict.fromkeys(laws or [scenario.only.law])
    )


def plans(law: str) -> bool:
    """Whether a law is the guarded law, which commands motions along a way."""
    return law in LAWS and LAWS[law].guarded


def chosen_robot(scenario: Scenario, name: str | None) -> tuple[Scenario, str]:
    """Returns a scenario with only one robot, and a text that lists the other robots.

    The new scenario also contains the source that the robot follows. ``name`` is the
    name of the robot; None means the first robot. If the scenario has only one robot,
    the text is empty. The function raises an InputError if the scenario has no robot
    with this name.
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
