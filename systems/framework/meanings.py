"""Reads the meanings of the fields of a parameter model from their docstrings.

The docstrings are read only on request. Pydantic could read them whenever a model is
imported. However, this would take a quarter of the time to load a scenario.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from itertools import pairwise

from systems.framework.parameters import Parameters


def meanings(model: type[Parameters]) -> dict[str, str]:
    """Returns the docstrings of the fields of a model, without indentation, by field.

    The result includes fields of base classes. It omits fields without a docstring.
    """
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if issubclass(base, Parameters) and base.__module__ != Parameters.__module__:
            found |= _of_class(base)
    for name, info in model.model_fields.items():
        if info.description:
            found[name] = info.description
    return found


def _of_class(model: type[Parameters]) -> dict[str, str]:
    try:
        source = textwrap.dedent(inspect.getsource(model))
    except (OSError, TypeError):  # a model that ``create_model`` made
        return {}
    node = ast.parse(source).body[0]
    assert isinstance(node, ast.ClassDef | ast.If)
    found = {}
    for field, after in pairwise(node.body):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            text = getattr(after, "value", None)
            if isinstance(after, ast.Expr) and isinstance(text, ast.Constant):
                found[field.target.id] = inspect.cleandoc(str(text.value))
    return found
