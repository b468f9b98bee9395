"""Gains of a user's own laws and blocks: arguments with a number as their default.

The field ``own_gains`` of a robot sets such arguments by name. Settings, grids and
draws can therefore vary them, like any field.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from diagrams.scenario.fields.field_list import Field
from diagrams.scenario.own_classes import constructors
from diagrams.scenario.own_code import import_own
from diagrams.scenario.participants import Robot
from diagrams.scenario.suggestions import did_you_mean
from systems.framework.input_error import InputError

#: Arguments that phonotaxis itself passes to the classes of users.
PASSED = frozenset(
    {
        "attraction",
        "bodies",
        "gains",
        "guard",
        "laws",
        "robot",
        "scenario",
        "seed",
        "sensors",
        "tick_s",
        "velocity_term",
    }
)


def default_gains(own: Callable[..., Any]) -> dict[str, float]:
    """Returns the gains of a user's law or block.

    Args:
        own: A function ``law(c, s, ...)``, or the class of a law or a block.

    Returns:
        Default of each argument whose default is a number, by name. The first two
        arguments of a function, and the arguments that phonotaxis passes to a class,
        are no gains.
    """
    parameters = (
        [each for made in constructors(own) for each in _parameters(made)]
        if inspect.isclass(own)
        else _parameters(own)[2:]
    )
    gains: dict[str, float] = {}
    for each in parameters:
        if _is_gain(each) and not (inspect.isclass(own) and each.name in PASSED):
            gains.setdefault(each.name, each.default)  # a class overrides its bases
    return gains


def set_gains(own: Callable[..., Any], values: Mapping[str, float]) -> dict[str, float]:
    """Selects the values that set gains of a law or block.

    Args:
        own: The law or block, see ``default_gains``.
        values: Values by name, from the field ``own_gains``.

    Returns:
        Values by name. They have the type of the default: a whole number if the default
        is one and the value, too, otherwise a float.
    """
    defaults = default_gains(own)
    return {
        name: int(value)
        if isinstance(defaults[name], int) and value.is_integer()
        else value
        for name, value in values.items()
        if name in defaults
    }


def law_arguments(
    law: Callable[..., Any], laws: Any, values: Mapping[str, float]
) -> tuple[Any, ...]:
    """Returns the arguments of a user's function after the distance and the speed.

    Args:
        law: The function, ``law(c, s)`` or ``law(c, s, laws)``, with any gains.
        laws: Gains of all laws of the package.
        values: Values of gains by name, from the field ``own_gains``.

    Returns:
        Values in the order of the arguments. Only an argument without a default, or
        with the name or default of ``laws``, gets ``laws``.
    """
    gains = default_gains(law) | set_gains(law, values)
    arguments: list[Any] = []
    # A function without a signature is written in another language.
    for each in _parameters(law)[2:] if _has_signature(law) else [None]:
        if each is None or each.kind is each.VAR_POSITIONAL:
            arguments.append(laws)
        elif each.kind is each.VAR_KEYWORD:
            continue
        elif each.name in gains:
            arguments.append(gains[each.name])
        elif each.default is each.empty or each.default is None or each.name == "laws":
            arguments.append(laws)
        else:
            arguments.append(each.default)
    return tuple(arguments)


def keyword_only(law: Callable[..., Any]) -> list[str]:
    """Returns the names of a law's arguments that must be passed by their names."""
    return [each.name for each in _parameters(law) if each.kind is each.KEYWORD_ONLY]


def check_own_gains(robot: Robot, prefix: str = "") -> None:
    """Raises an error if a field of ``own_gains`` sets no gain of a robot's own code.

    Without own code, the fields have no effect, like the gains of other laws.

    Args:
        robot: The robot.
        prefix: Path of the robot in the scenario with a dot at its end, or empty.

    Raises:
        InputError: A law or block has no such gain, or cannot be imported.
    """
    own: dict[str, Any] = {}
    if robot.own_gains:
        own = {name: import_own(name, field) for name, field in robot.own_code.items()}
    known = {gain for each in own.values() for gain in default_gains(each)}
    for name in robot.own_gains:
        if own and name not in known:
            whose = " or ".join(map(repr, own))
            raise InputError(
                f"{prefix}own_gains.{name}",
                f"is not a gain of {whose}{did_you_mean(name, known)}; use "
                f"{', '.join(sorted(known))}"
                if known
                else f"{whose} has no gains; give it an argument with a number as "
                f"default, {name}=1.0",
            )


def gain_fields(law: str) -> list[Field]:
    """Describes the gains of a user's own law, as ``phonotaxis fields`` lists them.

    Args:
        law: Name of the law.

    Returns:
        One field per gain.

    Raises:
        InputError: The law cannot be imported.
    """
    return [
        Field(
            path=f"own_gains.{name}",
            kind="number",
            unit="",
            default=default,
            range="",
            meaning=f"Argument `{name}` of {law}.",
            robots=("follower",),
        )
        for name, default in default_gains(import_own(law, "law")).items()
    ]


def _has_signature(function: Any) -> bool:
    try:
        inspect.signature(function)
    except (TypeError, ValueError):
        return False
    return True


def _parameters(function: Any) -> list[inspect.Parameter]:
    if not _has_signature(function):
        return []
    return [*inspect.signature(function).parameters.values()]


def _is_gain(parameter: inspect.Parameter) -> bool:
    default = parameter.default
    return isinstance(default, int | float) and not isinstance(default, bool)
