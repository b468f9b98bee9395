"""Laws that the robots of a scenario can have."""

from __future__ import annotations

from diagrams.scenario.scenario import Scenario
from diagrams.scenario.suggestions import Laws, law_names
from systems.laws.catalog import LAWS


def is_routed(scenario: Scenario) -> bool:
    """Returns whether robots of the scenario drive on routes."""
    return any(robot.kind == "router" for robot in scenario.robots.values())


def chosen_names(laws: Laws, scenario: Scenario) -> list[str]:
    """Returns the names of laws that a user has given for a scenario, each once.

    Args:
        laws: Names, or functions and classes, as in ``law_names``. ``all`` means every
            law for robots of this kind, except ``none``.
        scenario: The scenario.

    Returns:
        The names in order. They are not checked.
    """
    kind = "router" if is_routed(scenario) else "follower"
    every = [name for name, law in LAWS.items() if law.robot == kind and name != "none"]
    names = law_names(laws)
    named = [law for name in names for law in (every if name == "all" else [name])]
    return list(dict.fromkeys(named))
