"""Runs a scenario in which signals of a test replace signals of a robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import diagrams
from diagrams.scenario.loading import changed_scenario
from diagrams.scenario.scenario import Scenario
from phonotaxis.runs import RunResult
from systems.framework.input_error import InputError


def drive(
    scenario: Scenario | str | Path,
    signals: Mapping[str, Any],
    /,
    *,
    robot: str | None = None,
    **fields: Any,
) -> RunResult:
    """Runs a scenario in which given signals replace quantities of a robot.

    All blocks of the robot read the signal instead of the quantity of the same name,
    and the table of the run contains the signal. Each signal is constant during a tick
    (control period). The run uses Drake's engine.

    Example: ``drive("wall", {"target_valid": lambda t: t < 2.0})`` runs a robot that
    does not know the source any more after 2 s.

    Args:
        scenario: A scenario, the name of a scenario, or the path of a YAML file.
        signals: Signals by name of the quantity, which is the name of its ports (see
            ``diagram.svg`` of a run). A signal is a constant value or a function of the
            time in s. Values are as for ``evaluate``.
        robot: Name of the robot. None: the only robot.
        **fields: Fields of the scenario to change, as for ``phonotaxis.simulate``.

    Returns:
        The result of the run.

    Raises:
        InputError: No block of the robot reads a quantity, a value has the wrong
            number of elements, or the scenario is not valid.
    """
    run = changed_scenario(scenario, (), fields)
    name = robot or next(iter(run.robots))
    if name not in run.robots or (robot is None and len(run.robots) > 1):
        raise InputError(
            "robot",
            f"is {robot!r}; write robot= and one of {', '.join(map(repr, run.robots))}",
        )
    functions = {quantity: _function(value) for quantity, value in signals.items()}
    follower = diagrams.build_sound_follower(run, log=True, signals={name: functions})
    return RunResult.of(diagrams.simulate(run, follower=follower, engine="drake"))


def _function(value: Any) -> Callable[[float], Any]:
    if callable(value):
        return lambda time_s: _as_vector(value(time_s))
    constant = _as_vector(value)
    return lambda _: constant


def _as_vector(value: Any) -> Any:
    """Returns numbers as a vector, and any other object as it is."""
    if isinstance(value, int | float | list | np.ndarray | np.generic):
        return np.atleast_1d(np.asarray(value, dtype=float))
    return value
