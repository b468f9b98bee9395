"""From the name of a law to its controller block."""

from __future__ import annotations

import importlib
import inspect
import sys
from pathlib import Path
from typing import Any

from diagrams.loading import ScenarioError
from diagrams.scenario import Scenario
from systems import (
    ActiveImpedance2017Controller,
    ActiveImpedanceController,
    ConventionalImpedanceController,
    RadialLawController,
)

__all__ = ["LAWS", "make_controller"]

_CONTROLLERS = {
    "none": RadialLawController,
    "conventional": ConventionalImpedanceController,
    "active": ActiveImpedanceController,
    "active2017": ActiveImpedance2017Controller,
}
#: The laws that come with the package.
LAWS = tuple(_CONTROLLERS)


def make_controller(scenario: Scenario) -> Any:
    """Builds the controller that ``scenario.law`` names.

    ``package.module:Name`` is a function ``law(c, s, repulsion)`` that returns
    the force away from an obstacle in N, or a LeafSystem class with the ports
    of ``RadialLawController`` that takes ``robot``, ``attraction`` and
    ``repulsion``. It is looked up in the working directory, too.

    Raises:
        ScenarioError: There is no such law.
    """
    parts = {
        "robot": scenario.robot,
        "attraction": scenario.attraction,
        "repulsion": scenario.repulsion,
    }
    if scenario.law in _CONTROLLERS:
        return _CONTROLLERS[scenario.law](**parts)
    law = _import_law(scenario.law)
    if inspect.isfunction(law):
        return RadialLawController(**parts, law=law)
    return law(**parts)


def _import_law(name: str) -> Any:
    module_name, colon, attribute = name.partition(":")
    if not colon or not module_name or not attribute:
        raise ScenarioError(
            "law",
            f"{name!r} is not known; use {', '.join(LAWS)}, or package.module:Name",
        )
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise ScenarioError("law", f"{name!r} cannot be imported: {error}") from None
    law = getattr(module, attribute, None)
    if not callable(law):
        raise ScenarioError(
            "law", f"{module_name} has no function or class {attribute!r}; check it"
        )
    return law
