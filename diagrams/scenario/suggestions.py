"""Suggests valid names that are similar to a mistyped name."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from difflib import get_close_matches
from typing import Any

from systems.framework.input_error import InputError


def nearest(name: str, known: Iterable[str]) -> str:
    """Returns the known name that is most similar to a name; empty if none is."""
    by_folded = {each.casefold(): each for each in known}
    near = get_close_matches(name.casefold(), by_folded, n=1)
    return by_folded[near[0]] if near else ""


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """Returns a text that suggests similar names, for the end of an error message.

    The text suggests up to ``most`` of the names ``known``. It is empty if none is
    similar to ``name``.
    """
    by_folded = {each.casefold(): each for each in known}
    near = get_close_matches(name.casefold(), by_folded, n=most)
    if not near:
        return ""
    return f" (did you mean {' or '.join(repr(by_folded[each]) for each in near)}?)"


#: One law or several, as users give them in Python: a name, or a function or class.
Laws = str | Callable[..., Any] | Iterable[str | Callable[..., Any]]


def law_names(laws: Laws) -> list[str]:
    """Returns the names of laws that a user has given.

    Args:
        laws: One text with commas, or several texts, which may have commas, too.
            Functions and classes may replace texts.

    Returns:
        The names in order, each once.
    """
    given = [laws] if isinstance(laws, str) or callable(laws) else laws
    names: list[str] = []
    for each in given:
        if isinstance(each, str):
            names += [name.strip() for name in each.split(",")]
        else:
            from diagrams.scenario.own_objects import name_of

            names.append(name_of(each))
    return list(dict.fromkeys(filter(None, names)))


def unknown_law(name: str, known: Collection[str]) -> InputError:
    """Returns the error for a control law whose name is unknown.

    ``known`` has the names of the known laws.
    """
    if name.endswith(".py"):
        return InputError("", f"{name!r} is a file; name its law: {name}:NAME")
    near = did_you_mean(name, known)
    return InputError(
        "",  # the model with the field adds the path
        f"{name!r} is not known; use {', '.join(known)}, or file.py:Name{near}",
    )
