"""What the fields of a parameter model mean: their docstrings.

They are read when they are asked for. Pydantic can read them, too, but does so for
every model as it is loaded, which takes a quarter of the time of loading a scenario.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from itertools import pairwise

from systems.framework.parameters import Parameters


def meanings(model: type[Parameters]) -> dict[str, str]:
    """Docstrings of a model's fields, those of its bases included.

    Args:
        model: The model.

    Returns:
        By field, without indentation; a field that has none is left out.
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
    except (OSError, TypeError):  # made by ``create_model``
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
