"""What pydantic finds wrong, as one line of our own."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel, ValidationError

from systems.framework.input_error import InputError, shortened

__all__ = ["did_you_mean", "explain"]


def explain(error: ValidationError, model: type[BaseModel], what: str) -> InputError:
    """The first complaint, as field, value and remedy on one line.

    Args:
        error: What pydantic found.
        model: The model that it validated.
        what: What the model is to a user, as 'a scenario'.

    Returns:
        The error, to be raised.
    """
    first = error.errors(include_url=False)[0]
    field = ".".join(str(part) for part in first["loc"])
    kind, message = first["type"], first["msg"]
    if kind == "extra_forbidden":
        message = f"is not a field of {what}; remove it"
        return InputError(field, message + _near(field, model))
    if kind == "value_error":
        # A validator of several fields names the one to mend.
        inner = first["ctx"]["error"]
        named = [field, getattr(inner, "field", "")]
        text = inner.message if isinstance(inner, InputError) else str(inner)
        return InputError(".".join(filter(None, named)), text)
    # Words of YAML for words of Python.
    message = re.sub(r"dictionary or instance of \w+", "mapping", message)
    message = message.replace("valid tuple", "valid list")
    value = shortened(repr(first["input"]), 80)
    return InputError(field, f"is {value}; {message[0].lower()}{message[1:]}")


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of a message that names what is most like a name.

    Args:
        name: What was given.
        known: What could be.

    Returns:
        Empty where nothing is like it.
    """
    from difflib import get_close_matches

    names = get_close_matches(name, list(known), n=1)
    return f" (did you mean {names[0]!r}?)" if names else ""


def _near(field: str, model: Any) -> str:
    """A field of a similar name at the same place, if there is one."""
    *parents, last = field.split(".")
    for part in parents:
        info = getattr(model, "model_fields", {}).get(part)
        model = info.annotation if info else None
    return did_you_mean(last, getattr(model, "model_fields", {}))
