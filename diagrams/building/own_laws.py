"""Tests a user's own law, and checks its results during a run."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd

from diagrams.building.law_slopes import force_with_slopes
from diagrams.scenario.own_code import is_interrupt, why
from diagrams.scenario.own_gains import keyword_only
from systems.framework.input_error import InputError, shortened


def checked_law(name: str, law: Callable[..., Any]) -> Callable[..., Any]:
    """Wraps a user's control law so that an invalid result raises an error.

    Args:
        name: Name of the law, for the error message.
        law: Function ``law(c, s, ...)`` that returns the force away from an obstacle,
            N. c is the distance of the obstacle, m, and s is its speed, m/s. Further
            arguments are those of ``law_arguments``.

    Returns:
        A function with the same arguments. It returns a finite force, N, as a float or
        AutoDiffXd, or raises an InputError. If the law does not accept AutoDiffXd, the
        derivatives of the force are differences.
    """

    @functools.wraps(law)
    def checked(c: Any, s: Any, *arguments: Any) -> Any:
        try:
            force, _ = force_with_slopes(_force_of(law, arguments), c, s)
        except BaseException as error:  # a user's law may raise any exception
            if is_interrupt(error):
                raise
            raise _failed(name, c, s, f"raises {why(error)}") from error
        if isinstance(force, np.ndarray) and force.shape == ():
            force = force.item()
        if isinstance(force, AutoDiffXd):
            value = force.value()
        elif isinstance(force, float | int | np.floating | np.integer):
            value = force = float(force)
        else:
            kind = type(force).__name__
            raise _failed(name, c, s, f"returns {_brief(force)} ({kind})")
        if not math.isfinite(value):
            raise _failed(name, c, s, f"returns {value}")
        return force

    return checked


def _force_of(
    law: Callable[..., Any], arguments: tuple[Any, ...]
) -> Callable[[Any, Any], Any]:
    """Returns the law as a function of distance and speed alone."""
    named = keyword_only(law)
    if not named:
        return lambda c, s: law(c, s, *arguments)
    given = arguments[: -len(named)]
    keywords = dict(zip(named, arguments[-len(named) :], strict=True))
    return lambda c, s: law(c, s, *given, **keywords)


def why_by_differences(
    law: Callable[..., Any],
    arguments: tuple[Any, ...],
    range_m: float,
    top_speed_m_s: float,
) -> str:
    """Returns why Drake cannot differentiate a user's control law.

    Args:
        law: Function ``law(c, s, ...)``.
        arguments: Arguments of the law after the distance and the speed.
        range_m: Largest tested distance of an obstacle, m.
        top_speed_m_s: Largest tested speed of an obstacle, m/s.

    Returns:
        The reason at the first tested point at which derivatives are differences. It is
        empty if there is none.
    """
    force = _force_of(law, arguments)
    for c, s in _tried(range_m, top_speed_m_s):
        dual = AutoDiffXd(c, np.eye(2)[0]), AutoDiffXd(s, np.eye(2)[1])
        if why := force_with_slopes(force, *dual)[1]:
            return why
    return ""


def _tried(range_m: float, top_speed_m_s: float) -> Iterator[tuple[float, float]]:
    """Yields the distances, m, and speeds, m/s, at which a law is tested."""
    for share in (1e-3, 0.1, 0.5, 1.0):
        for s in (0.0, 0.5 * top_speed_m_s, top_speed_m_s):
            yield share * range_m, s


def try_law(
    law: Callable[..., Any],
    arguments: tuple[Any, ...],
    range_m: float,
    top_speed_m_s: float,
) -> None:
    """Tests a user's control law at several distances and speeds, before the run.

    Args:
        law: A function from ``checked_law``, which raises an error if a result is
            invalid.
        arguments: Arguments of the law after the distance and the speed.
        range_m: Largest tested distance of an obstacle, m.
        top_speed_m_s: Largest tested speed of an obstacle, m/s.

    Raises:
        InputError: The law does not return a finite force at one of the tested points.
    """
    for c, s in _tried(range_m, top_speed_m_s):
        law(c, s, *arguments)


def _failed(name: str, c: Any, s: Any, what: str) -> InputError:
    name = shortened(name, 60)
    at = f"c = {_number(c):.3g} m, s = {_number(s):.3g} m/s"
    return InputError(
        "law",
        f"{name!r} {what} at {at}; write law(c, s) or law(c, s, laws) that returns a "
        "finite force in N",
    )


def _number(value: Any) -> float:
    return float(value.value() if isinstance(value, AutoDiffXd) else value)


def _brief(value: Any) -> str:
    """Returns a short text of any value, even if its ``__repr__`` fails."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001  # a user's __repr__
        return "something"
    return text if len(text) < 40 else f"{text[:37]}..."
