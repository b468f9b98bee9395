"""The source code of functions and classes that a user passes as objects."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator
from types import FunctionType, ModuleType
from typing import Any

_LONGEST_VALUE = 200


def outside_values(own: Any) -> dict[str, Any]:
    """Returns the variables outside of a function that the function uses, by name."""
    if inspect.isclass(own):
        found: dict[str, Any] = {}
        for each in filter(inspect.isfunction, vars(own).values()):
            found |= outside_values(each)
        return found
    try:
        used = inspect.getclosurevars(own)
    except (TypeError, ValueError):
        return {}
    return {**used.globals, **used.nonlocals}


def described(own: Any) -> str:
    """Returns the source code of a function or class, and of what it uses.

    The text begins with the functions of the same module that the object uses. Comments
    state other values.
    """
    return "\n\n".join(_texts(own, []))


def _texts(own: Any, known: list[Any]) -> Iterator[str]:
    known.append(own)
    constants = []
    for name, value in outside_values(own).items():
        if isinstance(value, FunctionType) and value.__module__ == own.__module__:
            if value not in known:
                yield from _texts(value, known)
        elif not callable(value) and not isinstance(value, ModuleType):
            text = " ".join(repr(value).split())[:_LONGEST_VALUE]
            constants.append(f"# {name} = {text}\n")
    yield "".join([*constants, _source(own)])


def _source(own: Any) -> str:
    try:
        found = _class_source(own) if inspect.isclass(own) else inspect.getsource(own)
    except (OSError, TypeError, SyntaxError, StopIteration):
        return f"# The source of {own!r} is not available.\n"
    return textwrap.dedent(found)


def _class_source(own: type) -> str:
    """Finds a class in the file or cell of its first function.

    ``inspect.getsource`` does not find the classes of a notebook.
    """
    function = next(filter(inspect.isfunction, vars(own).values()))
    text = "".join(inspect.findsource(function)[0])
    found = next(
        each
        for each in ast.walk(ast.parse(text))
        if isinstance(each, ast.ClassDef) and each.name == own.__name__
    )
    return f"{ast.get_source_segment(text, found, padded=True)}\n"
